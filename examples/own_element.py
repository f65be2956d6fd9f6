"""Define an element for nearly incompressible bodies: eight nodes with averaged dilatation."""

from dataclasses import replace

import numpy as np
from skfem import ElementQuadS2

from solver import Body, Material, Model, solve
from solver.mesh import grid
from solver.mesh.elements import ElementType, add_element

add_element(
    "quad8_mean",
    ElementType(element=ElementQuadS2(), order=5, full_order=5, mean_dilatation=True),
)

if __name__ == "__main__":
    a, b, E, nu = 10.0, 20.0, 100.0, 0.4999
    tube = Body(
        name="tube", mesh=grid(np.linspace(a, b, 5), np.linspace(0, 5, 3)), element="quad8_mean",
        material=Material(youngs_modulus=E, poisson_ratio=nu), kinematics="axisymmetric",
        supports={"bottom": "y", "top": "y"}, pressure={"left": 1.0},
    )  # fmt: skip

    def error(body):
        """Return the solution, and the largest relative error of displacement (Lamé)."""
        solution = solve(Model(bodies=(body,)))
        r, u = solution.nodes("tube")[0], solution.displacement("tube", "loaded")[0]
        exact = (1 + nu) / E * a**2 / (b**2 - a**2) * ((1 - 2 * nu) * r + b**2 / r)
        return solution, np.abs(u / exact - 1).max()

    solution, own = error(tube)
    _, locked = error(replace(tube, element="quad8", full_integration=True))
    assert own < 1e-4 < 0.01 < locked, (own, locked)
    assert solution.audit().passed
    solution.to_vtu("tube")
    print(f"error of displacement: {own:.1e}, of quad8 with as many points {locked:.1e}")
