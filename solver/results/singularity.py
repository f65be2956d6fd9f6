"""Singular points of a model, and a fit of the power of stress near one of them.

Near a corner stress is a series of powers of the distance r from it. The first term is unbounded:
stress ~ r^(p-1) with the power p below 1. A straight line through logarithms of values at finite
distances has another slope, because the next term of the series is not small. The fit includes this
term, whose exponent is about 1 larger: between 0.8 and 1.1 at the square corner of equal materials,
without friction and with friction up to 0.4.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.results.quantities import declare
from solver.results.run import FinishedRun, Values
from solver.typing import Array

_EACH = ("singular",)
SINGULAR = declare("singular", "number of the singular point", "", dims=_EACH)
SINGULAR_X = declare("singular_x", "position of the singular point along x", "mm", dims=_EACH)
SINGULAR_Y = declare("singular_y", "position of the singular point along y", "mm", dims=_EACH)
SINGULAR_S = declare(
    "singular_s", "distance along the surface from its middle of the singular point", "mm",
    dims=_EACH,
)  # fmt: skip
SINGULAR_RADIUS = declare(
    "singular_radius", "radius around the singular point in which numbers depend on the mesh", "mm",
    dims=_EACH,
)  # fmt: skip


def singular_points(run: FinishedRun) -> Values:
    """Return positions and radii of the singular points; empty if there are none."""
    if not run.singular:
        return {}
    X = np.array([point.at for point in run.singular]).T
    return {
        SINGULAR: np.arange(len(run.singular)),
        SINGULAR_X: X[0],
        SINGULAR_Y: X[1],
        SINGULAR_S: run.view.axis.reached(X),
        SINGULAR_RADIUS: np.array([point.radius for point in run.singular]),
    }


SINGULAR_POWER = declare(
    "singular_power", "power p of the stress at the corner, proportional to r^(p-1)"
)
SINGULAR_POWER_ERROR = declare("singular_power_error", "uncertainty of the singular power")
SINGULAR_INTENSITY = declare(
    "singular_intensity",
    "ratio of the singular term of contact pressure to mean pressure, one half-width from the "
    "corner",
)
APPARENT_POWER = declare(
    "apparent_power",
    "apparent power of contact pressure, 0.01 to 0.1 half-widths from the corner",
)

_OTHERS = (0.5, 1.5)
"""Factors on the exponent of the next term, for the estimate of the error."""
_FEWEST = 5
"""Least number of points for the three unknowns."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Singularity:
    """Stress ~ ``intensity * r^(power - 1)`` as r tends to 0, and the error of ``power``."""

    power: float
    error: float
    intensity: float


NOWHERE = Singularity(power=np.nan, error=np.nan, intensity=np.nan)


def fit_singularity(
    r: Array, stress: Array, low: float, high: float, above: float = 1.0
) -> Singularity:
    """Return the singular term of stress sampled near a corner.

    1. Use points at ``low <= r <= high``. ``low`` should be ten elements or more, because elements
       at the corner do not resolve the stress; ``high`` should be small compared with the distance
       of any other feature: an edge, a groove, the end of a zone of slip.
    2. Fit ``ln stress = ln C + (p - 1) ln r + b r^q`` with q = ``above`` by least squares. The
       weight of a point is its share of the axis of ln r.
    3. The error is the largest change of p if q is half as large or 1.5 times as large, or if the
       inner or the outer third of the range in ln r is left out; or the standard error of the fit,
       if larger. It does not include an error of elements over the whole range.

    Parameters
    ----------
    r : (n,) distances from the corner
    stress : (n,) stress of one sign, in the unit of ``Singularity.intensity``
    low, high : range of r of the fit
    above : estimate of the exponent of the next term minus that of the first

    Returns
    -------
    Singularity
        all NaN if the range has fewer than five points, or stress of both signs
    """
    points = _logarithms(r, stress, low, high)
    if points is None:
        return NOWHERE
    x = points[0]
    best, deviation = _fit(points, high, above)
    others = [_fit(points, high, share * above)[0] for share in _OTHERS]
    third = np.log(high / low) / 3
    for part in (x <= np.log(high) - third, x >= np.log(low) + third):
        if part.sum() >= _FEWEST:
            others.append(_fit(points[:, part], high, above)[0])
    change = max(abs(other[1] - best[1]) for other in others)
    return Singularity(
        power=float(1 + best[1]),
        error=float(max(change, deviation)),
        intensity=float(np.exp(best[0]) * np.sign(stress[np.argmin(np.abs(r - high))])),
    )


def apparent_power(r: Array, stress: Array, low: float, high: float) -> float:
    """Return the power of a straight line through logarithms, without a next term.

    A measurement between ``low`` and ``high`` would give this power. NaN if the range has fewer
    than five points, or stress of both signs.
    """
    points = _logarithms(r, stress, low, high)
    return float("nan") if points is None else float(1 + _fit(points, high)[0][1])


def _logarithms(r: Array, stress: Array, low: float, high: float) -> Array | None:
    """Return ln r, ln |stress| and weights (3, n) in a range, or None if the fit is impossible."""
    within = (r >= low) & (r <= high)
    order = np.argsort(r[within])
    r, stress = r[within][order], stress[within][order]
    if len(r) < _FEWEST or stress.min() <= 0.0 <= stress.max():
        return None
    x = np.log(r)
    return np.stack([x, np.log(np.abs(stress)), np.gradient(x)])


def _fit(points: Array, high: float, *exponents: float) -> tuple[Array, float]:
    """Return ln C, p - 1 and b for each exponent q, and the standard error of p."""
    x, y, weight = points
    terms = [np.exp(exponent * (x - np.log(high))) for exponent in exponents]
    root = np.sqrt(weight / weight.mean())
    A, b = root[:, None] * np.stack([np.ones_like(x), x, *terms], axis=1), root * y
    found, *_ = np.linalg.lstsq(A, b)
    spread = ((A @ found - b) ** 2).sum() / max(len(x) - A.shape[1], 1)
    return found, float(np.sqrt(spread * np.linalg.inv(A.T @ A)[1, 1]))
