"""A second, independent evaluation of a prism: strain, stress and forces of waves along x.

Amplitudes are complex, those of a real Fourier transform over the stations downstream, so that a
derivative along x is a factor i k. The operators of `solver.rolling.rail` are not used: strain
comes from the gradients of the elements, springs and the means under the hats from their edges. Its
factors only give the displacements that are checked, and its far field gives the field beyond the
length. Outside the zone the whole section is solved again, for a few waves.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from solver.fem.surface import edges_of
from solver.linear import solvers as linear
from solver.linear.solvers import LinearSolver
from solver.mesh.edges import shape_derivatives, shape_functions
from solver.rolling.rail.section import Stiffness
from solver.rolling.rail.track import PrismTrack
from solver.tensors import SQRT2
from solver.typing import Array, Complexes, Ints

_SAMPLED = (0, 1, 5)
"""Numbers of the waves for which the whole section is solved: the mean along x, for which springs
and supports carry most, the longest wave, and one about as long as the contact."""
_EDGE_POINTS = 4
_LEFT_OUT = 0.01
"""Share of the stress at the rim of the zone that may come from waves which are neglected outside
it. The stress of a rail there then has an error of 0.3 % of the largest; all waves take six times
as long."""


class Waves(NamedTuple):
    """The fields of eigenstress and tractions in a prism that repeats itself.

    Attributes
    ----------
    u : (n, waves) displacement of the section; outside the zone only in sampled waves [mm]
    pulled : (n, waves) nodal forces of the tractions, per length [N/mm]
    pushed : (n, waves) nodal forces of the eigenstress, per length [N/mm]
    strain : (n_points, waves, 6) strain at the points of the zone, Mandel
    """

    u: Complexes
    pulled: Complexes
    pushed: Complexes
    strain: Complexes


class PlainPrism:
    """One prism; ``track`` gives nodes, elements, quadrature, supports and stations."""

    def __init__(self, track: PrismTrack) -> None:
        self.track, section = track, track.section
        modes, plane = track.modes, section.plane
        basis = plane.basis
        self.spacing, self._n = modes.length / modes.stations, section.n
        self._nodes = np.asarray(basis.element_dofs.T)
        self._dofs = (3 * self._nodes[..., None] + np.arange(3)).reshape(len(self._nodes), -1)
        self.area = np.asarray(basis.dx)
        inside = np.unique(modes.points // self.area.shape[1])
        self._still, self._waving = (self._rows(each, inside) for each in self._gradients)
        self._outside = np.setdiff1d(np.arange(len(self._nodes)), inside)
        self._zone_area = np.repeat(self.area[inside].ravel(), 6)
        self._k = -2 * np.pi / modes.length * np.arange(modes.stations // 2 + 1)
        self.sampled = tuple(wave for wave in _SAMPLED if wave < len(self._k))
        self._own = np.setdiff1d(modes.unknowns, self._dofs[self._outside])

    # -- operators -----------------------------------------------------------------------------

    @cached_property
    def _gradients(self) -> tuple[Array, Array]:
        """Operators (n_elements, 4, 6, 24) of strain across x, and of strain times i k."""
        values = self.track.section.plane.basis.basis
        N = np.stack([np.broadcast_to(np.asarray(b[0]), self.area.shape) for b in values], axis=-1)
        along_z, along_y = (
            np.stack([np.asarray(b[0].grad[axis]) for b in values], axis=-1) for axis in (0, 1)
        )
        still, waving = np.zeros((2, *self.area.shape, 6, N.shape[-1], 3))
        still[..., 1, :, 1], still[..., 2, :, 2] = along_y, along_z
        still[..., 3, :, 0], still[..., 5, :, 0] = along_y / SQRT2, along_z / SQRT2
        still[..., 4, :, 1], still[..., 4, :, 2] = along_z / SQRT2, along_y / SQRT2
        waving[..., 0, :, 0] = N
        waving[..., 3, :, 1] = waving[..., 5, :, 2] = N / SQRT2
        shape = (*self.area.shape, 6, -1)
        return still.reshape(shape), waving.reshape(shape)

    def _rows(self, operator: Array, elements: Ints) -> sparse.csr_array:
        """Return an operator at the points of elements as a matrix (6 n_points, n)."""
        values = operator[elements]
        columns = np.broadcast_to(self._dofs[elements][:, None, None], values.shape)
        indptr = np.arange(0, values.size + 1, values.shape[-1])
        shape = len(indptr) - 1, self._n
        return sparse.csr_array((values.ravel(), columns.ravel(), indptr), shape=shape)

    @cached_property
    def _springs(self) -> sparse.csr_array:
        """Stiffness (n, n) of the springs [N/mm2]."""
        plane = self.track.section.plane
        total = sparse.csr_array((self._n, self._n))
        at, weights = np.polynomial.legendre.leggauss(_EDGE_POINTS)
        for boundary, stiffness in self.track.section.springs.items():
            edges = edges_of(plane, boundary)
            each = np.zeros((len(edges), 3, 3))
            for xi, weight in zip(at, weights, strict=True):
                N = shape_functions(np.array(xi), 3)
                along = plane.X[:, edges] @ shape_derivatives(np.array(xi), 3)
                side = np.linalg.norm(along, axis=0)
                each += (weight * side)[:, None, None] * np.outer(N, N)
            for axis, spring in enumerate(stiffness):
                own = 3 * edges + axis
                rows = np.broadcast_to(own[:, :, None], each.shape).ravel()
                columns = np.broadcast_to(own[:, None, :], each.shape).ravel()
                values = spring * each.ravel()
                total += sparse.csr_array((values, (rows, columns)), shape=total.shape)
        return total

    def _products(self) -> tuple[Array, Array, Array]:
        """Return products (n_elements, 24, 24) of still with itself, with waving, of waving."""
        C = self.track.elasticity.stiffness(6)
        still, waving = self._gradients
        flat = len(still), -1, still.shape[-1]

        def product(one: Array, other: Array) -> Array:
            stress = (C @ other) * self.area[..., None, None]
            return np.matmul(one.reshape(flat).swapaxes(1, 2), stress.reshape(flat))

        return product(still, still), product(still, waving), product(waving, waving)

    def _stiffness(self, wave: int, products: tuple[Array, Array, Array]) -> sparse.csr_array:
        """Return the stiffness (n, n) of the whole section for a wave, with its springs."""
        k = self._k[wave]
        still, mixed, waving = products
        each = still + 1j * k * (mixed - mixed.swapaxes(1, 2)) + k**2 * waving
        rows = np.broadcast_to(self._dofs[:, :, None], each.shape).ravel()
        columns = np.broadcast_to(self._dofs[:, None, :], each.shape).ravel()
        whole = sparse.csr_array((each.ravel(), (rows, columns)), shape=(self._n, self._n))
        return sparse.csr_array(whole + self._springs)

    @cached_property
    def _whole(self) -> dict[int, tuple[sparse.csr_array, LinearSolver]]:
        """Stiffness of each sampled wave, and the factors of its real form on free unknowns.

        With displacements along x divided by i the stiffness is real.
        """
        free = self.track.section.free
        turn = sparse.diags_array(self._turn[free])
        found, products = {}, self._products()
        for wave in self.sampled:
            K = self._stiffness(wave, products)
            own = turn.conj() @ sparse.csr_array(K[free][:, free]) @ turn
            upper = sparse.csr_array(sparse.triu(own))
            factors = linear.analyse(sparse.csr_array(upper.real))
            factors.factorise(np.ascontiguousarray(upper.real.data))
            found[wave] = K, factors
        return found

    @cached_property
    def _turn(self) -> Complexes:
        """(n,) i for displacements along x, 1 for others."""
        return np.tile([1j, 1.0, 1.0], self._n // 3)

    # -- waves ---------------------------------------------------------------------------------

    def waves(self, eigenstress: Array, traction: Array) -> Waves:
        """Return the waves of eigenstress (n_points, window, 6) and tractions (n, m, 3) [MPa].

        In the zone displacements come from the factors of the track, for the forces computed here.
        """
        modes = self.track.modes
        pushed = self._force(np.fft.rfft(self._everywhere(eigenstress), axis=1))
        pulled = np.fft.rfft(self._nodal(traction), axis=1)
        force = pushed + pulled
        turn = self._turn[modes.unknowns, None]
        own = (force[modes.unknowns] / turn).T
        found = modes.solved(np.stack([own.real, own.imag], axis=1))
        u = np.zeros_like(force)
        for wave in self.sampled:
            u[:, wave] = self._solved(wave, force[:, wave])
        zone = turn * (found[:, 0] + 1j * found[:, 1]).T
        # on soft springs a short length turns by radians: rounding of that is no strain
        rigid = self.track.section.rigid
        apart = zone[:, 0] - u[modes.unknowns, 0]
        u[:, 0] += rigid @ np.linalg.lstsq(rigid[modes.unknowns], apart)[0]
        u[modes.unknowns] = zone
        return Waves(u, pulled, pushed, self._strain(u))

    def _everywhere(self, eigenstress: Array) -> Array:
        """Return the eigenstress at all stations; behind the window it fades to zero."""
        left = self.track.modes.stations - eigenstress.shape[1]
        t = np.arange(1, left + 1) / (left + 1)
        fading = (1 - t) ** 3 * (1 + 3 * t + 6 * t**2)
        tail = eigenstress[:, -1:] * fading[:, None]
        return np.concatenate([eigenstress, tail], axis=1)

    def _force(self, stress: Complexes) -> Complexes:
        """Return the nodal forces (n, waves) of a stress (n_points, waves, 6), as amplitudes."""
        flat = stress.swapaxes(1, 2).reshape(-1, stress.shape[1]) * self._zone_area[:, None]
        return _times(self._still.T, flat) - 1j * self._k * _times(self._waving.T, flat)

    def _strain(self, u: Complexes) -> Complexes:
        """Return the strain amplitudes (n_points, waves, 6) of displacements (n, waves)."""
        flat = _times(self._still, u) + 1j * self._k * _times(self._waving, u)
        return np.asarray(flat.reshape(-1, 6, u.shape[1]).swapaxes(1, 2))

    def strain(self, found: Waves) -> Array:
        """Return the strain (n_points, window, 6) of the waves and of the far field."""
        stations = self.track.modes.stations
        own = np.fft.irfft(found.strain, stations, axis=1)[:, : len(self.track.modes.x)]
        far = self.track.far
        return own if far is None else own + far.strain @ self.resultants(found.pulled)

    def beside(self, found: Waves) -> Array:
        """Return the strain (n, 6) at the load, at all points of the section outside the zone.

        It is the strain of the pass, without that which is constant along x. Waves that are weak at
        the rim of the zone are neglected.
        """
        track, C = self.track, self.track.elasticity.stiffness(6)
        modes, stations = track.modes, track.modes.stations
        if not len(self._outside):
            return np.zeros((0, 6))
        share = np.full(len(self._k), 2.0 / stations)
        share[[0, -1]] /= 2.0
        at_rim = share * np.abs(found.strain[track.rim] @ C).max(axis=(0, 2))
        lowest = np.argsort(at_rim)
        few = np.cumsum(at_rim[lowest]) > _LEFT_OUT * at_rim.sum()
        still, waving, rest, stiffness, factors = self._around
        area = self.area[self._outside].reshape(-1, 1)
        turn, strain = self._turn[rest], np.zeros((len(area), 6))
        for wave in lowest[few]:
            ik = 1j * self._k[wave]
            u = found.u[:, wave].copy()
            if wave not in self.sampled:  # there the whole section is known
                own = (still @ u + ik * (waving @ u)).reshape(-1, 6) @ C * area
                force = (still.T @ own.ravel() - ik * (waving.T @ own.ravel()))[rest] / turn
                factors.factorise(stiffness.at(self._k[wave]))
                both = factors.solve(-np.stack([force.real, force.imag], axis=1))
                u[rest] = (both[:, 0] + 1j * both[:, 1]) * turn
            amplitude = still @ u + ik * (waving @ u)
            phase = np.exp(2j * np.pi * wave * track.before / stations)
            strain += share[wave] * (amplitude * phase).real.reshape(-1, 6)
        if track.far is not None:
            around = np.delete(track.far.around, modes.points, axis=0)
            strain += around @ self.resultants(found.pulled)
        return strain

    @cached_property
    def _around(
        self,
    ) -> tuple[sparse.csr_array, sparse.csr_array, Ints, Stiffness, LinearSolver]:
        """Operators outside the zone, the unknowns there, their stiffness, and a solver."""
        still, waving = (self._rows(each, self._outside) for each in self._gradients)
        rest = np.setdiff1d(self.track.section.free, self.track.modes.unknowns)
        stiffness = self.track.section.stiffness(rest)
        return still, waving, rest, stiffness, linear.analyse(stiffness.pattern)

    def resultants(self, pulled: Complexes) -> Array:
        """Return forces along x, y, z [N] and the moment about x [N mm] of nodal forces."""
        force = self.spacing * pulled[:, 0].real.reshape(-1, 3)
        z, y = self.track.section.plane.X - self.track.section.plane.X.mean(axis=1, keepdims=True)
        return np.append(force.sum(axis=0), y @ force[:, 2] - z @ force[:, 1])

    def unbalanced(self, found: Waves) -> float:
        """Return the norm of the nodal forces out of balance [N].

        In every wave it counts nodes that only elements of the zone share, in sampled waves all
        nodes.
        """
        C = self.track.elasticity.stiffness(6)
        lacking = found.pulled + found.pushed - self._force(found.strain @ C)
        own, free = np.zeros(self._n, dtype=bool), self.track.section.free
        own[self._own] = True
        square = (np.abs(lacking[own]) ** 2).sum(axis=0)
        for wave, (K, _) in self._whole.items():
            u, moved = found.u[:, wave], np.zeros(self._n, dtype=complex)
            if wave == 0:  # on soft springs the section moves far, against them alone
                rigid = self.track.section.rigid
                moved = rigid @ np.linalg.lstsq(rigid, u)[0]
            carried = K @ (u - moved) + self._springs @ moved
            whole = found.pulled[:, wave] + found.pushed[:, wave] - carried
            square[wave] = (np.abs(whole[free]) ** 2).sum()
        stations = self.track.modes.stations
        twice = np.full(len(square), 2.0)
        twice[0] = twice[-1] = 1.0
        return self.spacing * float(np.sqrt(twice @ square / stations))

    def reactions(self, found: Waves) -> Array:
        """Return the sum (4,) of tractions, springs and supports; see `resultants`."""
        u, pulled = found.u[:, 0], found.pulled[:, 0]
        sprung = self._springs @ u
        held = np.ones(self._n, dtype=bool)
        held[self.track.section.free] = False
        supported = np.where(held, self._whole[0][0] @ u - found.pushed[:, 0] - pulled, 0.0)
        return self.resultants((pulled - sprung + supported)[:, None])

    @cached_property
    def _throughout(self) -> sparse.csr_array:
        """Strain at all points of the section (6 n, n) of displacements constant along x."""
        return self._rows(self._gradients[0], np.arange(len(self._nodes)))

    def constant(self, eigenstress: Array) -> tuple[Array, Array]:
        """Return strain (n, 6) and surface (m, 3) by an eigenstress constant along x.

        The eigenstress is that of the points of the zone, the strain that of the whole section.
        """
        force = self._still.T @ (eigenstress.ravel() * self._zone_area)
        u = self._solved(0, force.astype(complex)).real
        return (self._throughout @ u).reshape(-1, 6), self._mean(u)

    def initial_stress(self, given: Array, held: Array) -> Array:
        """Return the stress (n, 6) of the section once given stresses are in equilibrium.

        See `solver.rolling.rail.straight.StraightPrism.settled`: the part of ``given`` that would
        lengthen, bend and turn the prism vanishes.
        """
        still, C = self._throughout, self.track.elasticity.stiffness(6)
        area = self.area.reshape(-1, 1)

        def relaxed(stress: Array) -> Array:
            force = still.T @ (-stress * area).ravel()
            u = self._solved(0, force.astype(complex)).real
            return np.asarray(stress + (still @ u).reshape(-1, 6) @ C)

        z, y = np.asarray(self.track.section.plane.basis.global_coordinates()).reshape(2, -1)
        x_x, turned = np.eye(6)[0], np.stack([-z, y], axis=1) @ np.eye(6)[[3, 5]]
        motions = [x_x * np.ones_like(area), np.outer(y, x_x), np.outer(z, x_x), turned / SQRT2]
        each, free = [relaxed(strain @ C) for strain in motions], relaxed(given)
        left = np.array([[(s * strain * area).sum() for s in (free, *each)] for strain in motions])
        shares = np.linalg.solve(left[:, 1:], -left[:, 0])
        return free + relaxed(held) + np.tensordot(shares, np.stack(each), 1)

    def _solved(self, wave: int, force: Complexes) -> Complexes:
        """Return the displacement (n,) of the whole section for forces (n,) in a sampled wave."""
        free, u = self.track.section.free, np.zeros(self._n, dtype=complex)
        # motions of the whole section, against the springs alone, are found without its stiffness
        loose = self.track.section.loose if wave == 0 else np.zeros((self._n, 0))
        sprung = self._springs @ loose
        moved = np.linalg.solve(loose.T @ sprung, loose.T @ force)
        turned = ((force - sprung @ moved) / self._turn)[free]
        both = self._whole[wave][1].solve(np.stack([turned.real, turned.imag], axis=1))
        u[free] = (both[:, 0] + 1j * both[:, 1]) * self._turn[free]
        moved -= np.linalg.solve(loose.T @ sprung, sprung.T @ u)
        return np.asarray(u + loose @ moved)

    # -- the surface ---------------------------------------------------------------------------

    @cached_property
    def _chain(self) -> tuple[Ints, Array]:
        """Edges (m - 1, 3), from small to large z: first, last, middle; and their lengths."""
        X = self.track.section.plane.X
        edges = edges_of(self.track.section.plane, self.track.boundary)
        edges = edges[np.argsort(X[0, edges[:, 2]])]
        turned = X[0, edges[:, 0]] > X[0, edges[:, 1]]
        edges[turned, :2] = edges[turned, 1::-1]
        return edges, np.linalg.norm(X[:, edges[:, 1]] - X[:, edges[:, 0]], axis=0)

    @cached_property
    def _hats(self) -> sparse.csr_array:
        """Integrals (m, n_nodes) of nodal values times hats: a sixth of the edge and a third."""
        edges, length = self._chain
        m, number = len(edges) + 1, np.arange(len(edges))
        rows = np.concatenate([number, number, number + 1, number + 1])
        columns = np.concatenate([edges[:, 0], edges[:, 2], edges[:, 1], edges[:, 2]])
        values = np.concatenate([length / 6, length / 3, length / 6, length / 3])
        return sparse.csr_array((values, (rows, columns)), shape=(m, self._n // 3))

    @cached_property
    def width(self) -> Array:
        """Integrals (m,) of the hats [mm]."""
        half = self._chain[1] / 2
        return np.append(half, 0.0) + np.append(0.0, half)

    def _mean(self, u: NDArray[Any]) -> NDArray[Any]:
        """Return the means under the hats (m, 3, ...) of displacements (n, ...)."""
        flat = self._hats @ u.reshape(self._n // 3, -1)
        return (flat / self.width[:, None]).reshape(len(self.width), 3, *u.shape[1:])

    def _nodal(self, traction: Array) -> Array:
        """Return nodal forces (n, stations) of tractions (n, m, 3), per length [N/mm]."""
        forces = np.zeros((self._n, self.track.modes.stations))
        each = traction.swapaxes(0, 1).reshape(len(self.width), -1)
        nodal = (self._hats.T @ each).reshape(-1, len(traction), 3)
        forces[:, self.track.near] = nodal.swapaxes(1, 2).reshape(self._n, -1)
        apart = forces.shape[1] // self.track.loads
        return np.sum([np.roll(forces, k * apart, 1) for k in range(self.track.loads)], axis=0)

    def surface(self, found: Waves, traction: Array) -> Array:
        """Return the displacement (n, m, 3) of the grid, with that of the far field [mm]."""
        waves = self._mean(found.u.reshape(self._n, -1))
        moved = np.fft.irfft(waves, self.track.modes.stations, axis=2)[..., self.track.near]
        moved = np.moveaxis(moved, 2, 0)
        far, count = self.track.far, len(moved)
        if far is None:
            return moved
        apart = np.arange(count)[:, None] - np.arange(count)
        beyond = far.displacement[:, self.track.before + apart]
        each = np.stack([self.resultants((self._hats.T @ one).reshape(-1, 1)) for one in traction])
        added = np.einsum("rcdq,dq->cr", beyond, each)
        return moved + added.reshape(count, 3, -1).swapaxes(1, 2)


def _times(matrix: sparse.csr_array, values: Complexes) -> Complexes:
    """Return the product of a real matrix with complex values (n, m), as real numbers."""
    real = np.ascontiguousarray(values).view(np.float64)
    return np.asarray(np.ascontiguousarray(matrix @ real).view(np.complex128))
