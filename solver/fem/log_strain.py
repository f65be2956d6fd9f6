"""Large strain: the logarithmic strain of a body at its displacements, with its derivatives.

With the deformation gradient F in the plane and C = F'F = s I + (d, o), the strain is

    E = ln(C) / 2 = m I + phi (d, o),   m = ln(J) / 2,   phi = h(q) / (2 s),   q = (d^2 + o^2) / s^2

where (d, o) is the deviator of C, J = det F, and h(q) = artanh(sqrt q) / sqrt q. These are the
spectral formulas without eigenvectors, and h is analytic where the principal strains are equal. The
hoop strain is ln(1 + u / R). Stress T is conjugate to E: the small-strain laws are used unchanged,
and stress power is T : dE. The Cauchy stress is F S F' / (J lambda) with S = 2 T : dE/dC and the
stretch lambda across the plane.

Functions v = (s, d, o, u/R) of the displacements have the derivatives Q g, with g the gradients of
the undeformed body and Q linear in F. So B = P Q g with P = dE/dv, and the geometric term is
``g' (Q' K Q + S) g`` with K the second derivative of T : E by v.

Elements with mean dilatation have the mean of tr E = ln J, so that stress is conjugate to it with
its mean pressure. At small strain this is B-bar.

C. Miehe, N. Apel, M. Lambrecht, Comput. Methods Appl. Mech. Engrg 191 (2002) 5383-5425.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from solver.fem.deformation import Deformation, Some, mean_dilatation
from solver.tensors import SQRT2
from solver.typing import Array, Bools, Ints

_NEAR, _TERMS = 0.05, 15
"""Ratio q up to which h is a power series, with this number of terms; principal strains differ by
0.22 there. The first term left out is below 1e-20."""


def _shape(q: Array, s: Array, J: Array) -> tuple[Array, Array, Array]:
    """Return h(q) and its first two derivatives; (1 - q) s^2 = J^2."""
    near = q < _NEAR
    small, k = np.where(near, q, 0.0), np.arange(_TERMS, dtype=float)
    each = 1 / (2 * k + 1)
    h, h1, h2 = (
        np.polynomial.polynomial.polyval(small, c)
        for c in (each, (each * k)[1:], (each * k * (k - 1))[2:])
    )
    if near.all():
        return h, h1, h2
    far = ~near
    root, rest = np.sqrt(q[far]), (s[far] / J[far]) ** 2
    h[far] = np.log(s[far] * (1 + root) / J[far]) / root
    h1[far] = (rest - h[far]) / (2 * q[far])
    h2[far] = (rest**2 - 3 * h1[far]) / (2 * q[far])
    return h, h1, h2


@dataclass(frozen=True, slots=True, eq=False)
class _Stretch:
    """The logarithmic strain of points, as functions of F and of the hoop stretch, shape (...).

    ``wider`` and ``grown`` are the hoop stretch and det F less 1: of small strains their logarithms
    would keep only the digits that 1 leaves.

    Points that are inverted, det F <= 0, have NaN: C does not distinguish them.
    """

    F: Array
    hoop: Array
    wider: Array
    grown: Array
    s: Array
    d: Array
    o: Array
    J: Array
    phi: Array
    phi1: Array
    phi2: Array

    @classmethod
    def of(cls, H: Array) -> _Stretch:
        """Return the stretch for displacement gradients (5, ...): xx, xy, yx, yy, hoop."""
        xx, xy, yx, yy, hoop = H
        a, b = 2 * xx + xx**2 + yx**2, 2 * yy + yy**2 + xy**2
        s, d, o = 1 + (a + b) / 2, (a - b) / 2, xy + yx + xx * xy + yx * yy
        grown = xx + yy + xx * yy - xy * yx
        grown = np.where((grown > -1) & (hoop > -1), grown, np.nan)
        J = 1 + grown
        h, h1, h2 = _shape((d**2 + o**2) / s**2, s, J)
        F = np.array([1 + xx, xy, yx, 1 + yy])
        phi = h / (2 * s), h1 / (2 * s**3), h2 / (2 * s**5)
        return cls(F, 1 + hoop, hoop, grown, s, d, o, J, *phi)

    def strain(self) -> Array:
        """Return the Mandel strain (4, ...)."""
        m, phi = np.log1p(self.grown) / 2, self.phi
        dev = phi * self.d
        return np.array([m + dev, m - dev, np.log1p(self.wider), SQRT2 * phi * self.o])

    def by_functions(self) -> Array:
        """Return P = dE/dv (4, 4, ...), Mandel components first."""
        d, o, phi, phi1, D = self.d, self.o, self.phi, self.phi1, self.J**2
        P = np.zeros((4, 4, *d.shape))
        mean = np.array([self.s, -d, -o]) / (2 * D)
        turned = 2 * d * o * phi1
        dev = np.array([-d / (2 * D), phi + 2 * d**2 * phi1, turned])
        P[0, :3], P[1, :3] = mean + dev, mean - dev
        P[3, :3] = SQRT2 * np.array([-o / (2 * D), turned, phi + 2 * o**2 * phi1])
        P[2, 3] = 1 / self.hoop
        return P

    def by_gradient(self) -> Array:
        """Return Q = dv/dH (4, 5, ...)."""
        xx, xy, yx, yy = self.F
        zero = np.zeros_like(xx)
        return np.array([
            [xx, xy, yx, yy, zero],
            [xx, -xy, yx, -yy, zero],
            [xy, xx, yy, yx, zero],
            [zero, zero, zero, zero, zero + 1],
        ])  # fmt: skip

    def curvature(self, T: Array) -> Array:
        """Return the second derivative of T : E by v (4, 4, ...), T (4, ...) Mandel [MPa]."""
        s, d, o, D, phi1 = self.s, self.d, self.o, self.J**2, self.phi1
        sum_, diff, shear = T[0] + T[1], T[0] - T[1], SQRT2 * T[3]
        p, rho = diff * d + shear * o, d**2 + o**2
        k = -sum_ / (4 * D**2) + p * self.phi2
        g = 2 * (-sum_ / (4 * D) + p * phi1)
        along = (sum_ * s - p) / D**2
        K = np.zeros((4, 4, *s.shape))
        K[0, 0] = -sum_ * (s**2 + rho) / (2 * D**2) + p * s / D**2
        K[0, 1] = K[1, 0] = d * along - diff / (2 * D)
        K[0, 2] = K[2, 0] = o * along - shear / (2 * D)
        K[1, 1] = g + 4 * d**2 * k + 4 * diff * d * phi1
        K[2, 2] = g + 4 * o**2 * k + 4 * shear * o * phi1
        K[1, 2] = K[2, 1] = 4 * d * o * k + 2 * (diff * o + shear * d) * phi1
        K[3, 3] = -T[2] / self.hoop**2
        return K

    def material_stress(self, T: Array) -> Array:
        """Return S xx, yy, xy (3, ...) in the plane for T (4, ...) [MPa]."""
        by_s, by_d, by_o, _ = np.einsum("av...,a...->v...", self.by_functions(), T)
        return np.array([by_s + by_d, by_s - by_d, by_o])

    def cauchy(self, T: Array, across: Array) -> Array:
        """Return the Cauchy stress (4, ...) with the stretch ``across`` the plane [MPa]."""
        xx, xy, yx, yy = self.F
        a, b, c = self.material_stress(T)
        one, other = (a * xx + c * xy, c * xx + b * xy), (a * yx + c * yy, c * yx + b * yy)
        plane = (one[0] * xx + one[1] * xy, other[0] * yx + other[1] * yy)
        shear = one[0] * yx + one[1] * yy
        return np.asarray(np.array([*plane, T[2], SQRT2 * shear]) / (self.J * across))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LogDeformation(Deformation):
    """A body at its displacements, with logarithmic strain.

    Attributes
    ----------
    gradients : (n_elements, n_points, 4 or 5, m) derivative of xx, xy, yx, yy (, hoop) of the
        displacement gradient by the unknowns [1/mm]
    stretch : functions of F at the points (n_elements, n_points)
    mean : whether the volumetric strain is the mean over each element
    """

    gradients: Array
    stretch: _Stretch
    mean: bool

    @property
    def linear(self) -> Bools:
        """See `Deformation`."""
        return np.array(False)

    @classmethod
    def of(
        cls, n: int, dofs: Ints, gradients: Array, weights: Array, u: Array, *, mean: bool
    ) -> Self:
        """Return a body at displacements u (n,) [mm]; strain is NaN at inverted points."""
        rows = gradients.shape[2]
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            stretch = _Stretch.of(_at_points(gradients, u[dofs]))
            along = np.einsum("av...,vi...->...ai", stretch.by_functions(), stretch.by_gradient())
            E = stretch.strain()
        B = np.matmul(along[..., :rows], gradients)
        if mean:
            B = mean_dilatation(B, weights)
            trace = E[:3].sum(axis=0)
            average = (trace * weights).sum(axis=1) / weights.sum(axis=1)
            E[:3] += (average[:, None] - trace) / 3
        return cls(
            n=n, dofs=dofs, strain=E.reshape(4, -1), B=B, weights=weights, gradients=gradients,
            stretch=stretch, mean=mean,
        )  # fmt: skip

    def within(self, elements: Bools, dofs: Ints, n: int) -> LogDeformation:
        """See `Deformation`."""
        g, weights = self.gradients[elements], self.weights[elements]
        return self.of(n, dofs, g, weights, np.zeros(n), mean=self.mean)

    def at(self, u: Array) -> Self:
        """See `Deformation`."""
        return self.of(self.n, self.dofs, self.gradients, self.weights, u, mean=self.mean)

    def _conjugate(self, stress: Array) -> Array:
        """Return the stress (4, n_elements, n_points) that is conjugate to E at each point."""
        T = stress.reshape(4, *self.weights.shape)
        if not self.mean:
            return T
        pressure, T = T[:3].mean(axis=0), T.copy()
        mean = (pressure * self.weights).sum(axis=1) / self.weights.sum(axis=1)
        T[:3] += mean[:, None] - pressure
        return T

    def _geometric(self, stress: Array) -> Array:
        """Return the derivative (5, 5, n_elements, n_points) of forces by gradients, B constant."""
        T, Q = self._conjugate(stress), self.stretch.by_gradient()
        half = np.einsum("vw...,wj...->vj...", self.stretch.curvature(T), Q)
        K = np.einsum("vi...,vj...->ij...", Q, half)
        xx, yy, xy = self.stretch.material_stress(T)
        for row in (0, 2):
            K[row, row] += xx
            K[row + 1, row + 1] += yy
            K[row, row + 1] += xy
            K[row + 1, row] += xy
        return K

    def stiffness(self, elements: Some, tangent: Array, stress: Array | None = None) -> Array:
        """See `Deformation`; the geometric term needs ``stress``."""
        stiffness = Deformation.stiffness(self, elements, tangent)
        if stress is None:
            return stiffness
        g = self.gradients[elements]
        K = np.moveaxis(self._geometric(stress)[:, :, elements], (0, 1), (2, 3))[..., : g.shape[2]]
        K = K[:, :, : g.shape[2]] * self.weights[elements][:, :, None, None]
        flat = g.reshape(len(g), -1, g.shape[-1])
        added = np.matmul(flat.swapaxes(1, 2), np.matmul(K, g).reshape(flat.shape))
        return np.asarray(stiffness + added)

    def geometric_energy(self, step: Array, stress: Array) -> float:
        """See `Deformation`."""
        H = _at_points(self.gradients, step[self.dofs])
        force = np.einsum("ijep,jep->iep", self._geometric(stress), H)
        return float(((H * force).sum(axis=0) * self.weights).sum())

    def cauchy(self, stress: Array, across: Array) -> Array:
        """See `Deformation`."""
        own = self.stretch.hoop * np.exp(across.reshape(self.weights.shape))
        return self.stretch.cauchy(self._conjugate(stress), own).reshape(4, -1)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RegionDeformation(Deformation):
    """A body at its displacements, with logarithmic strain in a region and small strain elsewhere.

    ``B`` is that of small strain in all elements.

    Attributes
    ----------
    log : the elements of the region
    region : (k,) their numbers
    """

    log: LogDeformation
    region: Ints

    @classmethod
    def joined(cls, small: Deformation, log: LogDeformation, region: Ints) -> Self:
        """Return a body before loading, given all elements with small strain, and the region."""
        return cls(
            n=small.n, dofs=small.dofs, strain=small.strain, B=small.B, weights=small.weights,
            log=log, region=region,
        )  # fmt: skip

    @property
    def linear(self) -> Bools:
        """See `Deformation`."""
        linear = np.ones(self.weights.shape, dtype=bool)
        linear[self.region] = False
        return linear.ravel()

    def _inside(self, values: Array) -> Array:
        """Return values (c, n_points) at the points of the region."""
        each = values.reshape(len(values), *self.weights.shape)[:, self.region]
        return np.asarray(each.reshape(len(values), -1))

    def _with(self, values: Array, inside: Array | float) -> Array:
        """Return values (c, n_points), with others ``inside`` the region."""
        out = values.copy()
        shape = len(values), len(self.region), self.weights.shape[1]
        out.reshape(len(values), *self.weights.shape)[:, self.region] = (
            inside if isinstance(inside, float) else inside.reshape(shape)
        )
        return out

    def within(self, elements: Bools, dofs: Ints, n: int) -> RegionDeformation:
        """See `Deformation`; the elements contain the region."""
        region = (np.cumsum(elements) - 1)[self.region]
        log = self.log.within(np.ones(len(region), dtype=bool), dofs[region], n)
        return self.joined(Deformation.within(self, elements, dofs, n), log, region)

    def at(self, u: Array) -> Self:
        """See `Deformation`."""
        log = self.log.at(u)
        return replace(self, log=log, strain=self._with(Deformation.change(self, u), log.strain))

    def change(self, step: Array) -> Array:
        """See `Deformation`."""
        return self._with(Deformation.change(self, step), self.log.change(step))

    def internal_force(self, stress: Array) -> Array:
        """See `Deformation`."""
        outside = Deformation.internal_force(self, self._with(stress, 0.0))
        return outside + self.log.internal_force(self._inside(stress))

    def stiffness(self, elements: Some, tangent: Array, stress: Array | None = None) -> Array:
        """See `Deformation`; the geometric term needs ``stress``."""
        if stress is None:
            return Deformation.stiffness(self, elements, tangent)
        number = np.full(len(self.B), -1)
        number[self.region] = np.arange(len(self.region))
        elements, own = np.arange(len(self.B))[elements], number[elements]
        K, large = np.empty((len(own), *self.dofs.shape[1:] * 2)), own >= 0
        K[~large] = Deformation.stiffness(self, elements[~large], tangent[~large])
        K[large] = self.log.stiffness(own[large], tangent[large], self._inside(stress))
        return K

    def geometric_energy(self, step: Array, stress: Array) -> float:
        """See `Deformation`."""
        return self.log.geometric_energy(step, self._inside(stress))

    def cauchy(self, stress: Array, across: Array) -> Array:
        """See `Deformation`."""
        own = self.log.cauchy(self._inside(stress), self._inside(across[None])[0])
        return self._with(stress, own)


def _at_points(gradients: Array, u: Array) -> Array:
    """Return displacement gradients (5, n_elements, n_points) for displacements (n_elements, m)."""
    elements, points, rows, m = gradients.shape
    H = np.zeros((5, elements, points))
    flat = np.matmul(gradients.reshape(elements, points * rows, m), u[:, :, None])
    H[:rows] = np.moveaxis(flat.reshape(elements, points, rows), 2, 0)
    return H


def gradient_operator(values: Array, gradients: Array, radius: Array, kinematics: str) -> Array:
    """Return the rows of displacement gradients by nodal displacements [1/mm].

    Parameters are those of `deformation.strain_operator`, in two dimensions; the result is
    (n_elements, n_points, 4 or 5, 2 n_nodes), rows xx, xy, yx, yy and, with an axis, hoop.
    """
    n_nodes, n_elements, n_points = values.shape
    round_axis = kinematics == "axisymmetric"
    g = np.zeros((n_elements, n_points, 4 + round_axis, n_nodes, 2))
    along = np.moveaxis(gradients, 1, -1)
    for row in range(4):
        g[:, :, row, :, row // 2] = along[row % 2]
    if round_axis:
        g[:, :, 4, :, 0] = np.moveaxis(values, 0, -1) / radius[..., None]
    return g.reshape(n_elements, n_points, 4 + round_axis, 2 * n_nodes)
