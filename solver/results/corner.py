"""The sharp corner at the end of a contact: power of the singularity, and error of pressure."""

from __future__ import annotations

from dataclasses import MISSING, dataclass

import numpy as np

from solver.model.friction import coefficient
from solver.parameters import Checked, Friction, Length, Stress, described
from solver.results.contact_result import ContactResult
from solver.results.outputs import output
from solver.results.quantities import declare
from solver.results.run import FinishedRun, Values
from solver.results.singularity import (
    APPARENT_POWER,
    NOWHERE,
    SINGULAR_INTENSITY,
    SINGULAR_POWER,
    SINGULAR_POWER_ERROR,
    apparent_power,
    fit_singularity,
)

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
