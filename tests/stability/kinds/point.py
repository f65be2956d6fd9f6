"""Bodies that touch at one point and are held sideways, and from turning, by that alone."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from solver import Body, ContactPair, Material, Model, PathControl, Solution, solve
from solver.mesh import grid, mapped
from tests.stability.closed import STEEL, contact_force, passed, reaction
from tests.stability.trial import Figure, Scene, brief

WIDTH = 4.0
SLOPE = 1 / 15
"""Of the cylinder at its ends."""
YIELDING = Material(
    youngs_modulus=2e5, poisson_ratio=0.3, yield_stress=300.0, hardening="isotropic",
    hardening_ratio=0.05,
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Tip:
    """A block, its lower side a cylinder or a wedge of a little slope, pressed on a plate.

    ``held`` holds its top sideways, which makes the problem an easy one.
    """

    round_: bool = True
    pressure: float = 20.0
    push: float = 0.0
    friction: float = 0.3
    state: str = "plane_strain"
    sliding: str = "small"
    material: Material = STEEL
    held: bool = False

    def solve(self) -> Solution:
        """Return the solution."""
        flat = grid(np.linspace(-WIDTH / 2, WIDTH / 2, 17), np.linspace(0, 3, 4))

        def shaped(p: np.ndarray) -> np.ndarray:
            depth = p[0] ** 2 / 60 if self.round_ else np.abs(p[0]) * 0.02
            return np.stack([p[0], p[1] + depth * (1 - p[1] / 3)])

        tip = Body(
            name="tip",
            mesh=mapped(flat, shaped),
            material=self.material,
            kinematics=self.state,
            supports={"top": "x"} if self.held else {},
            pressure={"top": self.pressure} | ({"left": self.push} if self.push else {}),
        )
        plate = Body(
            name="plate",
            mesh=grid(np.linspace(-6, 6, 25), np.linspace(-4, 0, 5)),
            material=self.material,
            kinematics=self.state,
            supports={"bottom": "xy"},
        )
        pair = ContactPair(
            slave=("tip", "bottom"),
            master=("plate", "top"),
            friction=self.friction,
            sliding=self.sliding,
        )
        control = PathControl(load_step=0.1, unload_steps=2)
        return solve(Model(bodies=(tip, plate), contacts=(pair,)), control=control)

    def judge(self, solution: Solution) -> dict[str, Figure]:
        """Return the figures: contact carries what is applied, whatever the pressure's form."""
        force = self.pressure * WIDTH
        left = solution.system.model.bodies[0].mesh
        ends = left.p[1, left.facets[:, left.boundaries["left"]]]
        pushed = self.push * float(np.ptp(ends))
        contact = solution.loaded.state.contacts[0]
        N, T = contact.normal, contact.tangential
        # normals lean by at most the slope of the lower side
        lean = float(np.abs(T).sum() / force) * SLOPE + (SLOPE**2 if self.round_ else 0.02**2)
        across = abs(abs(float(T.sum())) - pushed) / force
        return {
            "audit": passed(solution),
            "contact force": Figure(abs(contact_force(solution) - force) / force, 1e-7 + lean),
            "reaction": Figure(abs(reaction(solution, "plate", "bottom") - force) / force, 1e-6),
            "friction force": Figure(across, SLOPE if self.round_ else 0.02 + 1e-7),
            "cone": Figure(float((np.abs(T) - self.friction * N).max()) / force, 1e-7),
            "tension": Figure(-float(N.min()) / force, 0.0),
        }


def scenes() -> list[Scene]:
    """Return cylinders and wedges, some pushed sideways by less than friction holds."""
    tips = (
        Tip(),
        Tip(push=1.0, state="plane_stress"),
        Tip(sliding="finite", material=YIELDING, pressure=60.0),
        Tip(round_=False),
        Tip(round_=False, push=0.5, friction=0.6),
        Tip(round_=False, sliding="finite", friction=0.1),
    )
    return [Scene(what=brief(t), run=partial(t.solve), judge=t.judge) for t in tips]
