"""A body of large strain: logarithmic strain, and loads that follow its displacements.

Its nodes, points, law and contact are those of a body of small strain. No element of large strain
keeps the stiffness of the undeformed body. If only the elements of a region have large strain, the
others are linear where they do not flow, so that increments are solved in windows around the region
(`solver.fem.window`).
"""

from __future__ import annotations

from copy import copy
from functools import cached_property

import numpy as np
from skfem import Basis

from solver.errors import ModelError
from solver.fem.deformation import Deformation, PartResponse
from solver.fem.discretisation import Discretisation, choose_pins
from solver.fem.log_strain import LogDeformation, RegionDeformation, gradient_operator
from solver.fem.nodes import Dofs, vectors
from solver.fem.surface import edges_of
from solver.mesh.edges import shape_derivatives, shape_functions
from solver.model.loads import Load
from solver.typing import Array

_XI, _WEIGHTS = np.polynomial.legendre.leggauss(8)
_STEP = 1e-5
"""Step of central differences over the length of an edge."""


_LINEAR = 1e-9
"""Deviation of a force from a linear one, over the force: a larger one is none of rounding."""
_STIFF = 1e3
"""Stiffness of the springs that hold rigid motions, over the mean of the diagonal."""
_DISTORTED = 0.2
"""Share of its shape that a distorted element keeps, at most."""


def _shapes(x: Array) -> Array:
    """Return least corner triangle over longest side squared, of polygons (2, k, n)."""
    ahead, back = np.roll(x, -1, axis=1) - x, np.roll(x, 1, axis=1) - x
    area = ahead[0] * back[1] - ahead[1] * back[0]
    turn = np.sign(area.sum(axis=0))
    return np.asarray((turn * area).min(axis=0) / (ahead**2).sum(axis=0).max(axis=0))


class Follower:
    """The forces of a load that follows a boundary.

    Attributes
    ----------
    dofs : (n_edges, m) unknowns of its edges
    before : (n_edges, m) forces on the undeformed boundary at load factor 1 [N]
    """

    def __init__(self, part: Discretisation, load: Load, boundary: str) -> None:
        self._part, self.load = part, load
        edges = edges_of(part, boundary)
        self.dofs = Dofs(edges.ravel(), 2).every.reshape(len(edges), -1)
        count = edges.shape[1]
        self._N, self._slopes = shape_functions(_XI, count), shape_derivatives(_XI, count)
        self._X = part.X.T.ravel()[self.dofs]
        self._element = part.body.mesh.f2t[0, part.body.facets(boundary)]
        own = part.dofs[self._element]
        self._at = (own[:, None, :] == self.dofs[:, :, None]).argmax(axis=2)
        self.before = self._forces(self._X)

    def _forces(self, x: Array) -> Array:
        """Return the forces (n_edges, m) on edges whose nodes are at x (n_edges, m)."""
        nodes = x.reshape(len(x), -1, 2)
        at, along = (
            np.moveaxis(np.einsum("enk,qn->ekq", nodes, of), 1, 0).reshape(2, -1)
            for of in (self._N, self._slopes)
        )
        push = np.asarray(self.load.push(at, along)) * self._part.measure(at)
        each = push.reshape(2, len(x), -1) * _WEIGHTS
        forces = np.einsum("keq,qn->enk", each, self._N)
        return np.asarray(forces.reshape(len(x), -1))

    def change(self, u: Array, time: float) -> Array:
        """Return the change of the nodal forces (n,) by the displacements at a time [N]."""
        return self.nodal(self._forces(self._X + u[self.dofs]) - self.before, time)

    def nodal(self, forces: Array, time: float) -> Array:
        """Return the nodal forces (n,) for forces (n_edges, m) at load factor 1 [N]."""
        each = self.load.factor(time) * forces
        return np.asarray(np.bincount(self.dofs.ravel(), each.ravel(), self._part.n))

    def add_stiffness(self, elements: Array, u: Array, time: float) -> None:
        """Add the symmetric part of its stiffness to the matrices of all elements [N/mm]."""
        x, factor = self._X + u[self.dofs], self.load.factor(time)
        m = x.shape[1]
        step = _STEP * np.ptp(x.reshape(len(x), -1, 2), axis=1).max(axis=1)
        K = np.zeros((len(x), m, m))
        for k in range(m):
            moved = np.zeros_like(x)
            moved[:, k] = step
            change = self._forces(x + moved) - self._forces(x - moved)
            K[:, :, k] = -factor * change / (2 * step[:, None])
        K = (K + K.swapaxes(1, 2)) / 2
        np.add.at(elements, (self._element[:, None, None], self._at[:, :, None],
                             self._at[:, None, :]), K)  # fmt: skip


class Spinning:
    """The forces of a load per volume that is linear in the position, as the centrifugal force.

    Raises
    ------
    ModelError
        for a force that is not linear in the position
    """

    def __init__(self, part: Discretisation, load: Load) -> None:
        self._part, self.load = part, load
        basis = Basis(part.body.mesh, part.basis.elem, intorder=2 * part.basis.elem.maxdeg + 1)
        N = np.array([np.broadcast_to(np.asarray(b[0]), basis.dx.shape) for b in basis.basis])
        volumes = basis.dx * part.measure(np.asarray(basis.global_coordinates()))
        mass = np.einsum("aep,bep,ep->eab", N, N, volumes)
        size = np.ptp(part.X, axis=1).max()
        at = size * np.array([[0.0, 1.0, 0.0, 2.0], [0.0, 0.0, 1.0, 3.0]])
        given = np.broadcast_to(np.asarray(load.body_force(at)), at.shape)
        x, y, both = (given[:, 1:] - given[:, :1]).T
        if not np.abs(both - 2 * x - 3 * y).max() <= _LINEAR * np.abs(given).max():
            allowed = "must be linear in the position: it follows a body of large strain"
            raise ModelError(f"{load.name}.body_force", "not linear", allowed)
        slope = np.stack([x, y], axis=1) / size
        self._M = np.kron(mass, slope)

    def change(self, u: Array, time: float) -> Array:
        """Return the change of the nodal forces (n,) by the displacements at a time [N]."""
        dofs = self._part.dofs
        each = self.load.factor(time) * np.einsum("eij,ej->ei", self._M, u[dofs])
        return np.asarray(np.bincount(dofs.ravel(), each.ravel(), self._part.n))

    def add_stiffness(self, elements: Array, u: Array, time: float) -> None:
        """Add the symmetric part of its stiffness to the matrices of all elements [N/mm]."""
        elements -= self.load.factor(time) / 2 * (self._M + self._M.swapaxes(1, 2))


def following(part: Discretisation) -> list[Follower | Spinning]:
    """Return the loads that follow the displacements of a body, were its strain large."""
    loads = [load for load in part.body.every_load if load.follows and not load.moves]
    nowhere = part.X[:, :0]
    spun = [
        Spinning(part, load)
        for load in loads
        if not load.boundaries and load.body_force(nowhere) is not None
    ]
    return [*spun, *(Follower(part, load, of) for load in loads for of in load.boundaries)]


class LargeDiscretisation(Discretisation):
    """Unknowns, quadrature and operators of a body of large strain."""

    _whirls: bool
    """Whether it can turn as a whole."""
    _unit: float
    """Angle [rad] of the last of its rigid motions, if it is a rotation."""

    @cached_property
    def _following(self) -> list[Follower | Spinning]:
        return [each for each in following(self) if self.body.turns(each.load)]

    def _measure(self, values: Array, gradients: Array, *, mean: bool) -> Deformation:
        large, at_rest = self.body.large_elements, np.zeros(self.n)
        g = gradient_operator(
            values[:, large], gradients[:, :, large], self.points[0][large], self.body.kinematics
        )
        log = LogDeformation.of(
            self.n, self.dofs[large], g, self.weights[large], at_rest, mean=mean
        )
        if large.all():
            return log
        small = super()._measure(values, gradients, mean=mean)
        return RegionDeformation.joined(small, log, np.flatnonzero(large))

    @property
    def narrows(self) -> bool:
        """See `Part`."""
        return not (self._following or self.body.large_elements.all())

    def _hold(self) -> None:
        super()._hold()
        self._whirls = self.rigid.shape[1] == 3 and bool(self.body.large_elements.all())
        if self._whirls:
            self.active = self.free

    def _springs(self, x: Array) -> Array:
        """Return the values on `pattern` of springs that hold a body that turns, nodes at x (2, n).

        They are where pins would hold its rigid motions there: pins before loading hold no rotation
        about them after a quarter turn. A Newton step strains none (`solver.loading.step`).
        """
        data = np.zeros(self.pattern.nnz)
        if np.isfinite(x).all():
            pins = np.setdiff1d(self.free, choose_pins(self._motions(x), self.free))
            at = self.pattern.indptr[np.searchsorted(self.free, pins)]
            data[at] = _STIFF * self.diagonal.mean()
        return data

    @cached_property
    def elastic_data(self) -> Array:
        """See `Discretisation`; with the springs of a body that turns."""
        data = self._assembly.values(slice(None), self.elastic_elements)
        return data + self._at_first if self._whirls else data

    @cached_property
    def _at_first(self) -> Array:
        return self._springs(self.X)

    def external(self, time: float, u: Array | None = None) -> Array:
        """Return the external nodal forces (n,) at a time and displacements (n,) [N]."""
        force = super().external(time)
        if u is not None:
            for each in self._following:
                force = force + each.change(u, time)
        return force

    def tangent_data(self, response: PartResponse, blend: float = 0.0) -> Array:
        """See `Discretisation`; the stiffness of pressures that follow is whole, too."""
        data = super().tangent_data(response, blend)
        if self._whirls:
            x = self.X + vectors(response.place[0], 2)
            data = data + self._springs(x) - self._at_first
        if not self._following:
            return data
        K = np.zeros_like(self.elastic_elements)
        for each in self._following:
            each.add_stiffness(K, *response.place)
        return data + self._assembly.values(slice(None), K)

    def distorted(self, u: Array) -> str:
        """Return a message on the element that displacements u (n,) distort most, or nothing.

        Its shape is the smallest triangle at a corner over the square of the longest side, as a
        share of that before loading.
        """
        corners = self.body.mesh.t[:, self.body.large_elements]
        each = [_shapes(x[:, corners]) for x in (self.X, self.X + vectors(u, self.dim))]
        share = each[1] / each[0]
        worst = int(share.argmin())
        if share[worst] > _DISTORTED:
            return ""
        (x, y), name = self.X[:, corners[:, worst]].mean(axis=1), self.body.name
        left = f"keeps {share[worst]:.0%} of its shape" if share[worst] > 0 else "is folded"
        return (
            f"the element of {name} that was at ({x:z.4g}, {y:z.4g}) {left}: make the elements "
            "there larger, or reduce the load"
        )

    def turned(self, u: Array) -> LargeDiscretisation:
        """Return the body at displacements u: its rotation is about its place.

        Forces within a body have no moment about its place, but one about its place before loading,
        which contact would have to hold. The free motions of a body that is held somewhere are
        those before loading: supports fix points of it, about which it cannot be said to turn.
        """
        if not self._whirls or not np.isfinite(u).all():
            return self
        here, x = copy(self), self.X + vectors(u, self.dim)
        here.rigid = self._motions(x)
        here._unit = np.ptp(vectors(here.rigid[:, -1], 2)[0]) / np.ptp(x[1])
        return here

    def turned_forces(self, time: float, residual: Array) -> Array | None:
        """See `Part`: forces within the body turn with it, and so do loads that follow it."""
        if not self._whirls:
            return None
        forces = self.external(time) - residual
        for each in self._following:
            if isinstance(each, Follower):
                forces -= each.nodal(each.before, time)
        turned = np.zeros_like(self.rigid)
        turned[:, 2] = self._unit * (vectors(forces, 2)[::-1] * [[-1], [1]]).T.ravel()
        return turned
