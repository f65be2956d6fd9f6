"""Error of contact pressure under a rigid flat punch, from the closed form.

K.L. Johnson, Contact Mechanics (1985), section 2.8.
"""

from __future__ import annotations

from dataclasses import MISSING, dataclass

import numpy as np

from solver.parameters import Checked, Friction, Length, Stress, described
from solver.results.outputs import output
from solver.results.quantities import declare
from solver.results.run import FinishedRun, Values

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
    """

    half_width: Length = described(MISSING, "half-width a of the punch")
    mean_pressure: Stress = described(MISSING, "mean pressure p0 under the punch")
    friction: Friction = described(0.0, "Coulomb friction coefficient")

    def __call__(self, run: FinishedRun) -> Values:
        """Return the error of a run."""
        points = run.tractions.points(run.loaded)
        assert points is not None, "the model has a contact pair"
        x = points.s / self.half_width
        exact = 2 / (np.pi * np.sqrt(1 - np.minimum(x, _AWAY) ** 2))
        miss = points.pressure / self.mean_pressure - exact
        at = x <= _AWAY
        square = [np.trapezoid(each[at] ** 2, x[at]) for each in (miss, exact)]
        error = float(np.sqrt(square[0] / square[1]))
        return {PRESSURE_ERROR: np.nan if self.friction else error}
