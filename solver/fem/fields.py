"""Values of fields at nodes and other places, from integration points."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from solver.errors import ModelError
from solver.fem.discretisation import Discretisation
from solver.fem.nodes import Nodes
from solver.fem.part import Part
from solver.materials.state import Response
from solver.memory import digest_of, remembered
from solver.mesh.rounding import ROUNDED
from solver.typing import Array, Ints

_INSIDE = 1e-7
_NEWTON_STEPS = 6
_EXACT = 1e-12
_KNOWN = 1e-9
"""Share of unknown points or nodes in a value: a smaller one is rounding."""


def _monomials(x: Array, count: int) -> Array:
    """Return the first ``count`` of 1, x, y, xy at points (2, n) as (n, count)."""
    return np.stack([np.ones_like(x[0]), x[0], x[1], x[0] * x[1]][:count], axis=-1)


def _check_plane(part: Nodes) -> None:
    """Refuse a body in space: it has values at its points alone."""
    if part.basis.mesh.dim() == 3:
        allowed = "has no fields at nodes and places yet, and so no maps and files: take those at "
        raise ModelError("element", part.body.element, allowed + "points, System.state")


def recovery(part: Nodes) -> sparse.csr_array:
    """Return the operator (n_nodes, n_points) that recovers nodal values from point values.

    In each element a (bi)linear field is fitted to the points by least squares and evaluated at the
    nodes; the value of a node is the mean over the elements around it, weighted by volume.
    """
    _check_plane(part)
    cells = part.basis.mesh.t.shape[0]
    n_elements, n_points = part.weights.shape
    count = 4 if cells == 4 and n_points >= 4 else 3 if n_points >= 3 else 1
    fit = np.linalg.pinv(_monomials(np.asarray(part.basis.X), count))
    at_nodes = _monomials(np.asarray(part.basis.elem.doflocs, dtype=float).T, count) @ fit
    nodes = part.basis.element_dofs
    volume = part.weights.sum(axis=1)
    n_nodes = part.X.shape[1]
    shares = np.broadcast_to(volume, nodes.shape).ravel()
    total = np.bincount(nodes.ravel(), weights=shares, minlength=n_nodes)
    share = volume / total[nodes]
    data = share[:, :, None] * at_nodes[:, None, :]
    rows = np.broadcast_to(nodes[:, :, None], data.shape)
    columns = np.arange(n_elements * n_points).reshape(n_elements, n_points)
    return sparse.csr_array(
        (data.ravel(), (rows.ravel(), np.broadcast_to(columns, data.shape).ravel())),
        shape=(n_nodes, n_elements * n_points),
    )


def recovered_beside(matrix: sparse.csr_array, points: Array) -> Array:
    """Return nodal values (..., n_nodes) of point values (..., n_points) by `recovery`.

    Elements whose points are NaN do not count; nodes of these elements alone are NaN.
    """
    unknown = np.isnan(points)
    found = np.asarray((matrix @ np.where(unknown, 0.0, points).T).T)
    if not unknown.any():
        return found
    known = np.asarray((matrix @ (~unknown).astype(float).T).T)
    return np.divide(found, known, out=np.full_like(found, np.nan), where=known > _KNOWN)


class Sampler:
    """Interpolates nodal fields of a body at given positions; NaN outside the body.

    Parameters
    ----------
    x : (2, n) positions before deformation [mm]

    Attributes
    ----------
    inside : (n,) whether a position is inside the body
    matrix : (n, n_nodes) from nodal values to those at the positions; zero outside
    """

    def __init__(self, part: Nodes, x: Array) -> None:
        _check_plane(part)
        element, point, local = _locate(part, np.asarray(x, dtype=float))
        shape = part.basis.elem.lbasis
        nodes = part.basis.element_dofs[:, element]
        values = np.array([shape(local, i)[0] for i in range(len(nodes))])
        self.inside = np.zeros(x.shape[1], dtype=bool)
        self.inside[point] = True
        self.matrix = sparse.csr_array(
            (values.ravel(), (np.broadcast_to(point, nodes.shape).ravel(), nodes.ravel())),
            shape=(x.shape[1], part.X.shape[1]),
        )

    def __call__(self, nodal: Array) -> Array:
        """Return values (..., n) of nodal fields (..., n_nodes)."""
        flat = np.atleast_2d(nodal).reshape(-1, nodal.shape[-1])
        unknown = np.isnan(flat)
        out = (self.matrix @ np.where(unknown, 0.0, flat).T).T
        if unknown.any():
            out[(abs(self.matrix) @ unknown.astype(float).T).T > _KNOWN] = np.nan
        out[:, ~self.inside] = np.nan
        return np.asarray(out.reshape(*nodal.shape[:-1], len(self.inside)))


def sampler(part: Nodes, x: Array) -> Sampler:
    """Return the `Sampler` at positions x (2, n), which all runs on equal meshes share."""
    key = type(part.basis.elem), digest_of(part.X, part.basis.element_dofs, x)
    return remembered(key, lambda: Sampler(part, x))


def _locate(part: Nodes, x: Array) -> tuple[Ints, Ints, Array]:
    """Return element, point number and reference coordinates of the points inside the body."""
    corners = part.X[:, part.basis.element_dofs]
    extent = np.ptp(corners, axis=1)
    slack = 1e-9 + 0.05 * extent
    low, high = corners.min(axis=1) - slack, corners.max(axis=1) + slack
    element, point = _within(low, high, x)
    if not len(element):
        return element, point, np.zeros((2, 0))
    local = _reference(part, element, x[:, point])
    if part.basis.mesh.t.shape[0] == 4:
        miss = np.abs(local - 0.5).max(axis=0) - 0.5
    else:
        miss = np.maximum(-local.min(axis=0), local.sum(axis=0) - 1.0)
    order = np.lexsort((miss, point))
    rounded = ROUNDED * np.ptp(part.X, axis=1).max() / extent.min(axis=0)  # over the side
    order = order[miss[order] < np.maximum(_INSIDE, rounded)[element[order]]]
    _, first_of = np.unique(point[order], return_index=True)
    best = order[first_of]
    return element[best], point[best], np.clip(local[:, best], 0.0, 1.0)


def _within(low: Array, high: Array, x: Array) -> tuple[Ints, Ints]:
    """Return box and point number of all points (2, n) in boxes with these corners (2, m)."""
    order = np.argsort(x[0], kind="stable")
    first = np.searchsorted(x[0, order], low[0], side="left")
    count = np.searchsorted(x[0, order], high[0], side="right") - first
    box = np.repeat(np.arange(len(count)), count)
    at = np.arange(len(box)) - np.repeat(np.cumsum(count) - count, count)
    point = order[first[box] + at]
    inside = (x[1, point] >= low[1, box]) & (x[1, point] <= high[1, box])
    return box[inside], point[inside]


def _reference(part: Nodes, element: Ints, x: Array) -> Array:
    """Return reference coordinates (2, n) of points in given elements by Newton's method."""
    mapping = part.basis.mapping
    local = np.full((2, len(element), 1), 0.5 if part.basis.mesh.t.shape[0] == 4 else 1 / 3)
    for _ in range(_NEWTON_STEPS):
        miss = x[:, :, None] - np.asarray(mapping.F(local, tind=element))
        (a, b), (c, d) = np.asarray(mapping.DF(local, tind=element))
        step = np.stack([d * miss[0] - b * miss[1], a * miss[1] - c * miss[0]]) / (a * d - b * c)
        local = np.clip(local + step, -2.0, 3.0)
        if np.abs(step).max() < _EXACT:  # in rectangles after the first step
            break
    return np.asarray(local[:, :, 0])


def elastic_energy(part: Part, u: Array, response: Response, time: float) -> float:
    """Return the elastic energy of a part [N mm], from stress or from its condensed stiffness."""
    if isinstance(part, Discretisation):
        law = part.law(time)
        return float(law.elasticity.energy_density(response.stress) / law.stiff @ part.volumes)
    return part.elastic_along(u) / 2
