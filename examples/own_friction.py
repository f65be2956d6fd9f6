"""Define a friction law, tau_max (1 - exp(-mu p / tau_max)), by tangents of the curve.

With RESIDUA_PARTS=own_friction.py studies and scene files can use it: friction_law = "saturating".
"""

from dataclasses import dataclass

import numpy as np

from solver import Body, ContactPair, Material, Model, Moved, RigidBody, solve
from solver.mesh import grid
from solver.model.friction import FRICTION, FrictionLaw
from solver.model.rigid import line
from solver.parameters import Friction, Stress, described


@FRICTION.word("saturating")
@dataclass(frozen=True, slots=True, kw_only=True)
class Saturating(FrictionLaw):
    """Friction whose shear saturates under pressure."""

    friction: Friction = described(0.0, "Coulomb friction coefficient")
    tau_max: Stress = described(50.0, "limit of the shear under pressure")

    def bound(self, at):
        """Return lines (slope, stress [MPa]): tangents at u = mu p / tau_max, and the limit."""
        u = np.linspace(0.0, 6.0, 25)
        stress = self.tau_max * (1 - np.exp(-u) * (1 + u))
        return [*zip(self.friction * np.exp(-u), stress, strict=True), (0.0, self.tau_max)]


if __name__ == "__main__":  # a pad of 2 mm2, pressed on a plate that is dragged away under it
    steel = Material(youngs_modulus=2e5, poisson_ratio=0.3)
    mesh = grid(np.linspace(-1, 1, 9), np.array([0.0, 0.1]))
    pad = Body(name="pad", mesh=mesh, material=steel, supports={"top": "x"}, pressure={"top": 100})
    plate = RigidBody(name="plate", surfaces={"top": line((3, 0), (-3, 0))}, x=Moved(value=0.02))
    law = Saturating(friction=0.5, tau_max=40.0)
    pair = ContactPair(slave=("pad", "bottom"), master=("plate", "top"), friction=law)
    drag = solve(Model(bodies=(pad,), rigid=(plate,), contacts=(pair,))).reaction("plate", "loaded")
    assert np.isclose(drag[0], 2 * 40.0 * (1 - np.exp(-0.5 * 100.0 / 40.0)), rtol=0.01)
