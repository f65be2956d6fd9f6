"""Interface between bodies and increments: unknowns, forces, motion of surfaces."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property
from typing import Self

import numpy as np
import scipy  # loads scipy.spatial at its first use: few models need it
from scipy import sparse

from solver.fem.deformation import Deformation, PartResponse
from solver.fem.loads import Superposed
from solver.fem.nodes import Dofs, vectors
from solver.fem.surface import Surface
from solver.materials.state import PlasticState
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
    """A body as the increments use it; the defaults are those of a body without points and loads.

    Attributes
    ----------
    n : number of unknowns ``u``
    nodes : (2, n_nodes) positions of the nodes that the unknowns belong to, node by node [mm]
    body : as declared
    free : unknowns that no support holds
    active : free unknowns without the pins that hold its rigid motions
    rigid : (n, n_rigid) rigid motions that the supports leave free
    """

    n: int
    nodes: Array
    body: Body | RigidBody
    free: Ints
    active: Ints
    rigid: Array

    @abstractmethod
    def elastic_matrix(self) -> sparse.csr_array:
        """Return the elastic stiffness on all unknowns (n, n), supports not applied."""

    @cached_property
    def loads(self) -> Superposed:
        """Nodal forces (n,) of the body's loads [N]."""
        return Superposed.of(self.n, ())

    @cached_property
    def driven(self) -> Superposed:
        """Prescribed motions (n,) [mm]."""
        return Superposed.of(self.n, ())

    def virgin(self) -> PlasticState:
        """Return the internal variables before any load."""
        return self.body.law.initial(len(self.volumes), 2 * len(self.nodes))

    def respond(self, u: Array, state: PlasticState, time: float) -> PartResponse:
        """Return stress, tangent and new internal variables at all points."""
        strain = np.zeros_like(state.plastic_strain)
        B, dofs = np.zeros((0, 0, len(strain), 0)), np.zeros((0, 0), dtype=np.int64)
        at = Deformation(n=self.n, dofs=dofs, strain=strain, B=B, weights=np.zeros((0, 0)))
        return PartResponse(self.body.law.respond(strain, state), at)

    def residual(self, time: float, u: Array, response: PartResponse) -> Array:
        """Return external minus internal forces (n,), without contact forces [N]."""
        return self.external(time) - self.elastic_matrix() @ u

    def stiffness_along(self, step: Array, response: PartResponse) -> tuple[float, float]:
        """Return ``step' K step`` with the tangent and with the elastic stiffness [N mm]."""
        energy = self.elastic_along(step)
        return energy, energy

    def elastic_along(self, step: Array) -> float:
        """Return ``step' K step`` with the elastic stiffness [N mm]."""
        return float(step @ (self.elastic_matrix() @ step))

    def during(self, time: float, u: Array) -> Self:
        """Return the part for an increment from a time and unknowns u (n,)."""
        return self

    def turned(self, u: Array) -> Self:
        """Return the part with its rigid motions at unknowns u (n,)."""
        return self

    def turned_forces(self, time: float, residual: Array) -> Array | None:
        """Return the stiffness times the rigid motions (n, n_rigid) [N/mm], or None.

        None where it is zero, or left out: for bodies that can move in one or two ways only.
        ``residual`` (n,) are external minus internal forces, without contact forces.
        """
        return None

    def surface(self, surface: Surface) -> Surface:
        """Return a surface of the whole body in this part's numbering."""
        return surface

    def expand(self, u: Array, time: float) -> Array:
        """Return the whole body's displacements [mm]; those of a wheel in its hub's frame."""
        return u

    def on_whole(self, force: Array) -> Array:
        """Return the nodal forces of the whole body for those of this part [N]."""
        return force

    @property
    def volumes(self) -> Array:
        """Volume of the points (n_points,) [mm3]; a part without points has none."""
        return np.zeros(0)

    @property
    def narrows(self) -> bool:
        """Whether it can be solved in a window, outside of which it is linear."""
        return True

    def start(self) -> Array:
        """Return the unknowns (n,) before any load."""
        return np.zeros(self.n)

    def external(self, time: float, u: Array | None = None) -> Array:
        """Return the external nodal forces (n,) at a time and displacements (n,) [N].

        Without displacements they are those on the undeformed body.
        """
        return self.loads.at(time)

    def force_level(self, time: float) -> float:
        """Return the norm of the forces that load the part at a time [N]."""
        return float(np.linalg.norm(self.external(time)))

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
        return u

    def motion(self, surface: Surface, u: Array) -> Array:
        """Return the displacements (2, n_nodes) of a surface's nodes [mm]."""
        return vectors(u[surface.dofs], len(surface.X))

    def numbered(self, dofs: Ints) -> Ints:
        """Return the numbers here of unknowns on contact surfaces; -1 for those left out."""
        return dofs

    def pull_back(self, surface: Surface, u: Array, block: Array, gaps: int) -> tuple[Ints, Array]:
        """Return unknowns (m,) of this part and derivative rows (n_rows, m) on these.

        ``block`` (n_rows, 2 n_nodes) has the derivatives by the displacements of a surface; its
        first ``gaps`` rows are gaps, the others slips.
        """
        return surface.dofs, block
