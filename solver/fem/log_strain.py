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

from solver.fem.deformation import Deformation, Some
from solver.late import late
from solver.typing import Array, Bools, Ints

_strains, _geometric, _cauchy = late("fem.kernels", "strains", "geometric", "cauchy")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LogDeformation(Deformation):
    """A body at its displacements, with logarithmic strain.

    Attributes
    ----------
    gradients : (n_elements, n_points, 4 or 5, m) derivative of xx, xy, yx, yy (, hoop) of the
        displacement gradient by the unknowns [1/mm]
    moved : (n_elements, m) displacements of the elements [mm]
    mean : whether the volumetric strain is the mean over each element
    """

    gradients: Array
    moved: Array
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
        elements, points, _, m = gradients.shape
        E, B, moved = np.empty((4, elements, points)), np.empty((elements, points, 4, m)), u[dofs]
        _strains(gradients, moved, weights, mean, E, B)
        return cls(
            n=n, dofs=dofs, strain=E.reshape(4, -1), B=B, weights=weights, gradients=gradients,
            moved=moved, mean=mean,
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
            return np.ascontiguousarray(T)
        pressure, T = T[:3].mean(axis=0), T.copy()
        mean = (pressure * self.weights).sum(axis=1) / self.weights.sum(axis=1)
        T[:3] += mean[:, None] - pressure
        return T

    def _geometric(self, elements: Some, stress: Array) -> Array:
        """Return the geometric term (k, m, m) of the stiffness of some elements [N/mm]."""
        T = np.ascontiguousarray(self._conjugate(stress)[:, elements])
        g, moved, weights = (x[elements] for x in (self.gradients, self.moved, self.weights))
        K = np.zeros((len(g), *g.shape[-1:] * 2))
        _geometric(g, moved, weights, T, K)
        return K

    def stiffness(self, elements: Some, tangent: Array, stress: Array | None = None) -> Array:
        """See `Deformation`; the geometric term needs ``stress``."""
        stiffness = Deformation.stiffness(self, elements, tangent)
        return stiffness if stress is None else stiffness + self._geometric(elements, stress)

    def geometric_energy(self, step: Array, stress: Array) -> float:
        """See `Deformation`."""
        K, moved = self._geometric(slice(None), stress), step[self.dofs][:, :, None]
        return float((np.matmul(K, moved) * moved).sum())

    def cauchy(self, stress: Array, across: Array) -> Array:
        """See `Deformation`."""
        true = np.empty((4, *self.weights.shape))
        T, wide = self._conjugate(stress), np.exp(across.reshape(self.weights.shape))
        _cauchy(self.gradients, self.moved, T, wide, true)
        return true.reshape(4, -1)


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

    def _with(self, values: Array, inside: Array) -> Array:
        """Return values (c, n_points), with others ``inside`` the region."""
        out, count = values.copy(), len(values)
        shape = count, len(self.region), self.weights.shape[1]
        out.reshape(count, *self.weights.shape)[:, self.region] = inside.reshape(shape)
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
        inside = self._inside(stress)
        outside = Deformation.internal_force(self, self._with(stress, np.zeros_like(inside)))
        return outside + self.log.internal_force(inside)

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
