"""Wear and slip of the contact pairs of a run, between two of its stages."""

from __future__ import annotations

from dataclasses import MISSING, dataclass
from typing import Annotated, Any

import numpy as np
from annotated_types import Interval, Unit

from solver.errors import ModelError
from solver.fatigue.wear import archard_depth
from solver.parameters import Checked, described
from solver.results.acting import contact_result
from solver.results.outputs import output
from solver.results.quantities import declare
from solver.results.run import FinishedRun, Values

WEAR_DEPTH = declare("wear_depth", "largest depth worn by Archard's law between two stages", "mm")
SLIP_LENGTH = declare(
    "slip_length", "longest way that a point in contact slides between two stages", "mm"
)


@output("wear", "contact")
@dataclass(frozen=True, slots=True, kw_only=True)
class Wear(Checked):
    """Wear depth of the slave by Archard's law, and length of slip, between two stages.

    The way that a point slides is the sum over the increments. Pressure is the mean of the states
    at the ends of stages, between which it should change little or in proportion to slip.
    """

    since: str = described(MISSING, "stage from whose end on it counts")
    until: str = described(MISSING, "stage to whose end it counts")
    coefficient: Annotated[float, Interval(ge=0.0), Unit("1/MPa")] = described(
        1e-8, "worn volume over normal force and sliding distance: k / H of Archard's law"
    )

    def __call__(self, run: FinishedRun) -> Values:
        """Return the quantities of a run."""
        system: Any = run.system
        names, points = list(run.view.stages), run.outcome.points
        first, last = (names.index(each) for each in (self.since, self.until))
        if first >= last:
            raise ModelError("results.wear.until", self.until, f"must come after {self.since}")
        states = [points[name] for name in names[first : last + 1]]
        depth = length = 0.0
        for k in range(len(system.interfaces)):
            pressure = np.array([contact_result(system, each, k).pressure for each in states])
            slipped = np.array([each.state.contacts[k].slipped for each in states])
            depth = max(depth, archard_depth(pressure, slipped, self.coefficient).max())
            length = max(length, (slipped[-1] - slipped[0]).max())
        return {WEAR_DEPTH: float(depth), SLIP_LENGTH: float(length)}
