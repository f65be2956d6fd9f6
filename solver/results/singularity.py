"""Power of a singular stress, fitted to values near a corner.

Near a corner stress is a series of powers of the distance r from it, and the first, of power p
below 1, is unbounded: stress ~ r^(p-1). A straight line through logarithms of values at finite
distances has another slope, as the next term of the series is not small yet. It is therefore fitted
too, with an exponent about 1 above the first: between 0.8 and 1.1 at the square corner of equal
materials, without friction and with friction up to 0.4.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.results.quantities import declare

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

SINGULAR_POWER = declare(
    "singular_power", "power p of the stress at the corner, which goes as r^(p-1)"
)
SINGULAR_POWER_ERROR = declare("singular_power_error", "uncertainty of the singular power")
SINGULAR_INTENSITY = declare(
    "singular_intensity",
    "contact pressure / mean pressure of the singular term alone, one half-width from the corner",
)
APPARENT_POWER = declare(
    "apparent_power", "power that contact pressure seems to have, 0.01 to 0.1 from the corner"
)

_NEXT = 1.0
"""Exponent of the next term of the series above the first one."""
_OTHER_NEXT = (0.5, 1.5)
_FEWEST = 5
"""Points for three unknowns."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Singularity:
    """Stress ~ ``intensity * r^(power - 1)`` where r tends to 0, and the error of ``power``."""

    power: float
    error: float
    intensity: float


NOWHERE = Singularity(power=np.nan, error=np.nan, intensity=np.nan)


def fit_singularity(r: Array, stress: Array, low: float, high: float) -> Singularity:
    """Return the singular term of stress sampled near a corner.

    1. Points at ``low <= r <= high`` count. ``low`` is to be ten elements or more, as elements
       at the corner do not resolve the stress; ``high`` is to be small beside the distance of
       whatever else shapes the field: an edge, a groove, the end of a zone of slip.
    2. ``ln stress = ln C + (p - 1) ln r + b r^q`` with q = 1 is fitted by least squares, all points
       alike: points at even steps of ln r weigh all scales alike.
    3. The error is the largest change of p when q is 0.5 or 1.5, or when the inner or the outer
       third of the range, in ln r, is left out; or the standard error of the fit, where larger.

    Parameters
    ----------
    r : (n,) distances from the corner
    stress : (n,) of one sign; the unit is that of ``Singularity.intensity``
    low, high : range of r of the fit

    Returns
    -------
    Singularity : all NaN where the range holds fewer than five points, or stress of both signs
    """
    within = (r >= low) & (r <= high)
    r, stress = r[within], stress[within]
    if len(r) < _FEWEST or stress.min() <= 0.0 <= stress.max():
        return NOWHERE
    x, y = np.log(r), np.log(np.abs(stress))
    scale = np.log(high)
    best, deviation = _fit(x, y, _NEXT, scale)
    others = [_fit(x, y, exponent, scale)[0] for exponent in _OTHER_NEXT]
    third = (np.log(high) - np.log(low)) / 3
    for part in (x <= np.log(high) - third, x >= np.log(low) + third):
        if part.sum() >= _FEWEST:
            others.append(_fit(x[part], y[part], _NEXT, scale)[0])
    change = max(abs(other[1] - best[1]) for other in others)
    return Singularity(
        power=float(1 + best[1]),
        error=float(max(change, deviation)),
        intensity=float(np.exp(best[0]) * np.sign(stress[0])),
    )


def _fit(x: Array, y: Array, exponent: float, scale: float) -> tuple[Array, float]:
    """Return ln C, p - 1 and b of points (ln r, ln stress), and the standard error of p."""
    A = np.stack([np.ones_like(x), x, np.exp(exponent * (x - scale))], axis=1)
    found, *_ = np.linalg.lstsq(A, y)
    spread = ((A @ found - y) ** 2).sum() / max(len(x) - A.shape[1], 1)
    return found, float(np.sqrt(spread * np.linalg.inv(A.T @ A)[1, 1]))


def apparent_power(r: Array, stress: Array, low: float, high: float) -> float:
    """Return the power that a straight line through logarithms gives, without a next term.

    It is what one measures who sees the stress between ``low`` and ``high`` only. NaN where that
    range holds fewer than five points, or stress of both signs.
    """
    within = (r >= low) & (r <= high)
    r, stress = r[within], stress[within]
    if len(r) < _FEWEST or stress.min() <= 0.0 <= stress.max():
        return float("nan")
    return 1.0 + float(np.polyfit(np.log(r), np.log(np.abs(stress)), 1)[0])
