"""Hertz line contact: an elastic cylinder, held by contact alone, on an elastic half-plane.

The closed form is for half-planes; bodies of 100 a disturb it by (a / size)^2 = 1e-4, the floor of
what can be told here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from skfem import Mesh, MeshTri2

from solver import Body, ContactPair, Material, Model, Solution, solve
from solver.mesh import graded, grid, mapped
from tests.benchmarks.measure import Point, timed
from tests.verification.closed_forms import HertzLine, plane_strain_modulus

RADIUS, SIZE = 100.0, 100.0  # mm; a is 1
E, NU = 2.0e5, 0.3
MODULUS = plane_strain_modulus(E, NU) / 2
EXACT = HertzLine(force=np.pi * MODULUS / (4 * RADIUS), radius=RADIUS, modulus=MODULUS)
ELEMENTS = ("quad8", "quad9", "quad4", "tri6")
MEASURES = {
    "pressure": "contact pressure, mean square over 0 < x < a",
    "peak": "peak pressure",
    "half_width": "contact half-width",
}


def measure(elements: Sequence[str], meshes: Sequence[int], repeats: int) -> list[Point]:
    """Return a point for every element and every number of elements in the half-width."""
    points = []
    for element in elements:
        for n in meshes:
            run = timed(
                lambda repeat, n=n, e=element: _press(n, e, thickness=1.0 + repeat), repeats
            )
            points.append(
                Point(
                    problem="hertz",
                    series=element,
                    setting=f"a/{n}",
                    unknowns=2 * sum(run.result.nodes(b).shape[1] for b in ("cylinder", "plane")),
                    cpu=run.cpu,
                    spread=run.spread,
                    repeats=run.repeats,
                    **_errors(run.result),
                )
            )
    return points


def _press(n: int, element: str, thickness: float) -> Solution:
    """Press with ``n`` elements in the half-width; the growth of the others halves with theirs.

    Every repeat has a thickness of its own: it changes no stress, but equal elastic bodies would
    share their condensation, and the repeat would cost nothing.
    """
    h, growth = 1.0 / n, 1 + 1.8 / n
    fine = np.linspace(0.0, 1.5, round(1.5 * n) + 1)
    x = np.concatenate([fine, fine[-1] + graded(SIZE - fine[-1], h, growth, 10.0)[1:]])
    y = graded(SIZE, h, growth, 10.0)

    def bulge(p: np.ndarray) -> np.ndarray:
        profile = np.minimum(p[0] ** 2 / (2 * RADIUS), SIZE / 8)
        return np.stack([p[0], profile + p[1] * (SIZE - profile) / SIZE])

    cells = "tri" if element.startswith("tri") else "quad"
    given = {
        "material": Material(youngs_modulus=E, poisson_ratio=NU),
        "element": element,
        "thickness": thickness,
    }
    cylinder = Body(
        name="cylinder",
        mesh=_curved(grid(x, y, cells), bulge),
        supports={"left": "x"},
        pressure={"top": EXACT.force / 2 / SIZE},
        **given,
    )
    plane = Body(
        name="plane",
        mesh=grid(x, -y[::-1], cells),
        supports={"left": "x", "bottom": "y"},
        **given,
    )
    pair = ContactPair(slave=("cylinder", "bottom"), master=("plane", "top"))
    return solve(Model(bodies=(cylinder, plane), contacts=(pair,)))


def _curved(mesh: Mesh, function: Callable[[np.ndarray], np.ndarray]) -> Mesh:
    if mesh.t.shape[0] == 4:
        return mapped(mesh, function)
    curved = MeshTri2.from_mesh(mesh)
    moved = MeshTri2(doflocs=function(curved.doflocs), t=curved.t, sort_t=False, validate=False)
    return moved.with_boundaries(dict(mesh.boundaries))


def _errors(solution: Solution) -> dict[str, dict[str, float]]:
    position, pressure, _ = solution.contact()
    order = np.argsort(position[0])
    x, p = position[0, order], pressure[order]
    at = np.linspace(0.0, 1.0, 2001)
    miss = np.interp(at, x, p) - EXACT.pressure(at)
    # the square of Hertz's pressure is a line in x^2: its zero is the edge
    near = (p > 0.1 * p[0]) & (x > 0.3) & (x < 1.0)
    slope, offset = np.polyfit(x[near] ** 2, p[near] ** 2, 1)
    half_width = float(np.sqrt(-offset / slope))
    square = np.sqrt(np.mean(miss**2) / np.mean(EXACT.pressure(at) ** 2))
    return {
        "values": {"peak": float(p[0]), "half_width": half_width},
        "errors": {
            "pressure": float(square),
            "peak": abs(float(p[0]) / EXACT.peak_pressure - 1),
            "half_width": abs(half_width / EXACT.half_width - 1),
        },
    }
