"""Define a load, the pressure of a fluid at rest, and compare it with a wall's closed form."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Interval, Unit

from solver import Body, Material, Model, solve
from solver.mesh import grid
from solver.model.loads import LOADS, BoundaryLoad


@LOADS.word("hydrostatic")
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Hydrostatic(BoundaryLoad):
    """The pressure of a fluid at rest below its level: its weight times the depth."""

    weight: Annotated[float, Interval(ge=0.0), Unit("N/mm3")] = 9.81e-6
    level: float

    def push(self, x, along):
        """Return the forces (2, n) on pieces of the boundary [N/mm]."""
        pressure = self.weight * np.maximum(self.level - x[1], 0.0)
        return pressure * np.stack([-along[1], along[0]])


if __name__ == "__main__":
    height, water = 50.0, Hydrostatic(boundary="right", level=50.0)
    wall = Body(
        name="wall", mesh=grid(np.linspace(0, 5, 3), np.linspace(0, height, 21)),
        material=Material(youngs_modulus=3e4, poisson_ratio=0.2), kinematics="plane_stress",
        supports={"left": "x", "bottom": "y"}, loads=(water,),
    )  # fmt: skip
    solution = solve(Model(bodies=(wall,)))
    y, stress = solution.nodes("wall")[1], solution.stress("wall", "loaded")
    above = y > 20.0  # the flat ground changes the stress of its foot
    pressure = water.weight * (height - y)
    assert np.allclose(stress[0, above], -pressure[above], atol=1e-3 * pressure.max())
    assert solution.audit().passed
    print(f"pressure on the foot: {pressure.max():.2e} MPa")
