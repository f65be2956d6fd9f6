"""Wear and fretting of the contact pairs of a run, in the cycle that it repeats."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from annotated_types import Interval, MinLen, Unit

from solver.fatigue.wear import archard_depth, slip_work
from solver.parameters import Checked, described
from solver.results.acting import contact_result
from solver.results.outputs import output
from solver.results.quantities import declare
from solver.results.run import FinishedRun, Values

WEAR_DEPTH = declare("wear_depth", "largest depth worn in a cycle by Archard's law", "mm")
SLIP_WORK = declare("slip_work", "frictional work of a cycle in all contact pairs", "N mm")
SLIP_AMPLITUDE = declare(
    "slip_amplitude", "half the largest range of slip in a cycle, where the bodies stay in touch",
    "mm",
)  # fmt: skip


@output("wear", "contact")
@dataclass(frozen=True, slots=True, kw_only=True)
class Wear(Checked):
    """Wear depth by Archard's law, frictional work and slip amplitude of a cycle of stages.

    The cycle is closed from its last stage to the first. Between two stages slip must go one way.
    """

    coefficient: Annotated[float, Interval(ge=0.0), Unit("1/MPa")] = described(
        1e-8, "worn volume over normal force and sliding distance: k / H of Archard's law"
    )
    cycle: Annotated[tuple[str, ...], MinLen(2)] = described(
        (), "stages of the cycle, two or more; by default all"
    )

    def __call__(self, run: FinishedRun) -> Values:
        """Return the quantities of a run."""
        system: Any = run.system
        names = self.cycle or run.view.stages
        depth = work = amplitude = 0.0
        for k in range(len(system.interfaces)):
            each = [
                contact_result(system, run.outcome.points[name], k) for name in (*names, names[0])
            ]
            pressure, shear, slip, closed = (
                np.nan_to_num([getattr(own, name) for own in each])
                for name in ("pressure", "shear", "slip", "closed")
            )
            depth = max(depth, archard_depth(pressure, slip, self.coefficient).max())
            work += float(slip_work(shear, slip) @ each[0].area)
            amplitude = max(amplitude, (np.ptp(slip, axis=0) * closed.all(axis=0)).max() / 2)
        return {WEAR_DEPTH: float(depth), SLIP_WORK: work, SLIP_AMPLITUDE: float(amplitude)}
