"""Columns of blocks under uniform stress, whose answer is known, and figures of such answers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from solver import Body, ContactPair, Material, Model, PathControl, Solution, solve
from solver.mesh import grid
from tests.stability.trial import Figure

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from skfem import Mesh

    Array = NDArray[np.float64]

STEEL = Material(youngs_modulus=2e5, poisson_ratio=0.3)
QUICK = PathControl(load_step=0.5, unload_steps=2)
"""What answers that do not depend on the path are solved with."""


@dataclass(frozen=True, kw_only=True)
class Column:
    """Two blocks, one on the other, pressed together from above [N, mm, MPa].

    ``overlap`` is negative where there is a gap; ``clamped`` holds the top instead of leaving it
    to the pressure; ``perturb`` moves the interior nodes by that share of an element.
    """

    upper: Material = STEEL
    lower: Material = STEEL
    pressure: float = 100.0
    side: float = 0.0
    overlap: float = 0.0
    clamped: bool = False
    state: str = "plane_stress"
    element: str = "quad8"
    thickness: float = 1.0
    width: float = 5.0
    heights: tuple[float, float] = (4.0, 6.0)
    cells: tuple[tuple[int, int], tuple[int, int]] = ((3, 2), (4, 3))
    friction: float = 0.0
    sliding: str = "small"
    perturb: float = 0.0
    grading: float = 1.0
    seed: int = 0
    at: tuple[float, float] = (0.0, 0.0)

    def model(self) -> Model:
        """Return the blocks: ``upper`` on ``lower``, free to widen to the right."""
        return Model(bodies=(self._upper(), self._lower()), contacts=(self.pair,))

    @property
    def pair(self) -> ContactPair:
        """The only contact."""
        return ContactPair(
            slave=("upper", "bottom"),
            master=("lower", "top"),
            friction=self.friction,
            sliding=self.sliding,
        )

    @property
    def area(self) -> float:
        """Of the slave [mm2]."""
        round_ = self.state == "axisymmetric"
        return np.pi * self.width**2 if round_ else self.width * self.thickness

    def _upper(self) -> Body:
        load = {"top": self.pressure} if self.pressure and not self.clamped else {}
        return Body(
            name="upper",
            mesh=self._mesh(0, -self.overlap, self.heights[0]),
            material=self.upper,
            thickness=self.thickness,
            supports={"left": "x"} | ({"top": "y"} if self.clamped else {}),
            pressure=load | self._sideways,
            kinematics=self.state,
            element=self.element,
        )

    def _lower(self) -> Body:
        return Body(
            name="lower",
            mesh=self._mesh(1, -self.heights[1], 0.0),
            material=self.lower,
            thickness=self.thickness,
            supports={"left": "x", "bottom": "y"},
            pressure=self._sideways,
            kinematics=self.state,
            element=self.element,
        )

    @property
    def _sideways(self) -> dict[str, float]:
        return {"right": self.side} if self.side else {}

    def _mesh(self, body: int, low: float, high: float) -> Mesh:
        nx, ny = self.cells[body]
        share = np.linspace(0, 1, nx + 1)
        if self.grading != 1:  # sizes grow by the grading from the left to the right
            share = np.append(0.0, np.cumsum(self.grading ** np.linspace(0, 1, nx)))
            share /= share[-1]
        x, y = self.at[0] + self.width * share, self.at[1] + np.linspace(low, high, ny + 1)
        mesh = grid(x, y, "tri" if self.element.startswith("tri") else "quad")
        return crooked(mesh, self.perturb, self.cells[body], self.seed + body)

    def solve(self, load: float = 1.0, control: PathControl = QUICK) -> Solution:
        """Return the solution."""
        return solve(self.model(), load=load, control=control)


def crooked(mesh: Mesh, share: float, cells: tuple[int, int], seed: int) -> Mesh:
    """Return a grid, its nodes within moved by a share of its mean elements."""
    if not share:
        return mesh
    rng = np.random.default_rng(seed)
    p = mesh.p.copy()
    inside = np.setdiff1d(np.arange(p.shape[1]), mesh.boundary_nodes())
    size = np.ptp(p, axis=1)[:, None] / np.array(cells)[:, None]
    p[:, inside] += share * size * rng.uniform(-1, 1, (2, len(inside)))
    return replace(mesh, doflocs=p)


def uniaxial(column: Column, sigma: float) -> Array:
    """Return the uniform elastic Mandel stress (4,) of a column under ``sigma`` along y."""
    nu = column.upper.poisson_ratio
    out_of_plane = nu * (sigma - column.side) if column.state == "plane_strain" else 0.0
    return np.array([-column.side, sigma, out_of_plane, 0.0])


def passed(solution: Solution, declared: frozenset[str] = frozenset()) -> Figure:
    """Return the number of conditions of its own that a solution violates, but for those declared.

    Bodies strained beyond small strains may overlap where they are drawn deformed, and slip far in
    an increment. Contact on too few vertices is told by the audit; its forces are in balance all
    the same.
    """
    check = solution.audit()
    told = {"audit_contact_resolution", *declared}
    if any("small-strain" in text for text in check.outside):
        told |= {"audit_overlap", "audit_slip_resolution"}
    wrong = [text for text in check.violations if text.split()[0] not in told]
    return Figure(float(len(wrong)), 0.0)


def stress_miss(
    solution: Solution, body: str, expected: Array, stage: str = "loaded", scale: float = 0.0
) -> float:
    """Return how far stress is from a uniform one at any point, over its largest component."""
    stress = solution.system.state(body, getattr(solution, stage)).stress
    size = scale or float(np.abs(expected).max())
    return float(np.abs(stress - expected[:, None]).max()) / size


def contact_force(solution: Solution, pair: int = 0, stage: str = "loaded") -> float:
    """Return the sum of the normal contact forces of a pair [N]."""
    return float(getattr(solution, stage).state.contacts[pair].normal.sum())


def reaction(solution: Solution, body: str, boundary: str, stage: str = "loaded") -> float:
    """Return the upward force on a boundary that stress in the body balances [N]."""
    whole = solution.system.full(body)
    response = solution.system.state(body, getattr(solution, stage))
    force = whole.undeformed.internal_force(response.stress)
    return float(force[2 * whole.boundary_nodes(boundary) + 1].sum())


def judge_column(
    column: Column, sigma: float, solution: Solution, *, limit: float = 1e-7
) -> dict[str, Figure]:
    """Return the figures of an elastic column under ``sigma`` (negative) along y in ``upper``."""
    force = -sigma * column.area
    bodies, expected = ("upper", "lower"), uniaxial(column, sigma)
    miss = max(stress_miss(solution, b, expected) for b in bodies)
    left = max(stress_miss(solution, b, np.zeros(4), "unloaded", abs(sigma)) for b in bodies)
    return {
        "audit": passed(solution),
        "uniform stress": Figure(miss, limit),
        "contact force": Figure(abs(contact_force(solution) - force) / force, limit),
        "reaction": Figure(abs(reaction(solution, "lower", "bottom") - force) / force, limit),
        "left over stress": Figure(left, limit),
    }


def lowered(solution: Solution, body: str, boundary: str) -> float:
    """Return the mean downward displacement of a boundary under load [mm]."""
    nodes = solution.system.full(body).boundary_nodes(boundary)
    return -float(solution.displacement(body, "loaded")[1, nodes].mean())
