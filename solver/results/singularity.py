"""Singular points: the power of stress near one of them, and the sharp corner of a contact.

Near a corner stress is a series of powers of the distance r from it. The first term is unbounded:
stress ~ r^(p-1) with the power p below 1. A straight line through logarithms of values at finite
distances has another slope, because the next term of the series is not small. The fit includes this
term, whose exponent is about 1 larger: between 0.8 and 1.1 at the square corner of equal materials,
without friction and with friction up to 0.4.
"""

from __future__ import annotations

from dataclasses import MISSING, dataclass

import numpy as np

from solver.model.friction import coefficient
from solver.parameters import Checked, Friction, Length, Stress, described
from solver.results.acting import ContactResult
from solver.results.outputs import output
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


_NEAREST, _FARTHEST = 10.0, 0.03
"""Range of the fit: lower end in elements at the corner, upper end in half-widths."""
_GRADED = 0.9
"""Upper end of the fit over the distance within which elements grow, at most."""
_SHARE = 0.25
"""Upper end of the fit over the distance of another feature or end of slip, at most."""
_NOTCH, _NOTCH_SHEAR = 0.364, 0.543
"""Difference of the first two powers, and outward shear over pressure in the first term, of a
corner that sticks: a notch of 270 degrees (Williams). The second term may have any signs."""
_SEEN = (0.01, 0.1)
"""Range of the apparent power, in half-widths."""


@output("corner", "contact")
@dataclass(frozen=True, slots=True, kw_only=True)
class Corner(Checked):
    """The power of the singularity with its error, its intensity, and the apparent power.

    Contact pressure is fitted from a distance of ten elements from the corner up to the least of

    - 0.03 half-widths
    - 0.9 of the distance within which element sides grow in proportion to it: their error is then a
      constant share of the pressure, and does not change its power
    - a quarter of the distance to another feature or to the end of slip

    The result is NaN if the corner has lifted off, or if it sticks and the first term of the notch
    is not the largest in this range. Stress in the half-plane is less suitable: it may contain a
    uniform stress along its surface, a term whose power is only 1 - p above the first.
    """

    half_width: Length = described(MISSING, "distance of the corner from the middle of the contact")
    mean_pressure: Stress = described(MISSING, "mean pressure on the contact")
    smallest_element: Length = described(MISSING, "element side at the corner")
    graded: Length = described(
        MISSING, "distance from the corner within which element sides grow in proportion to it"
    )
    feature: Length = described(
        1e6, "distance from the corner to another feature that changes the stress, such as a groove"
    )
    flush: bool = described(
        False, "whether a straight side continues beyond the corner: if it sticks it is no notch"
    )

    def __call__(self, run: FinishedRun) -> Values:
        """Return the quantities of a run."""
        points = run.acting(run.loaded).points
        assert points is not None, "the model has a contact pair"
        r = 1 - points.s / self.half_width
        pressure = points.pressure / self.mean_pressure
        found, apparent = NOWHERE, np.nan
        if points.closed[-1]:
            low = _NEAREST * self.smallest_element / self.half_width
            graded = _GRADED * self.graded / self.half_width
            high = min(_FARTHEST, graded, _SHARE * self._next_feature(points, r))
            notch = bool(points.sticking[-1]) and not self.flush
            if not notch or _first_term_leads(points, r, low):
                found = fit_singularity(r, pressure, low, high, _NOTCH if notch else 1.0)
            apparent = apparent_power(r, pressure, *_SEEN)
        return {
            SINGULAR_POWER: found.power,
            SINGULAR_POWER_ERROR: found.error,
            SINGULAR_INTENSITY: found.intensity,
            APPARENT_POWER: apparent,
        }

    def warnings(self, run: FinishedRun) -> tuple[str, ...]:
        """Return a warning if the corner has lifted off."""
        width = run.acting(run.loaded).half_width
        if width >= self.half_width * (1 - 1e-9):
            return ()
        return (
            f"the corner has lifted off: contact ends at {width:.4g} mm, without a singularity",
        )

    def _next_feature(self, points: ContactResult, r: np.ndarray) -> float:
        """Return the distance from the corner to another feature or end of slip, in half-widths."""
        other = points.sticking != points.sticking[-1]
        return float(min([1.0, self.feature / self.half_width, *r[other]]))


def _first_term_leads(points: ContactResult, r: np.ndarray, low: float) -> bool:
    """Whether shear at the start of the fit exceeds half that of the first term of a notch."""
    near = int(np.argmin(np.abs(r - low)))
    return bool(points.shear[near] > _NOTCH_SHEAR / 2 * points.pressure[near])


PRESSURE_ERROR = declare(
    "pressure_error",
    "relative error of contact pressure without friction against the closed form, in the mean "
    "square over nine tenths of the contact",
)
_AWAY = 0.9
"""End of the range of the error, in half-widths; the pressure is infinite at 1."""


@output("pressure_error", "contact")
@dataclass(frozen=True, slots=True, kw_only=True)
class PressureError(Checked):
    """The error against p(x) / p0 = 2 / (pi sqrt(1 - (x/a)^2)), with p0 the mean pressure.

    It is NaN with friction: there is no closed form.

    References
    ----------
    K.L. Johnson, Contact Mechanics (1985), section 2.8.
    """

    half_width: Length = described(MISSING, "half-width a of the punch")
    mean_pressure: Stress = described(MISSING, "mean pressure p0 under the punch")
    friction: Friction = coefficient(0.0)

    def __call__(self, run: FinishedRun) -> Values:
        """Return the error of a run."""
        points = run.acting(run.loaded).points
        assert points is not None, "the model has a contact pair"
        x = points.s / self.half_width
        exact = 2 / (np.pi * np.sqrt(1 - np.minimum(x, _AWAY) ** 2))
        miss = points.pressure / self.mean_pressure - exact
        at = x <= _AWAY
        square = [np.trapezoid(each[at] ** 2, x[at]) for each in (miss, exact)]
        error = float(np.sqrt(square[0] / square[1]))
        return {PRESSURE_ERROR: np.nan if self.friction else error}
