"""Define a load, centrifugal force, and compare it with the closed form of a rotating cylinder."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Interval, Unit

from solver import Body, Material, Model, solve
from solver.mesh import grid
from solver.model.loads import LOADS, Load


@LOADS.word("centrifugal")
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Centrifugal(Load):
    """The centrifugal force of a body that rotates about the axis x = 0."""

    density: Annotated[float, Interval(gt=0.0), Unit("t/mm3")] = 7.85e-9
    speed: Annotated[float, Interval(ge=0.0), Unit("rad/s")]

    def body_force(self, x):
        """Return the force per volume (2, n) at positions x [N/mm3]."""
        return np.stack([self.density * self.speed**2 * x[0], np.zeros(x.shape[1])])


if __name__ == "__main__":
    nu, radius, turning = 0.3, 100.0, Centrifugal(speed=3000.0)
    shaft = Body(
        name="shaft", mesh=grid(np.linspace(0, radius, 41), np.linspace(0, 5, 3)),
        material=Material(youngs_modulus=2e5, poisson_ratio=nu), kinematics="axisymmetric",
        supports={"bottom": "y", "top": "y"}, loads=(turning,),
    )  # fmt: skip
    solution = solve(Model(bodies=(shaft,)))
    r, stress = solution.nodes("shaft")[0], solution.stress("shaft", "loaded")
    level = (3 - 2 * nu) / (8 * (1 - nu)) * turning.density * turning.speed**2  # plane strain
    assert np.allclose(stress[0], level * (radius**2 - r**2), atol=1e-3 * level * radius**2)
    assert solution.audit().passed
    print(f"stress on the axis: {stress[0, r == 0].mean():.1f} MPa")
