"""A body that is meshed only in a window; the rest is elastic and condensed, exactly.

Displacements outside the window depend linearly on those of its boundary b. With the out-of-balance
forces r of all elements outside at displacements u0, the unknowns i inside the rest and its
stiffness K, the rest exerts these forces on the nodes of the window:

    r_b - K_bi K_ii^-1 r_i - S (u - u0)_b,      S = K_bb - K_bi K_ii^-1 K_ib

The cost of an iteration (stress, tangent, factor and solves) is then that of the window.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from solver.fem.assembly import Assembly
from solver.fem.deformation import PartResponse
from solver.fem.discretisation import Discretisation, choose_pins
from solver.fem.loads import Softening, Superposed
from solver.fem.nodes import Dofs, vectors
from solver.fem.operators import Assembled, Operator, Restricted
from solver.fem.surface import Surface
from solver.linear.schur import Eliminated, SchurComplement
from solver.linear.solvers import Begun, Singular
from solver.materials import PlasticState
from solver.typing import Array, Bools, Ints


@dataclass(frozen=True, slots=True, eq=False)
class Region:
    """The region in which a body may yield and touch.

    Attributes
    ----------
    elements : (n_elements,) whether an element may yield
    contact : (n,) whether contact forces may act on an unknown
    """

    elements: Bools
    contact: Bools

    @classmethod
    def around(
        cls, whole: Discretisation, surfaces: Sequence[Surface], inner: Region, layers: int
    ) -> Region:
        """Return the region ``inner`` extended by layers of elements, with those of large strain.

        Without yielding elements it is extended from the touching ones.
        """
        touched = np.asarray(inner.contact[whole.dofs].any(axis=1))
        near = np.zeros(whole.n, dtype=bool)
        near[whole.dofs[layered(whole, touched, layers)]] = True
        contact = np.zeros(whole.n, dtype=bool)
        for surface in surfaces:
            contact[surface.dofs] = near[surface.dofs]
        yields = inner.elements if inner.elements.any() else touched
        return cls(layered(whole, yields, layers) | whole.body.large_elements, contact)

    def has(self, other: Region) -> bool:
        """Whether it contains another region."""
        yields, touches = other.elements & ~self.elements, other.contact & ~self.contact
        return not (yields.any() or touches.any())

    @property
    def key(self) -> bytes:
        """Its content."""
        return np.packbits(np.concatenate([self.elements, self.contact])).tobytes()


def layered(whole: Discretisation, elements: Bools, layers: int) -> Bools:
    """Return the elements (n_elements,) of a body, extended by layers of neighbours."""
    for _ in range(layers):
        within = np.zeros(whole.n, dtype=bool)
        within[whole.dofs[elements]] = True
        elements = np.asarray(within[whole.dofs].any(axis=1))
    return elements


class Windowed(Discretisation):
    """A body with the unknowns of a region only.

    `at` sets the beginning of an increment, which then uses the window as a `Discretisation`. The
    rest of a contact surface keeps its position in the increment.

    Attributes
    ----------
    whole : the meshed body
    elements : (n_elements,) whether the window has an element; it has at least those of the region
    kept : (n,) its unknowns in the whole body
    inside : (n_points,) its points in the whole body
    """

    _begin: Array
    _outer: Eliminated

    def __init__(self, whole: Discretisation, region: Region, linear_solver: str) -> None:
        nodes = np.zeros(whole.X.shape[1], dtype=bool)
        nodes[whole.dofs[region.elements] // whole.dim] = True
        nodes[np.flatnonzero(region.contact) // whole.dim] = True
        self.whole, self.body = whole, whole.body
        self.elements = np.asarray(nodes[whole.dofs // whole.dim].all(axis=1))
        at = np.flatnonzero(nodes)
        self.dim, self.kept = whole.dim, Dofs(at, whole.dim).every
        kept = self.kept
        self._number = number = np.full(whole.n, -1)
        number[kept] = np.arange(len(kept))
        self.n = len(kept)
        self.X = self.nodes = whole.X[:, at]
        self.rigid = whole.rigid[kept]
        self.free = np.flatnonzero(np.isin(kept, whole.free))
        self.active = choose_pins(self.rigid, self.free)
        self._mesh(whole, number)
        self._condense(whole, linear_solver)
        self._touches = region.contact[kept]

    def _mesh(self, whole: Discretisation, number: Ints) -> None:
        """Set the elements of the window, and the quantities at their points."""
        self.dofs = number[whole.dofs[self.elements]]
        self.weights = whole.weights[self.elements]
        self.undeformed = whole.undeformed.within(self.elements, self.dofs, self.n)
        self.points = whole.points[:, self.elements]
        per_element = whole.weights.shape[1]
        elements = np.repeat(np.flatnonzero(self.elements), per_element)
        self.softening = Softening.of(self, self.positions, elements)
        self.inside = np.flatnonzero(np.repeat(self.elements, per_element))
        strains = whole.eigenstrains
        components, cases = self.components, len(strains.cases)
        fields = strains.fields.reshape(components, whole.weights.size, cases)[:, self.inside]
        self.eigenstrains = Superposed(
            strains.cases, fields.reshape(components * len(self.inside), cases)
        )

    def _condense(self, whole: Discretisation, linear_solver: str) -> None:
        """Condense the rest of the body."""
        K = whole.elastic_matrix()
        inside = np.setdiff1d(whole.free, self.kept)
        self._schur = SchurComplement(K, self.kept, inside, linear_solver)
        self._edge = edge = np.flatnonzero(np.isin(self.kept, whole.dofs[~self.elements]))
        every = self.kept[edge]
        own = self.elastic_matrix()[edge][:, edge]
        self._rest = (K[every][:, every] - own).toarray()
        # the boundary of the condensed rest has no nodes whose outer elements are held elsewhere
        at = np.searchsorted(edge, self._schur.boundary)
        self._rest[np.ix_(at, at)] -= self._schur.taken

    def at(self, u: Array, plastic: PlasticState, time: float) -> Windowed:
        """Return the window for an increment from displacements and state of the whole body."""
        here = copy(self)
        response = self.whole.respond(u, plastic, time)
        out = self.whole.residual(time, u, response)
        inner = self.undeformed.at(u[self.kept])
        out[self.kept] += inner.internal_force(response.law.stress[:, self.inside])
        here._outer, here._begin = self._schur.begin(out), u
        return here

    def expand(self, u: Array, time: float) -> Array:
        """Return the whole body's displacements [mm]."""
        change = self._outer.finish(u - self._begin[self.kept])
        return self._begin + change

    def inverses(self, elastic: Operator, linear_solver: str) -> Assembled:
        """Return its inverse stiffnesses, given the elastic operator of the whole body."""
        restricted = Restricted(elastic, self.kept, self.whole.n)
        return Assembled(self, np.flatnonzero(self._touches), linear_solver, restricted)

    def numbered(self, dofs: Ints) -> Ints:
        """See `Part`; contact acts in the region only."""
        at = self._number[dofs]
        return np.where((at >= 0) & self._touches[at], at, -1)

    def over_whole(self, operator: Operator) -> Operator:
        """Return the operator of the whole body, given that of the window."""
        return _WholeOperator(self.kept, self._number, self._schur, operator)

    def motion(self, surface: Surface, u: Array) -> Array:
        """Return the displacements (2, n_nodes) of a surface's nodes [mm]."""
        at = self._number[surface.dofs]
        return vectors(np.where(at < 0, self._begin[surface.dofs], u[at]), self.dim)

    def pull_back(self, surface: Surface, u: Array, block: Array, gaps: int) -> tuple[Ints, Array]:
        """See `Part.pull_back`; raises `Singular` if contact has left the region."""
        at = self._number[surface.dofs]
        touches = (at >= 0) & self._touches[at]
        if block[:, ~touches].any():
            raise Singular("contact has left the window")
        return at[touches], block[:, touches]

    # -- the window as a body ------------------------------------------------------------------

    def residual(self, time: float, u: Array, response: PartResponse) -> Array:
        """Return external minus internal forces (n,), including the condensed rest [N]."""
        inner = response.deformation.internal_force(response.law.stress)
        force = self._outer.condensed - inner
        force[self._edge] -= self._rest @ (u - self._begin[self.kept])[self._edge]
        return force

    def external(self, time: float, u: Array | None = None) -> Array:
        """Return the external nodal forces (n,) at a time, including the condensed rest [N]."""
        return self._schur.begin(self.whole.external(time)).condensed

    def force_level(self, time: float) -> float:
        """Return the norm of the forces that load the whole body at a time [N]."""
        return self.whole.force_level(time)

    def moved(self, u: Array, time: float) -> Array:
        """Return the unknowns, whose prescribed motions have their values already."""
        return u

    def rounding(self, u: Array) -> float:
        """Return the out-of-balance force that rounding can cause in the whole body [N]."""
        moved = self._begin.copy()
        moved[self.kept] = u
        return self.whole.rounding(moved)

    def stiffness_along(self, step: Array, response: PartResponse) -> tuple[float, float]:
        """Return ``step' K step`` with the tangent and with the elastic stiffness [N mm]."""
        edge = step[self._edge]
        rest = float(edge @ self._rest @ edge)
        tangent, elastic = super().stiffness_along(step, response)
        return tangent + rest, elastic + rest

    @cached_property
    def _assembly(self) -> Assembly:
        return Assembly(self.dofs, self.active, self.n, self._edge)

    @cached_property
    def elastic_data(self) -> Array:
        """Values of the elastic stiffness on `pattern`."""
        rest = self._assembly.block_values(self._rest)
        return rest + self._assembly.values(slice(None), self.elastic_elements)


class _WholeOperator:
    """The operator of a whole body by that of its window; contact forces act in the window."""

    def __init__(
        self, kept: Ints, number: Ints, schur: SchurComplement, operator: Operator
    ) -> None:
        self._kept, self._number, self._schur, self._operator = kept, number, schur, operator

    def begin(self, force: Array) -> Begun:
        """See `Operator`."""
        kept, outer = self._kept, self._schur.begin(force)
        begun = self._operator.begin(outer.condensed)
        motion = np.zeros(len(force))
        motion[kept] = begun.kept
        return Begun(motion, lambda change: outer.finish(begun.finish(change[kept])))

    def compliance(self, dofs: Ints, rows: Array) -> Array:
        """See `Operator`; raises `Singular` if contact has left the window."""
        at = self._number[dofs]
        if rows[:, at < 0].any():
            raise Singular("contact has left the window")
        return self._operator.compliance(at[at >= 0], rows[:, at >= 0])
