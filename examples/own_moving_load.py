"""Define a load that moves along a boundary, and follow the moment in a beam that it crosses."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Interval, Unit

from solver import Body, Material, Model, solve
from solver.loading.program import Stage
from solver.mesh import grid
from solver.model.amplitude import Amplitude
from solver.model.loads import LOADS, BoundaryLoad


@LOADS.word("trolley")
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trolley(BoundaryLoad):
    """A pressure like a bell around a place that moves, with a given force per depth."""

    force: Annotated[float, Interval(ge=0.0), Unit("N/mm")]
    width: Annotated[float, Interval(gt=0.0), Unit("mm")]
    position: Amplitude

    def push_at(self, time, x, along):
        """Return the forces (2, n) on pieces of the boundary at a time [N/mm]."""
        away = (x[0] - self.position.at(time)) / self.width
        bell = np.exp(-(away**2)) / (self.width * np.sqrt(np.pi))
        return self.factor(time) * self.force * bell * np.stack([-along[1], along[0]])


if __name__ == "__main__":
    height, section, stops = 5.0, 20.0, {"near": 40.0, "middle": 60.0, "far": 80.0}
    trolley = Trolley(
        boundary="top", force=2.0, width=2.0, amplitude=Amplitude([0, 1], [0, 1]),
        position=Amplitude([1, 2, 3], list(stops.values())),
    )  # fmt: skip
    beam = Body(
        name="beam", mesh=grid(np.linspace(0, 100, 81), np.linspace(0, height, 5)),
        material=Material(youngs_modulus=2e5, poisson_ratio=0.3), kinematics="plane_stress",
        supports={"left": "xy"}, loads=(trolley,),
    )  # fmt: skip
    stages = [Stage(name=name, target=k + 1.0) for k, name in enumerate(stops)]
    solution = solve(Model(bodies=(beam,)), stages=stages)
    x, y = solution.nodes("beam")
    at = np.isclose(x, section) & np.isclose(y, 0.0)
    for name, place in stops.items():
        bent = -6 * trolley.force * (place - section) / height**2  # M / W at the lower edge
        assert np.allclose(solution.stress("beam", name)[0, at], bent, rtol=2e-3)
        assert solution.audit(name).passed
        print(f"trolley at {place:g} mm: {bent:.2f} MPa at {section:g} mm")
