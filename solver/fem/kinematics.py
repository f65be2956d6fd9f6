"""From nodal displacements to strain: operators, B-bar, rigid motions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.tensors import SQRT2

if TYPE_CHECKING:
    from numpy.typing import NDArray


def strain_operator(
    values: NDArray[np.float64],
    gradients: NDArray[np.float64],
    radius: NDArray[np.float64],
    state: str,
) -> NDArray[np.float64]:
    """Return B: nodal displacements of an element to Mandel strain at its points.

    Parameters
    ----------
    values : (n_nodes, n_elements, n_points) shape functions
    gradients : (2, n_nodes, n_elements, n_points) their global derivatives [1/mm]
    radius : (n_elements, n_points) first coordinate of the points [mm]
    state : one of `solver.model.kinematics.STATES`

    Returns
    -------
    (n_elements, n_points, 4, 2 n_nodes), unknowns ordered node by node (x, y).
    """
    n_nodes, n_elements, n_points = values.shape
    B = np.zeros((n_elements, n_points, 4, n_nodes, 2))
    dx, dy = np.moveaxis(gradients, 1, -1)
    B[:, :, 0, :, 0] = dx
    B[:, :, 1, :, 1] = dy
    B[:, :, 3, :, 0] = dy / SQRT2
    B[:, :, 3, :, 1] = dx / SQRT2
    if state == "axisymmetric":
        B[:, :, 2, :, 0] = np.moveaxis(values, 0, -1) / radius[..., None]
    return B.reshape(n_elements, n_points, 4, 2 * n_nodes)


def mean_dilatation(B: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return B with its volumetric part averaged over each element (B-bar).

    T.J.R. Hughes, The Finite Element Method (1987), section 4.5: removes the locking of
    fully integrated linear elements in isochoric plastic flow.
    """
    trace = B[:, :, :3].sum(axis=2)
    mean = (weights[..., None] * trace).sum(axis=1) / weights.sum(axis=1)[:, None]
    bar = B.copy()
    bar[:, :, :3] += ((mean[:, None] - trace) / 3.0)[:, :, None]
    return bar


def rigid_motions(x: NDArray[np.float64], state: str) -> NDArray[np.float64]:
    """Return the rigid motions of nodes ``x`` (2, n_nodes) as columns (2 n_nodes, 3 or 1).

    Translations along x and y and the rotation about the centroid (scaled to unit size); in
    the axisymmetric state only the translation along the axis is rigid.
    """
    n = x.shape[1]
    modes = np.zeros((n, 2, 3))
    modes[:, 0, 0] = 1.0
    modes[:, 1, 1] = 1.0
    arm = x - x.mean(axis=1, keepdims=True)
    arm /= np.abs(arm).max()
    modes[:, 0, 2] = -arm[1]
    modes[:, 1, 2] = arm[0]
    flat = modes.reshape(2 * n, 3)
    return flat[:, 1:2] if state == "axisymmetric" else flat
