"""The operators of a body: strain, internal force, tangent, loads, rigid motions."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy import linalg, sparse

from solver.fem.assembly import Assembly, whole_matrix
from solver.fem.deformation import (
    Deformation,
    PartResponse,
    mean_dilatation,
    rigid_motions,
    strain_operator,
)
from solver.fem.loads import (
    Softening,
    Superposed,
    check_removed,
    eigenstrains,
    moving_forces,
    nodal_forces,
    prescribed,
)
from solver.fem.nodes import Dofs, Nodes
from solver.fem.part import Part
from solver.fem.surface import Surface, extract, gathered
from solver.linear import solvers as linear
from solver.linear.solvers import LinearSolver
from solver.materials import Law, PlasticState, Response
from solver.mesh.elements import element_type
from solver.model.body import Body
from solver.typing import Array, Bools, Ints


def choose_pins(rigid: Array, free: Ints) -> Ints:
    """Return the unknowns ``free`` without one pin for each of the rigid motions (n, n_rigid)."""
    if not rigid.shape[1]:
        return free
    pivots = linalg.qr(rigid[free].T, mode="r", pivoting=True)[1]
    return np.setdiff1d(free, free[pivots[: rigid.shape[1]]])


class Discretisation(Nodes, Part):
    """Unknowns, quadrature and constant operators of one body.

    Attributes
    ----------
    dofs : (n_elements, dim n_element_nodes) unknowns of the elements
    undeformed : the body before loading; strain and nodal forces follow from it
    loads : nodal forces (n,) of pressures and tractions [N]
    moving : loads that move along its boundaries, which are not in ``loads``
    condensable : ``loads`` plus the nodal forces of the eigenstrain in an elastic body [N]
    free : unknowns that no support holds
    driven : prescribed displacements (n,) [mm]
    active : unknowns of ``free`` that are not pinned
    rigid : (n, n_rigid) rigid motions that the supports leave free
    """

    body: Body
    undeformed: Deformation

    def __init__(self, body: Body) -> None:
        super().__init__(body)
        self.nodes = self.X
        kind = element_type(body.element)
        self.dofs = Dofs(self.basis.element_dofs.T, self.dim).every
        values = np.array([np.broadcast_to(np.asarray(b[0]), self.basis.dx.shape)
                           for b in self.basis.basis])  # fmt: skip
        gradients = np.array([b[0].grad for b in self.basis.basis]).swapaxes(0, 1)
        mean = kind.mean_dilatation and body.kinematics != "plane_stress"
        self.undeformed = self._measure(values, gradients, mean=mean)
        self.moving = tuple(load for load in body.every_load if load.moves)
        self._moved: tuple[float, Array] = (np.nan, np.zeros(0))
        self.loads = nodal_forces(self)
        check_removed(self, self.loads)
        self.eigenstrains = eigenstrains(self)
        per_element = self.weights.shape[1]
        elements = np.repeat(np.arange(len(self.weights)), per_element)
        self.softening = Softening.of(self, self.positions, elements)
        self._hold()

    def _measure(self, values: Array, gradients: Array, *, mean: bool) -> Deformation:
        """Return the body before loading, given the shape functions at the points.

        Parameters
        ----------
        values, gradients : as `strain_operator` needs them
        mean : whether the volumetric strain is the mean over each element
        """
        B = strain_operator(values, gradients, self.points[0], self.body.kinematics)
        B = mean_dilatation(B, self.weights) if mean else B
        return Deformation.small(self.n, self.dofs, B, self.weights)

    def _hold(self) -> None:
        """Find the held unknowns, the free rigid motions, and one pin for each of these."""
        self.driven, self._held = prescribed(self)
        self.rigid = self._motions(self.X)
        self.free = np.flatnonzero(~self._held)
        self.active = choose_pins(self.rigid, self.free)

    def _motions(self, x: Array) -> Array:
        """Return the rigid motions (n, n_rigid) that supports leave free, with nodes at x."""
        motions = rigid_motions(x, self.body.kinematics)
        if self._held.any():
            # of three columns at most: the left vectors of all rows would take longer than the rest
            triangle = np.linalg.qr(motions[self._held], mode="r")
            motions = motions @ linalg.null_space(triangle, rcond=1e-9)
        return motions

    def chain(self, boundary: str, any_shape: bool = False) -> Surface:
        """Return the surface of a named boundary: one open chain, unless any shape is allowed."""
        return gathered(self, boundary) if any_shape else extract(self, boundary)

    @property
    def volumes(self) -> Array:
        """Volume of the points (n_points,) [mm3]."""
        return self.weights.ravel()

    def external(self, time: float, u: Array | None = None) -> Array:
        """See `Part.external`."""
        if not self.moving:
            return super().external(time)
        if self._moved[0] != time:  # an increment needs it many times
            self._moved = time, super().external(time) + moving_forces(self, self.moving, time)
        return self._moved[1]

    def grows(self, before: float, after: float) -> bool:
        """Whether the external load grows from one time to another, at a node if it moves."""
        if super().grows(before, after) or not self.moving:
            return super().grows(before, after)
        then, now = (np.abs(moving_forces(self, self.moving, time)) for time in (before, after))
        return bool((now > then).any())

    # -- the law at all points ---------------------------------------------------------------

    def strain(self, u: Array) -> Array:
        """Return Mandel strain (n_components, n_points) for displacements (n,)."""
        return self.undeformed.at(u).strain

    def law(self, time: float) -> Law:
        """Return the material law of its points at a time; temperature may change it."""
        return self.softening.law(self.body.law, time) if self.softening else self.body.law

    def gone(self, time: float) -> Bools | None:
        """Return whether elements at the points (n_points,) are removed; None if none ever are."""
        softening = self.softening
        return softening.gone(time) if softening and softening.removed.cases else None

    def eigenstrain(self, time: float) -> Array:
        """Return the eigenstrain (n_components, n_points, Mandel) of heat or initial stress."""
        return self.eigenstrains.at(time).reshape(self.components, -1)

    def respond(self, u: Array, state: PlasticState, time: float) -> PartResponse:
        """Return stress, tangent and new state at all points; the tangent is symmetric."""
        deformation = self.undeformed.at(u)
        return PartResponse(self._stressed(deformation.strain, state, time), deformation, (u, time))

    def _stressed(self, strain: Array, state: PlasticState, time: float) -> Response:
        """Return the response of the law; stress is NaN where the material is inverted.

        ``strain`` (n_components, n_points) is NaN there.
        """
        if self.body.large and (inverted := np.isnan(strain).any(axis=0)).any():
            found = self._stressed(np.where(inverted, 0.0, strain), state, time)
            return found._replace(stress=np.where(inverted, np.nan, found.stress))
        if self.eigenstrains.cases:
            strain = strain - self.eigenstrain(time)
        response = self.law(time).respond(strain, state)
        if not self.body.law.symmetric:
            tangent = response.tangent
            response = response._replace(tangent=0.5 * (tangent + tangent.swapaxes(0, 1)))
        return response

    @cached_property
    def condensable(self) -> Superposed:
        """Nodal forces (n,) of all loads and of the eigenstrain on an elastic body [N]."""
        C, strains = self.body.law.stiffness(self.components), self.eigenstrains
        pushed = [
            self.undeformed.internal_force(C @ strain.reshape(len(C), -1))
            for strain in strains.fields.T
        ]
        both = (*self.loads.cases, *strains.cases), (*self.loads.fields.T, *pushed)
        return Superposed.of(self.n, zip(*both, strict=True))

    def force_level(self, time: float) -> float:
        """Return the norm of the forces that load the body at a time, with eigenstrain [N]."""
        if not self.eigenstrains.cases:
            return super().force_level(time)
        force = self.condensable.at(time)
        if self.moving:
            force = force + self.external(time) - self.loads.at(time)
        return float(np.linalg.norm(force))

    def clamped(self, time: float) -> tuple[float, float]:
        """Return force [N] and energy [N mm] of heat, initial stress and motion, as if clamped.

        All displacements are zero except the prescribed ones. The magnitudes of element forces are
        added at the nodes; in a body that can deform these forces cancel.
        """
        nodal, energy = np.zeros(self.n), 0.0
        if self.eigenstrains.cases:
            strain = self.eigenstrain(time)
            stress = self.body.law.stiffness(len(strain)) @ strain
            energy += float((stress * strain).sum(axis=0) @ self.volumes) / 2
            size = np.linalg.norm(stress, axis=0) * self.volumes
            each = (
                np.linalg.norm(self.undeformed.B, axis=2)
                * size.reshape(self.weights.shape)[..., None]
            )
            nodal += np.bincount(self.dofs.ravel(), each.sum(axis=1).ravel(), self.n)
        if self.driven.cases:
            moved = self.driven.at(time)
            nodal += np.abs(self.diagonal * moved)
            energy += float(moved @ (self.diagonal * moved)) / 2
        return float(np.linalg.norm(nodal)), energy

    def moved(self, u: Array, time: float) -> Array:
        """Return ``u`` with prescribed displacements at their values at a time.

        The other unknowns follow elastically, so that the motion does not strain one row of
        elements only.
        """
        if not self.driven.cases:
            return u
        change = np.where(self._held, self.driven.at(time) - u, 0.0)
        if not change.any():
            return u
        force = self.elastic_matrix() @ change
        change[self.active] = self._elastic_solver.solve(-force[self.active])
        return u + change

    @cached_property
    def _elastic_solver(self) -> LinearSolver:
        solver = linear.analyse(self.pattern)
        solver.factorise(self.elastic_data)
        return solver

    def residual(self, time: float, u: Array, response: PartResponse) -> Array:
        """Return external minus internal forces (n,), without contact forces [N]."""
        return self.external(time, u) - response.deformation.internal_force(response.law.stress)

    def stiffness_along(self, step: Array, response: PartResponse) -> tuple[float, float]:
        """Return ``step' K step`` with the tangent and with the elastic stiffness [N mm]."""
        law, deformation, linear = response.law, response.deformation, response.linear
        strain = deformation.change(step)
        C = self.body.law.stiffness(len(strain))
        elastic = (strain * (C @ strain)).sum(axis=0) * self.volumes
        some, D = strain[:, ~linear], law.tangent[:, :, ~linear]
        tangent = float(np.einsum("ap,abp,bp->p", some, D, some) @ self.volumes[~linear])
        tangent += deformation.geometric_energy(step, law.stress)
        return float(elastic[linear].sum() + tangent), float(elastic.sum())

    # -- stiffness ---------------------------------------------------------------------------

    @cached_property
    def _assembly(self) -> Assembly:
        return Assembly(self.dofs, self.active, self.n)

    @property
    def pattern(self) -> sparse.csr_array:
        """Upper triangle of the stiffness on the active unknowns, values not set."""
        return self._assembly.pattern

    @cached_property
    def elastic_elements(self) -> Array:
        """Elastic stiffness of each element (n_elements, m, m)."""
        C = self.body.law.stiffness(self.components)
        return self.undeformed.stiffness(slice(None), C[None, None])

    @cached_property
    def elastic_data(self) -> Array:
        """Values of the elastic stiffness on `pattern`."""
        return self._assembly.values(slice(None), self.elastic_elements)

    @cached_property
    def _elastic_matrix(self) -> sparse.csr_array:
        return whole_matrix(self.dofs, self.elastic_elements, self.n)

    def elastic_matrix(self) -> sparse.csr_array:
        """Return the elastic stiffness on all unknowns (n, n), supports not applied."""
        return self._elastic_matrix

    def tangent_data(self, response: PartResponse, blend: float = 0.0) -> Array:
        """Return the values of ``(1 - blend) tangent + blend elastic stiffness`` on `pattern`.

        Elements whose points are all linear keep their elastic matrix. A geometric term is whole.
        """
        law, deformation, shape = response.law, response.deformation, self.weights.shape
        elements = np.flatnonzero(~response.linear.reshape(shape).all(axis=1))
        if len(elements) == 0:
            return self.elastic_data
        tangent = law.tangent.reshape(*law.tangent.shape[:2], *shape)
        tangent = tangent[:, :, elements].transpose(2, 3, 0, 1)
        of_moduli = blend and not deformation.linear.all()
        if of_moduli:
            C = self.body.law.stiffness(self.components)
            tangent = (1 - blend) * tangent + blend * C
        now = deformation.stiffness(elements, tangent, law.stress)
        change = now - self.elastic_elements[elements]
        data = self.elastic_data + self._assembly.values(elements, change)
        if blend and not of_moduli:
            return (1 - blend) * data + blend * self.elastic_data
        return data
