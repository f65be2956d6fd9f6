"""Interface between bodies and increments: unknowns, forces, motion of surfaces."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property

import numpy as np
import scipy  # loads scipy.spatial at its first use: few models need it
from scipy import sparse

from solver.fem.deformation import PartResponse
from solver.fem.dofs import Dofs, vectors
from solver.fem.loads import Superposed
from solver.fem.operators import PartOperators
from solver.fem.softening import Softening
from solver.fem.surface import Surface
from solver.linear.schur import Eliminated
from solver.materials.law import Law
from solver.materials.state import PlasticState, Response
from solver.model.body import Body
from solver.model.rigid import RigidBody
from solver.typing import Array, Ints

_ROUNDING = float(np.finfo(float).eps)
_SAME = 1e-6
"""Distance of two places over the size of the body: they are the same below this ratio."""


def same_unknowns(nodes: Array, places: Array) -> Ints:
    """Return the unknowns (dim n,) of nodes (dim, m) at places (dim, n), -1 if no node is there."""
    near = _SAME * float(np.ptp(nodes, axis=1).max())
    _, at = scipy.spatial.cKDTree(nodes.T).query(places.T, distance_upper_bound=near)
    found = np.repeat(at < nodes.shape[1], len(nodes))
    return np.asarray(np.where(found, Dofs(at, len(nodes)).every, -1), dtype=np.int64)


class Part(ABC):
    """A body as the increments use it; the methods here are those of a meshed body at rest.

    Attributes
    ----------
    n : number of unknowns ``u``
    nodes : (2, n_nodes) positions of the nodes that the unknowns belong to, node by node [mm]
    body : as declared
    loads : nodal forces (n,) of the body's loads [N]
    driven : prescribed motions (n,) [mm]
    free : unknowns that no support holds
    active : free unknowns without the pins that hold its rigid motions
    rigid : (n, n_rigid) rigid motions that the supports leave free
    moves : whether its load moves along a body
    meshed : whether all nodes of its mesh have unknowns
    """

    n: int
    nodes: Array
    body: Body | RigidBody
    loads: Superposed
    driven: Superposed
    free: Ints
    active: Ints
    rigid: Array
    moves: bool = False
    meshed: bool = True

    # -- each kind of part has its own ---------------------------------------------------------

    @abstractmethod
    def operators(self, surfaces: list[Surface], linear_solver: str) -> PartOperators:
        """Return the inverse stiffnesses of this part, for its contact surfaces."""

    @abstractmethod
    def virgin(self) -> PlasticState:
        """Return the internal variables before any load."""

    @abstractmethod
    def respond(self, u: Array, state: PlasticState, time: float) -> PartResponse:
        """Return stress, tangent and new internal variables at all points."""

    @abstractmethod
    def residual(self, time: float, u: Array, response: PartResponse) -> Array:
        """Return external minus internal forces (n,), without contact forces [N]."""

    @abstractmethod
    def elastic_matrix(self) -> sparse.csr_array:
        """Return the elastic stiffness on all unknowns (n, n), supports not applied."""

    @abstractmethod
    def stiffness_along(self, step: Array, response: PartResponse) -> tuple[float, float]:
        """Return ``step' K step`` with the tangent and with the elastic stiffness [N mm]."""

    @abstractmethod
    def plastic_work(
        self, before: PlasticState, response: Response, time: float
    ) -> tuple[float, float]:
        """Return the plastic work [N mm] and the least dissipation at a point [N mm/mm3]."""

    # -- for a meshed body at rest -------------------------------------------------------------

    def surface(self, surface: Surface) -> Surface:
        """Return a surface of the whole body in this part's numbering."""
        return surface

    def during(self, time: float, u: Array) -> Part:
        """Return the part for an increment from a time and unknowns u, which may be locked."""
        del time, u
        return self

    def expand(self, u: Array, time: float) -> Array:
        """Return the whole body's displacements [mm]; those of a wheel in its hub's frame."""
        del time
        return u

    def on_whole(self, force: Array) -> Array:
        """Return the nodal forces of the whole body for those of this part [N]."""
        return force

    def begin(self, force: Array) -> Eliminated:
        """Return nodal forces of the whole body on the unknowns of this part.

        ``finish`` returns the displacements of the whole body for those of this part.
        """
        return Eliminated(force, lambda u: u)

    @property
    def volumes(self) -> Array:
        """Volume of the points (n_points,) [mm3]; a part without points has none."""
        return np.zeros(0)

    def start(self) -> Array:
        """Return the unknowns (n,) before any load."""
        return np.zeros(self.n)

    def external(self, time: float) -> Array:
        """Return the external nodal forces (n,) at a time [N]."""
        return self.loads.at(time)

    def force_level(self, time: float) -> float:
        """Return the norm of the forces that load the part at a time [N]."""
        return float(np.linalg.norm(self.external(time)))

    def clamped(self, time: float) -> tuple[float, float]:
        """Return force [N] and energy [N mm] of heat, initial stress and motion, as if clamped."""
        del time
        return 0.0, 0.0

    def law(self, time: float) -> Law:
        """Return the material law of its points at a time; temperature may change it."""
        del time
        return self.body.law

    def hot(self, surface: Surface) -> Softening | None:
        """Return the softening at a surface's nodes; None if the yield stress is constant."""
        del surface
        return None

    def eigenstrain(self, time: float) -> Array:
        """Return the eigenstrain (4, n_points, Mandel) of heat or initial stress."""
        del time
        return np.zeros((4, len(self.volumes)))

    @property
    def travels(self) -> bool:
        """Whether it may move as a whole: contact alone holds it, or a motion is prescribed."""
        return self.rigid.shape[1] > 0

    def grows(self, before: float, after: float) -> bool:
        """Whether the external load grows from one time to another."""
        return self.loads.grows(before, after)

    @cached_property
    def diagonal(self) -> Array:
        """The diagonal (n,) of the elastic stiffness [N/mm]."""
        return np.asarray(self.elastic_matrix().diagonal())

    def rounding(self, u: Array) -> float:
        """Return the out-of-balance force that rounding can cause at displacements u [N].

        Internal forces are differences of stiffness times displacement, which may be large although
        the forces are small: in long thin elements, and in a stiff body on a soft one.
        """
        return _ROUNDING * float(np.linalg.norm(self.diagonal * u))

    def moved(self, u: Array, time: float) -> Array:
        """Return the unknowns with prescribed motions at their values at a time."""
        del time
        return u

    def way(self, before: float, after: float) -> float:
        """Return the motion of a wheel along x between two times [mm]."""
        del before, after
        return 0.0

    def turn(self, before: float, after: float) -> float:
        """Return the prescribed rotation between two times [rad]; 0 if none is prescribed."""
        del before, after
        return 0.0

    def passed(self, before: Array, after: Array, way: float) -> float:
        """Return the motion over this part's material of a load that moves by ``way`` [mm].

        ``before`` and ``after`` are the unknowns (n,) of the part.
        """
        del before, after
        return way

    def sources(self, way: float) -> Ints:
        """Return for each unknown (n,) the one at ``way`` [mm] behind it along x, or -1."""
        return same_unknowns(self.nodes, self.nodes - np.array([[way], [0.0]]))

    def place(self, point: int) -> tuple[float, ...]:
        """Return the position of a point [mm]; NaN without points."""
        del point
        return np.nan, np.nan

    def motion(self, surface: Surface, u: Array) -> Array:
        """Return the displacements (2, n_nodes) of a surface's nodes [mm]."""
        return vectors(u[surface.dofs], len(surface.X))

    def pull_back(self, surface: Surface, u: Array, block: Array, gaps: int) -> tuple[Ints, Array]:
        """Return unknowns (m,) of this part and derivative rows (n_rows, m) on these.

        ``block`` (n_rows, 2 n_nodes) has the derivatives by the displacements of a surface; its
        first ``gaps`` rows are gaps, the others slips.
        """
        del u, gaps
        return surface.dofs, block
