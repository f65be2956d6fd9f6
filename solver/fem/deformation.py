"""The strain of a body at its displacements, and nodal forces and stiffness from stress.

With the Mandel strain E at the points, its derivative B with respect to displacements and the
volume w of the points, a stress S has the nodal forces ``sum w B' S``. Their derivative is
``sum w B' D B``, with the tangent D of the law, plus a geometric term, the change of B at constant
S. For small strain B is constant and this term is zero; `log_strain` has large strain.

The number of dimensions is that of the arrays. Mandel components are xx, yy, zz, sqrt(2) xy, and in
three dimensions sqrt(2) yz and sqrt(2) zx.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np

from solver.materials.state import Response
from solver.tensors import SQRT2
from solver.typing import Array, Bools, Ints

Some = Ints | slice
"""Numbers of elements, or a slice of all."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Deformation:
    """A body at its displacements.

    Attributes
    ----------
    n : number of unknowns
    dofs : (n_elements, m) unknowns of the elements
    strain : (n_components, n_points) Mandel strain
    B : (n_elements, n_points, n_components, m) derivative of the strain by the unknowns [1/mm]
    weights : (n_elements, n_points) volume of the points [mm3]
    """

    n: int
    dofs: Ints
    strain: Array
    B: Array
    weights: Array

    @property
    def linear(self) -> Bools:
        """Whether strain is linear in displacements, at all points () or at each (n_points,)."""
        return np.array(True)

    @staticmethod
    def small(n: int, dofs: Ints, B: Array, weights: Array) -> Deformation:
        """Return a body of small strain before loading."""
        at_rest = np.zeros((B.shape[2], weights.size))
        return Deformation(n=n, dofs=dofs, strain=at_rest, B=B, weights=weights)

    def within(self, elements: Bools, dofs: Ints, n: int) -> Deformation:
        """Return some elements (n_elements,) before loading; ``dofs`` are theirs, of n unknowns."""
        return self.small(n, dofs, self.B[elements], self.weights[elements])

    @property
    def _flat(self) -> Array:
        elements, points, components, unknowns = self.B.shape
        return self.B.reshape(elements, points * components, unknowns)

    def at(self, u: Array) -> Self:
        """Return the body at other displacements (n,) [mm]; for small strain only strain changes.

        Another measure of strain overrides it.
        """
        return replace(self, strain=self.change(u))

    def change(self, step: Array) -> Array:
        """Return the change of strain (n_components, n_points) of a small displacement (n,)."""
        flat = np.matmul(self._flat, step[self.dofs][:, :, None])
        return np.asarray(flat.reshape(-1, self.B.shape[2]).T)

    def internal_force(self, stress: Array) -> Array:
        """Return nodal forces (n,) that balance ``stress`` (n_components, n_points) [N]."""
        weighted = (stress * self.weights.ravel()).T.reshape(len(self.B), 1, -1)
        forces = np.matmul(weighted, self._flat)[:, 0]
        nodal = np.bincount(self.dofs.ravel(), weights=forces.ravel(), minlength=self.n)
        return np.asarray(nodal, dtype=float)

    def stiffness(self, elements: Some, tangent: Array, stress: Array | None = None) -> Array:
        """Return the stiffness (k, m, m) of some elements [N/mm].

        Parameters
        ----------
        tangent : (k or 1, n_points_of_one or 1, n_components, n_components) [MPa]
        stress : (n_components, n_points) [MPa]; without it there is no geometric term
        """
        B = self.B[elements]
        DB = np.matmul(tangent, B) * self.weights[elements][:, :, None, None]
        flat = B.reshape(len(B), B.shape[1] * B.shape[2], B.shape[3])
        return np.asarray(np.matmul(flat.swapaxes(1, 2), DB.reshape(flat.shape)))

    def geometric_energy(self, step: Array, stress: Array) -> float:
        """Return twice the energy of a small displacement (n,) in the geometric term [N mm]."""
        return 0.0

    def cauchy(self, stress: Array, across: Array) -> Array:
        """Return the true stress (n_components, n_points) of ``stress``, in space [MPa].

        ``across`` (n_points,) is the strain across the plane that the displacements do not give:
        in plane stress that of the thickness, else zero.
        """
        return stress


class PartResponse(NamedTuple):
    """The response of the law of a part to its strain, and the part at its displacements.

    ``place`` are displacements (n,) and time, which loads that follow the part need.
    """

    law: Response
    deformation: Deformation
    place: tuple[Array, float] = (np.zeros(0), 0.0)

    @property
    def linear(self) -> Bools:
        """Whether the stiffness of the points (n_points,) is the elastic one before loading."""
        return ~self.law.yielding & self.deformation.linear


_SHEARS = ((0, 1), (1, 2), (2, 0))
"""Axes of the shear components xy, yz, zx."""


def strain_operator(
    values: Array,
    gradients: Array,
    radius: Array,
    kinematics: str,
) -> Array:
    """Return B: Mandel strain at the points of elements per nodal displacement [1/mm].

    Parameters
    ----------
    values : (n_nodes, n_elements, n_points) shape functions
    gradients : (dim, n_nodes, n_elements, n_points) their global derivatives [1/mm]
    radius : (n_elements, n_points) first coordinate of the points [mm]
    kinematics : see `solver.model.loads.Kinematics`; not read in three dimensions

    Returns
    -------
    (n_elements, n_points, 4 or 6, dim n_nodes), unknowns ordered node by node (x, y or x, y, z).
    """
    n_nodes, n_elements, n_points = values.shape
    dim = len(gradients)
    shears = _SHEARS[: 1 if dim == 2 else 3]
    B = np.zeros((n_elements, n_points, 3 + len(shears), n_nodes, dim))
    along = np.moveaxis(gradients, 1, -1)
    for axis in range(dim):
        B[:, :, axis, :, axis] = along[axis]
    for row, (a, b) in enumerate(shears, start=3):
        B[:, :, row, :, a] = along[b] / SQRT2
        B[:, :, row, :, b] = along[a] / SQRT2
    if dim == 2 and kinematics == "axisymmetric":
        B[:, :, 2, :, 0] = np.moveaxis(values, 0, -1) / radius[..., None]
    return B.reshape(n_elements, n_points, 3 + len(shears), dim * n_nodes)


def mean_dilatation(B: Array, weights: Array) -> Array:
    """Return B with its volumetric part averaged over each element (B-bar).

    It removes the locking of fully integrated linear elements in isochoric plastic flow: T.J.R.
    Hughes, The Finite Element Method (1987), section 4.5.
    """
    trace = B[:, :, :3].sum(axis=2)
    mean = (weights[..., None] * trace).sum(axis=1) / weights.sum(axis=1)[:, None]
    bar = B.copy()
    bar[:, :, :3] += ((mean[:, None] - trace) / 3.0)[:, :, None]
    return bar


def rigid_motions(x: Array, kinematics: str) -> Array:
    """Return the rigid motions of nodes ``x`` (dim, n_nodes) as columns (dim n_nodes, n_rigid).

    Translations along the axes, then rotations about the centroid, scaled to unit size: in the
    plane xy, in three dimensions also in yz and zx. An axisymmetric body has only the translation
    along its axis.
    """
    dim, n = x.shape
    planes = _SHEARS[: 1 if dim == 2 else 3]
    modes = np.zeros((n, dim, dim + len(planes)))
    for axis in range(dim):
        modes[:, axis, axis] = 1.0
    arm = x - x.mean(axis=1, keepdims=True)
    arm /= np.abs(arm).max()
    for mode, (a, b) in enumerate(planes, start=dim):
        modes[:, a, mode] = -arm[b]
        modes[:, b, mode] = arm[a]
    flat = modes.reshape(dim * n, dim + len(planes))
    return flat[:, 1:2] if dim == 2 and kinematics == "axisymmetric" else flat
