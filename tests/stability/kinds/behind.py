"""Masters with edges behind the slave, or nearer than those in front: only what faces counts.

A block lies in, or floats in, the mouth of a frame open to the right, whose outline (but for
its back) is the master; or on a plate whose outline goes round below.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from solver import Body, ContactPair, Model, PathControl, Solution, solve
from solver.mesh import grid
from tests.stability.balance import tilt
from tests.stability.closed import STEEL, contact_force, passed, reaction
from tests.stability.trial import Figure, Scene, brief, tells

if TYPE_CHECKING:
    from skfem import Mesh

WIDTH = 2.0
PRESSURE = 50.0


@dataclass(frozen=True, kw_only=True)
class Mouth:
    """A frame and a block in it.

    ``below``, ``above`` are the gaps under and over the block, ``leg`` the height of the frame's
    legs; ``held`` holds the block's top; ``upper_leg`` False leaves a plate.
    """

    below: float = 0.0
    above: float = 0.3
    height: float = 1.0
    leg: float = 0.5
    pressure: float = PRESSURE
    held: bool = False
    upper_leg: bool = True
    friction: float = 0.0
    sliding: str = "small"
    slave: str = "bottom"
    master: str = "outline"

    def solve(self) -> Solution:
        """Return the solution."""
        pair = ContactPair(
            slave=("block", self.slave),
            master=("frame", self.master),
            friction=self.friction,
            sliding=self.sliding,
        )
        model = Model(bodies=(self._block(), self._frame()), contacts=(pair,))
        return solve(model, control=PathControl(load_step=0.5, unload_steps=2))

    def _block(self) -> Body:
        y = self.below + np.linspace(0, self.height, 3)
        return Body(
            name="block",
            mesh=grid(1.0 + np.linspace(0, WIDTH, 5), y),
            material=STEEL,
            supports={"top": "xy"} if self.held else {"left": "x"},
            pressure={"right" if self.held else "top": self.pressure},
        )

    def _frame(self) -> Body:
        return Body(name="frame", mesh=self._mesh(), material=STEEL, supports={"back": "xy"})

    def _mesh(self) -> Mesh:
        """Return the frame: its back at x = 0, the floor of its mouth at y = 0."""
        ceiling = self.below + self.height + self.above
        x = np.array([0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0])
        y = np.array([-self.leg, 0.0, ceiling / 2, ceiling, ceiling + self.leg])
        whole = grid(x, y if self.upper_leg else y[:2])
        middle = whole.p[:, whole.t].mean(axis=1)
        mouth = (middle[0] > 0.5) & (middle[1] > 0) & (middle[1] < ceiling)
        mesh = whole.restrict(np.flatnonzero(~mouth))
        outer = mesh.boundary_facets()
        at = mesh.p[:, mesh.facets[:, outer]].mean(axis=1)
        back = at[0] < 1e-9
        mesh = mesh.with_boundaries({"back": outer[back], "outline": outer[~back]})
        return mesh.with_boundaries(
            {
                "ceiling": lambda m: (np.abs(m[1] - ceiling) < 1e-9) & (m[0] > 0.5),
                "roof": lambda m: np.abs(m[1] - ceiling - self.leg) < 1e-9,
            }
        )


def _judge(scene: Mouth, force: float, solution: Solution) -> dict[str, Figure]:
    """Return the figures of a block that presses on the frame with ``force``, which may be 0."""
    scale = scene.pressure * WIDTH
    across, _ = tilt(solution)
    return {
        "audit": passed(solution),
        "contact force": Figure(abs(contact_force(solution) - force) / scale, 1e-7 + across),
        "reaction": Figure(abs(reaction(solution, "frame", "back") - force) / scale, 1e-6),
    }


def _pressed(scene: Mouth) -> Scene:
    judge = partial(_judge, scene, scene.pressure * WIDTH)
    return Scene(what=brief(scene), run=scene.solve, judge=judge)


def _free(scene: Mouth) -> Scene:
    """A held block that touches nothing; where nothing faces it, that may also be said."""
    nothing = scene.slave == "top" or scene.master != "outline"
    refusal = tells("fac|opposite|toward|behind", "block|frame|slave|master")
    return Scene(
        what=brief(scene),
        run=scene.solve,
        judge=partial(_judge, scene, 0.0),
        refusal=refusal if nothing else None,
    )


def scenes() -> list[Scene]:
    """Return blocks pressed on the floor, and blocks that touch nothing."""
    return [
        _pressed(Mouth()),
        _pressed(Mouth(friction=0.3, sliding="finite", above=0.02)),
        # the ceiling, behind the block's bottom, is nearer than the floor
        _pressed(Mouth(below=0.2, above=0.02, height=0.1, pressure=5.0)),
        _pressed(Mouth(upper_leg=False, leg=0.2, pressure=0.5)),
        # the plate's underside is nearer than the gap above it is wide
        _pressed(Mouth(upper_leg=False, leg=0.1, below=0.15, friction=0.2, pressure=0.05)),
        _free(Mouth(held=True, below=0.6, above=0.05, height=0.3)),
        # all of the master is behind the block's bottom
        _free(Mouth(held=True, below=0.3, above=0.1, master="ceiling")),
        # both face up
        _free(Mouth(held=True, below=0.3, above=0.1, slave="top", master="roof")),
    ]
