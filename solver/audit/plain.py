"""A second, independent evaluation of a body: strain, stress, forces, applied loads, energy.

The solver's operators are not used: gradients follow from the elements, volumes from the
quadrature, heat and initial stress from the declared loads, and resultants of pressures from the
shape of the boundary. Stress and strain are Mandel vectors, elements and points last.

Large strain is evaluated by principal stretches, for which the solver has closed forms: with the
principal values c and directions n of C = F'F, the strain is ln(c) / 2 along n, and the stress S =
2 T : dE/dC has in these directions the components ``T_ij 2 (E_i - E_j) / (c_i - c_j)``, with the
limit 1 / c_i for equal values. The nominal stress is F S.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np

from solver.fem.cells import smooth_cells
from solver.fem.discretisation import Discretisation
from solver.fem.loads import Push
from solver.fem.nodes import vectors
from solver.fem.surface import edges_of
from solver.materials.heated import Heated
from solver.materials.law import Law
from solver.mesh.edges import shape_derivatives, shape_functions
from solver.mesh.elements import element_type
from solver.model.amplitude import Amplitude
from solver.model.body import Body
from solver.model.loads import Load
from solver.tensors import SQRT2, to_mandel, to_tensor
from solver.typing import Array, Ints

_CHORDS, _HALVINGS, _BENT = 64, 40, 1e-7
"""Number of chords of an edge. Most halvings of a chord. Difference of the force at its middle, or
of the mean at its ends, from the mean at its Gauss points, over the whole force: a chord with a
larger one is halved, because loads may have kinks and jumps."""
_GAUSS = (0.5 - 0.75**0.5 / 3, 0.5 + 0.75**0.5 / 3)
_INSIDE = (0.5, 1e-6, 1 - 1e-6)
"""Positions on a chord: Gauss points; middle and both ends, just inside."""
_SHEARS = ((0, 1), (1, 2), (2, 0))
_COMPONENT = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2]])
"""Axes of the shear components xy, yz, zx; and number of the component of two axes."""
_PARTS = 7
"""Number of cells along the side of an element at first, for a force per volume; fewer if there are
many elements."""
LEAST, LEAST_ENERGY = 1e-7, 1e-8
"""Rounding levels of forces and of energies over their values in clamped elements: free expansion
leaves 1e-13 of the energy. They are the least values that errors are divided by."""
GHOST = 1e-7
"""Stiffness of a removed element over its value before."""


def load_factor(amplitude: Amplitude | None, time: float) -> float:
    """Return the load factor at a time: by the amplitude, or without one the time itself."""
    return time if amplitude is None else float(np.interp(time, amplitude.time, amplitude.value))


@dataclass(frozen=True)
class PlainBody:
    """One meshed body; ``part`` gives nodes, elements and quadrature."""

    part: Discretisation

    @property
    def body(self) -> Body:
        """The declared body."""
        return self.part.body

    @cached_property
    def _nodes(self) -> Ints:
        return np.asarray(self.part.basis.element_dofs)

    @cached_property
    def _gradients(self) -> Array:
        """(n_element_nodes, dim, n_elements, n_points) [1/mm]."""
        return np.array([np.asarray(b[0].grad) for b in self.part.basis.basis])

    @property
    def steepest(self) -> float:
        """Largest strain of an element per displacement of one of its nodes [1/mm]."""
        return float(np.abs(self._gradients).max())

    @cached_property
    def _round(self) -> Array:
        """Hoop strain of unit radial displacements (n_element_nodes, n_elements, n_points)."""
        radius = self.part.basis.global_coordinates()[0]
        return np.array([np.asarray(b[0]) / radius for b in self.part.basis.basis])

    @cached_property
    def volume(self) -> Array:
        """Volume of the points (n_elements, n_points) [mm3]."""
        return np.asarray(self.part.basis.dx * self._depth(self.part.basis.global_coordinates()))

    def _depth(self, x: Array) -> Array:
        round_axis = self.body.kinematics == "axisymmetric"
        return np.asarray(2 * np.pi * x[0] if round_axis else self.body.thickness)

    @property
    def _averaged(self) -> bool:
        """Whether the volumetric strain of an element is the mean over its points."""
        kind = element_type(self.body.element)
        return kind.mean_dilatation and self.body.kinematics != "plane_stress"

    def level(self, field: Array) -> Array:
        """Return a tensor field, for B-bar elements with its trace averaged over each element."""
        if not self._averaged:
            return field
        trace = field[:3].sum(axis=0)
        mean = (trace * self.volume).sum(axis=1) / self.volume.sum(axis=1)
        out = field.copy()
        out[:3] += (mean[:, None] - trace) / 3
        return out

    def gradient(self, u: Array) -> tuple[Array, Array]:
        """Return the gradient of displacements (n,) [mm] at the points, and the hoop strain.

        Shapes are (dim, dim, n_elements, n_points), direction of displacement first, and
        (n_elements, n_points).
        """
        at = vectors(u, self.part.dim).T[self._nodes]  # (n_element_nodes, n_elements, dim)
        gradient = np.einsum("ijep,iek->kjep", self._gradients, at)
        if self.body.kinematics == "axisymmetric":
            return gradient, np.einsum("iep,ie->ep", self._round, at[..., 0])
        return gradient, np.zeros(gradient.shape[2:])

    def strain(self, u: Array) -> Array:
        """Return Mandel strain (n_components, n_elements, n_points) for displacements (n,) [mm]."""
        H, hoop = self.gradient(u)
        normal = [*(H[axis, axis] for axis in range(len(H))), hoop][:3]
        shears = [(H[a, b] + H[b, a]) / SQRT2 for a, b in _SHEARS[: 2 * len(H) - 3]]
        strain = np.array([*normal, *shears])
        if self.body.large:
            large = self.body.large_elements
            strain[:, large] = logarithmic(H[:, :, large], hoop[large])
        return self.level(strain)

    @cached_property
    def points(self) -> Array:
        """Positions of the points (dim, n_points) [mm]."""
        return np.asarray(self.part.basis.global_coordinates()).reshape(self.part.dim, -1)

    def eigenstrain(self, time: float) -> Array:
        """Return the eigenstrain (n_components, n_points, Mandel) of heat and initial stress."""
        components = 2 * len(self.points)
        out, elasticity = np.zeros((components, self.volume.size)), self.body.material.elasticity
        for load in self.body.every_load:
            factor = load_factor(load.amplitude, time)
            strain, stress = load.eigenstrain(self.points), load.initial_stress(self.points)
            if strain is not None:
                out += factor * to_mandel(strain)
            if stress is not None:
                nu, stress = elasticity.poisson_ratio, factor * to_mandel(stress)
                out[:3] += nu / elasticity.youngs_modulus * stress[:3].sum(axis=0)
                out -= (1 + nu) / elasticity.youngs_modulus * stress
        return out

    def shares(self, time: float) -> tuple[Array, Array]:
        """Return Young's modulus and yield stress (n_points,) over their cold values."""
        stiff, strong = np.ones((2, self.points.shape[1]))
        for load in self.body.every_load:
            lost = load.softening(self.points)
            if lost is not None:
                factor = load_factor(load.amplitude, time)
                stiff -= factor * lost[0]
                strong -= factor * lost[1]
        return self.remaining(time) * stiff, strong

    def prescribed(self, time: float) -> Array:
        """Return the displacements (n_nodes, dim) of supports and loads, NaN where free [mm]."""
        moved: dict[tuple[str, int], float] = {
            (boundary, "xyz".index(axis)): 0.0
            for boundary, axes in self.body.supports.items()
            for axis in axes
        }
        for load in self.body.every_load:  # displacements of one boundary add up
            factor = load_factor(load.amplitude, time)
            for boundary, axis in itertools.product(load.boundaries, load.components):
                value = factor * load.components[axis]
                moved[boundary, axis] = moved.get((boundary, axis), 0.0) + value
        given = np.full(self.part.X.T.shape, np.nan)
        for (boundary, axis), value in moved.items():
            given[self.part.boundary_nodes(boundary), axis] = value
        return given

    def remaining(self, time: float) -> Array:
        """Return the share of stiffness (n_points,) that remains after removal of elements."""
        share = np.ones(self.volume.shape)
        for load in self.body.every_load:
            if load.removes:
                elements = np.asarray(self.body.mesh.subdomains[load.removes])
                share[elements] -= load_factor(load.amplitude, time)
        return np.maximum(share, GHOST).ravel()

    def known(self, values: Array, time: float) -> Array:
        """Return values (..., n_points), NaN in removed elements."""
        return np.where(self.remaining(time) > GHOST, values, np.nan)

    def law(self, time: float) -> Law:
        """Return the law of the points at a time."""
        stiff, strong = self.shares(time)
        if (stiff == 1).all() and (strong == 1).all():
            return self.body.law
        return Heated(law=self.body.law, stiff=stiff, strong=strong)

    def forces(self, stress: Array, u: Array | None = None) -> Array:
        """Return the nodal forces (n_nodes, dim) that balance a Mandel stress of the points [N].

        With large strain it is conjugate to logarithmic strain at the displacements u (n,), which
        are needed then.
        """
        each = self.level(to_tensor(stress).reshape(len(stress), *self.volume.shape))
        dim = len(each) // 2
        plane, hoop = each[_COMPONENT[:dim, :dim]], each[2].copy()
        if self.body.large and u is not None:
            large, (H, around) = self.body.large_elements, self.gradient(u)
            plane[:, :, large], hoop[large] = nominal(each[:, large], H[:, :, large], around[large])
        return self.nominal_forces(plane, hoop)

    def nominal_forces(self, stress: Array, hoop: Array) -> Array:
        """Return the nodal forces (n_nodes, dim) that balance a nominal stress [N].

        Parameters
        ----------
        stress : (dim, dim, n_elements, n_points) force on planes before loading, direction of the
            force first [MPa]
        hoop : (n_elements, n_points) [MPa]
        """
        each = np.einsum("ijep,kjep->kie", self._gradients, stress * self.volume)
        if self.body.kinematics == "axisymmetric":
            each[0] += np.einsum("iep,ep->ie", self._round, hoop * self.volume)
        count = self.part.X.shape[1]
        nodes = self._nodes.ravel()
        return np.stack([np.bincount(nodes, f.ravel(), count) for f in each], axis=1)

    def applied(self, time: float, u: Array | None = None) -> Array:
        """Return the resultant [N] and the first moments [N mm] of the loads (1 + dim, dim).

        Loads that follow a body of large strain act at its displacements u (n,).
        First moments are force times x, y (and z) relative to the centre of the body. A pressure p
        has the force p times depth times length, against the outward normal, at the Gauss points of
        many chords of each edge.
        """
        total = np.zeros((1 + self.part.dim, self.part.dim))
        for load, own in zip(self.body.every_load, self._on_body, strict=True):
            at_factor_one = own
            if self.body.turns(load) and u is not None:
                x = self.part.X + vectors(u, self.part.dim)
                each = [self._on_boundary(load.push, b, x) for b in load.boundaries]
                at_factor_one = sum(each, self._on_volume(load, x))
            total += load_factor(load.amplitude, time) * at_factor_one
            for boundary in load.boundaries if load.moves else ():
                push = partial(load.push_at, time)
                total += self._on_boundary(push, boundary, self.part.X)
        return total

    @cached_property
    def _on_body(self) -> list[Array]:
        """The sums of `moments` for the forces of each load at load factor 1."""
        if self.part.dim == 3:  # loads in space have no forces
            return [np.zeros((4, 3)) for _ in self.body.every_load]
        return [
            sum(
                (self._on_boundary(load.push, b, self.part.X) for b in load.boundaries),
                self._on_volume(load),
            )
            for load in self.body.every_load
        ]

    def moments(self, force: Array, x: Array) -> Array:
        """Return the sums (1 + dim, dim) of forces (dim, n) at x (dim, n), times 1, x, y (, z)."""
        arm = x - self.part.X.mean(axis=1, keepdims=True)
        return np.asarray(np.vstack([np.ones_like(arm[:1]), arm]) @ force.T)

    def _on_boundary(self, push: Push, boundary: str, x_nodes: Array) -> Array:
        """Return the `moments` (3, 2) of the forces on a boundary, by Gauss's rule on chords."""
        edges = x_nodes[:, edges_of(self.part, boundary)]
        row = np.repeat(np.arange(edges.shape[1]), _CHORDS)
        start, width = (
            np.tile(np.linspace(-1.0, 1.0, _CHORDS + 1)[:-1], edges.shape[1]),
            2 / _CHORDS,
        )
        total, whole = np.zeros((3, 2)), 0.0
        for further in reversed(range(_HALVINGS)):

            def at(share: float, of: Any = shape_functions) -> Array:
                shapes = of(start + share * width, edges.shape[-1])  # noqa: B023
                return np.asarray((edges[:, row] * shapes).sum(axis=-1))  # noqa: B023

            forces = []
            for share in (*_GAUSS, *_INSIDE):
                x = at(share)
                force = push(x, width * at(share, shape_derivatives))
                if force is None:
                    return total
                forces.append(self._depth(x) * np.broadcast_to(force, x.shape))
            first, last, middle, one, other = forces
            mean = (first + last) / 2
            bent = np.abs([mean - middle, mean - (one + other) / 2]).max(axis=(0, 1))
            whole = whole or np.abs(mean).sum()
            halved = (bent > _BENT * whole) & (further > 0)
            for force, share in zip((first, last), _GAUSS, strict=True):
                total += self.moments(force[:, ~halved], at(share)[:, ~halved]) / 2
            if not halved.any():
                break
            row, start, width = np.tile(row[halved], 2), start[halved], width / 2
            start = np.concatenate([start, start + width])
        return total

    def _on_volume(self, load: Load, x_nodes: Array | None = None) -> Array:
        """Return the `moments` (3, 2) of a load's force per volume, its nodes at X or at x (2, n).

        The cells of integration begin smaller than in the solver, which may miss narrow features.
        """
        if load.body_force(self.points) is None:
            return np.zeros((3, 2))

        def force(x: Array, at: Array | None = None) -> Array:
            given = np.asarray(load.body_force((x if at is None else at).reshape(2, -1)))
            return np.broadcast_to(given, (2, x[0].size)).reshape(x.shape) * self._depth(x)

        basis, rule = self.part.basis, np.polynomial.legendre.leggauss(6)
        cells = smooth_cells(basis, force, _PARTS)
        local, x, area = cells.points(rule, rule)
        nodes = self.part.X if x_nodes is None else x_nodes
        each = [(nodes[:, own[cells.element]], np.asarray(basis.elem.lbasis(local, k)[0]))
                for k, own in enumerate(basis.element_dofs)]  # fmt: skip
        at = x if x_nodes is None else sum(of[:, :, None] * shape for of, shape in each)
        given = force(x, at) * area
        return np.asarray(sum(self.moments((given * shape).sum(axis=2), of) for of, shape in each))

    def elastic_energy(self, stress: Array, time: float) -> float:
        """Return the energy of a Mandel stress (4, n_points) at a time [N mm]."""
        law = self.law(time)
        density = law.elasticity.energy_density(stress) / law.stiff
        return float((density * self.volume.ravel()).sum())


_EQUAL = 1e-8
"""(c_i - c_j) / c_j below which they count as equal: the error of the limit is half of it."""


def _gradient(H: Array) -> Array:
    """Return F (..., 2, 2) for displacement gradients (2, 2, ...)."""
    return np.moveaxis(H, (0, 1), (-2, -1)) + np.eye(2)


def logarithmic(H: Array, hoop: Array) -> Array:
    """Return the Mandel strain (4, ...) for displacement gradients (2, 2, ...) and hoop (...)."""
    F = _gradient(H)
    c, n = np.linalg.eigh(np.swapaxes(F, -1, -2) @ F)
    E = np.einsum("...ik,...k,...jk->ij...", n, np.log(c) / 2, n)
    return np.array([E[0, 0], E[1, 1], np.log(1 + hoop), SQRT2 * E[0, 1]])


def nominal(T: Array, H: Array, hoop: Array) -> tuple[Array, Array]:
    """Return the nominal stress (2, 2, ...) and its hoop part (...) [MPa].

    Parameters
    ----------
    T : (4, ...) tensor components of the stress that is conjugate to logarithmic strain [MPa]
    H, hoop : as of `logarithmic`
    """
    F = _gradient(H)
    c, n = np.linalg.eigh(np.swapaxes(F, -1, -2) @ F)
    one, other = c[..., :, None], c[..., None, :]
    apart = one / other - 1
    equal = np.abs(apart) < _EQUAL
    ratio = np.where(equal, 1.0, np.log1p(apart) / np.where(equal, 1.0, apart)) / other
    plane = np.array([[T[0], T[3]], [T[3], T[1]]])
    own = np.einsum("...ik,ij...,...jl->...kl", n, plane, n) * ratio
    S = n @ own @ np.swapaxes(n, -1, -2)
    return np.moveaxis(F @ S, (-2, -1), (0, 1)), T[2] / (1 + hoop)
