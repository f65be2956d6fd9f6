"""Wear, slip and fretting of the contact pairs of a run, between two of its stages."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import MISSING, dataclass
from typing import Annotated, Any

import numpy as np
from annotated_types import Interval, Unit

from solver.errors import ModelError
from solver.parameters import Checked, described
from solver.results.outputs import output
from solver.results.quantities import declare
from solver.results.run import FinishedRun, Values
from solver.typing import Array

WEAR_DEPTH = declare("wear_depth", "largest depth worn by Archard's law between two stages", "mm")
SLIP_LENGTH = declare(
    "slip_length", "longest way that a point in contact slides between two stages", "mm"
)
SLIP_WORK = declare(
    "slip_work", "largest work of friction per area of the slave between two stages", "N/mm"
)
SLIP_SHARE = declare("slip_share", "share of the area in contact that slides between two stages")
FRETTING = declare(
    "fretting_parameter", "largest tension along the slave times its work of friction, by Ruiz",
    "MPa^2 mm",
)  # fmt: skip
_SLIPS = 1e-6
"""Way over the longest one, or over the largest change of displacement, above which a point slides:
where all stick, ways are rounding errors."""


@output("wear", "contact")
@dataclass(frozen=True, slots=True, kw_only=True)
class Wear(Checked):
    """Wear of the slave by Archard's law, length of slip, and fretting between two stages.

    All are sums over the increments. A point is in contact if it is so at the end of a stage.
    Without friction slip is not known: all are NaN. A rigid slave has no tension.
    """

    since: str = described(MISSING, "stage from whose end on it counts")
    until: str = described(MISSING, "stage to whose end it counts")
    coefficient: Annotated[float, Interval(ge=0.0), Unit("1/MPa")] = described(
        1e-8, "worn volume over normal force and sliding distance: k / H of Archard's law"
    )

    def __call__(self, run: FinishedRun) -> Values:
        """Return the quantities of a run.

        References
        ----------
        J.F. Archard, J. Appl. Phys. 24 (1953) 981-988; C. Ruiz, P.H.B. Boddington, K.C. Chen, Exp.
        Mech. 24 (1984) 208-217.
        """
        system: Any = run.system
        names, points = list(run.view.stages), run.outcome.points
        first, last = (names.index(each) for each in (self.since, self.until))
        if first >= last:
            raise ModelError("results.wear.until", self.until, f"must come after {self.since}")
        states = [points[name] for name in names[first : last + 1]]
        if not any(interface.rough for interface in system.interfaces):
            numbers = WEAR_DEPTH, SLIP_LENGTH, SLIP_WORK, SLIP_SHARE, FRETTING
            return dict.fromkeys(numbers, np.nan)
        each = [_of_pair(run, k, states) for k in range(len(system.interfaces))]
        values = map(np.concatenate, zip(*each, strict=True))
        way, pressed, work, area, closed, tension, moved = values
        touching = float(area[closed].sum())
        slides = closed & (way > _SLIPS * max(way.max(), moved.max()))
        known = (tension * work)[np.isfinite(tension)]
        return {
            WEAR_DEPTH: float(self.coefficient * pressed.max()),
            SLIP_LENGTH: float(way.max()),
            SLIP_WORK: float(work.max()),
            SLIP_SHARE: float(area[slides].sum()) / touching if touching else np.nan,
            FRETTING: float(known.max()) if known.size else np.nan,
        }


def _of_pair(run: FinishedRun, pair: int, states: Sequence[Any]) -> tuple[Array, ...]:
    """Return of the vertices of a slave, each (n,), what lies between the states.

    It is the way [mm], pressure and friction over it [N/mm], area [mm2], whether they are in
    contact, the largest tension along the surface [MPa], NaN of a rigid body, and the change of
    displacement [mm].
    """
    system: Any = run.system
    interface, contacts = system.interfaces[pair], [at.state.contacts[pair] for at in states]
    chain, (body, boundary) = interface.slave_surface, interface.declared.slave
    number, whole = interface.slave, system.chain(body, boundary)  # the part may be condensed
    way, *forces = contacts[-1].slipped - contacts[0].slipped
    nodes, (x, y) = whole.nodes[whole.vertices], whole.normals[:, whole.vertices]
    first, *_, last = (interface.parts[0].motion(chain, at.state.u[number]) for at in states)
    tension = np.full((1, len(way)), np.nan)
    if body in system.names:
        stresses = [run.samples.fields.at_nodes(at, body).stress[:, nodes] for at in states]
        tension = np.stack([
            y**2 * xx + x**2 * yy - 2 * x * y * xy for xx, yy, _, xy, *_ in stresses
        ])  # fmt: skip
    return (
        way,
        *(np.divide(each, chain.hats, out=each, where=chain.hats > 0) for each in forces),
        chain.hats,
        np.any([contact.normal > 0 for contact in contacts], axis=0),
        np.max(tension, axis=0, initial=0.0),
        np.hypot(*(last - first))[chain.vertices],
    )
