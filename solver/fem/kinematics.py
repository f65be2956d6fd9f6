"""Strain operators, B-bar and rigid motions of elements.

The number of dimensions is that of the arrays. Mandel components are xx, yy, zz, sqrt(2) xy, and in
three dimensions sqrt(2) yz and sqrt(2) zx.
"""

from __future__ import annotations

import numpy as np

from solver.tensors import SQRT2
from solver.typing import Array

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
