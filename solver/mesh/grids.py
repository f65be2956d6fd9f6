"""Graded tensor grids and meshes mapped from them.

A body takes any scikit-fem mesh with named boundaries, also one read with ``skfem.Mesh.load``
(meshio).
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from solver.errors import ModelError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray
    from skfem import Mesh, MeshQuad2


_MOST = 1_000_000
"""Elements that a line may be divided into."""
_SAME = 1e-9
"""Ratio of the distance to the size of a mesh, below which corners are merged."""


def graded(length: float, smallest: float, ratio: float, largest: float) -> NDArray[np.float64]:
    """Return node positions from 0 to ``length``, growing geometrically from ``smallest``.

    Element sizes are smallest, smallest * ratio, ... up to ``largest``; all are then scaled by
    the one factor (below 1) that makes them fill ``length`` exactly, so the first one is never
    larger than asked for.
    """
    if not 0 < smallest <= length:
        raise ModelError("smallest", smallest, f"must be in (0, {length:g}] [mm]")
    if not ratio >= 1:
        raise ModelError("ratio", ratio, "must be at least 1")
    sizes: list[float] = []
    total, size = 0.0, smallest
    while total < length * (1 - 1e-9):
        if len(sizes) == _MOST:
            allowed = f"must make at most {_MOST} elements along {length:g} mm"
            raise ModelError("size", smallest, allowed)
        sizes.append(min(size, max(largest, smallest)))
        total += sizes[-1]
        size *= ratio
    nodes = np.concatenate([[0.0], np.cumsum(sizes)])
    return np.asarray(nodes * (length / nodes[-1]))


def cells(length: float, smallest: float, ratio: float, largest: float) -> NDArray[np.float64]:
    """Return the middles of what `graded` divides ``length`` into, which no boundary meets."""
    nodes = graded(length, smallest, ratio, largest)
    return (nodes[1:] + nodes[:-1]) / 2


def closer(start: float, stop: float, num: int, near: float, size: float) -> NDArray[np.float64]:
    """Return points from ``start`` to ``stop``, ``size`` apart at ``near``, farther away from it.

    The distances are those of a hyperbolic sine: equal close to ``near``, then in a constant
    ratio. Points that are ``size`` apart or closer when spread evenly are spread evenly.

    Parameters
    ----------
    near : between start and stop [mm]
    size : distance of points at ``near`` [mm]

    Raises
    ------
    ModelError
        for ``size``, where neighbouring distances would differ by more than a factor of two
    """
    if (stop - start) / (num - 1) <= size:
        return np.linspace(start, stop, num)
    sides = np.array([start - near, stop - near])

    def needed(growth: float) -> float:
        """Return the number of steps of a growth (logarithm of the ratio) that fill the length."""
        return float(np.ptp(np.arcsinh(sides * growth / size))) / growth

    low, high = 0.0, math.log(2)
    if needed(high) > num - 1:
        raise ModelError(
            "size", size, f"is too small for {num} points: take more, or a larger size"
        )
    while high - low > 1e-15:
        middle = (low + high) / 2
        low, high = (middle, high) if needed(middle) > num - 1 else (low, middle)
    first, last = np.arcsinh(sides * high / size)
    points = near + size / high * np.sinh(np.linspace(first, last, num))
    points[[0, -1]] = start, stop
    return np.asarray(points)


def refined(
    points: Sequence[float], sizes: Sequence[float], ratio: float, largest: Sequence[float]
) -> NDArray[np.float64]:
    """Return node positions through ``points``, elements growing away from each by ``ratio``.

    Between two points the elements grow from both, and meet where they are equally large.

    Parameters
    ----------
    points : (n,) increasing positions, each a node [mm]
    sizes : (n,) largest element beside each of them; inf leaves it to the others [mm]
    ratio : of neighbouring element sides, above 1
    largest : (n - 1,) largest element between neighbours [mm]
    """
    if not ratio > 1:
        raise ModelError("ratio", ratio, "must be above 1")
    pieces = [np.array([points[0]], dtype=float)]
    spans = zip(pairwise(points), pairwise(sizes), largest, strict=True)
    for (start, end), (first, last), most in spans:
        length = end - start
        ahead = _meeting(length, first, last, ratio)
        if ahead > 0:
            pieces.append(start + graded(ahead, min(first, most, ahead), ratio, most)[1:])
        if ahead < length:
            back = length - ahead
            pieces.append(end - graded(back, min(last, most, back), ratio, most)[-2::-1])
    return np.concatenate(pieces)


def _meeting(length: float, first: float, last: float, ratio: float) -> float:
    """Return how far from the first end elements that grow from both ends are equally large.

    Where a side grows by the ratio, it grows by ``ratio - 1`` for each unit of length.
    """
    if math.isinf(last):
        return length if math.isfinite(first) else 0.0
    return min(max((length + (last - first) / (ratio - 1)) / 2, 0.0), length)


def grid(x: NDArray[np.float64], y: NDArray[np.float64], cells: str = "quad") -> Mesh:
    """Return the tensor grid with boundaries ``left``, ``right``, ``bottom``, ``top``."""
    from skfem import MeshQuad, MeshTri  # a third of a second to import, and `graded` needs none

    make = MeshTri if cells == "tri" else MeshQuad
    mesh = make.init_tensor(np.asarray(x, float), np.asarray(y, float))
    tolerance = 1e-9 * max(np.ptp(x), np.ptp(y))
    sides = {
        "left": (0, np.min(x)),
        "right": (0, np.max(x)),
        "bottom": (1, np.min(y)),
        "top": (1, np.max(y)),
    }
    return mesh.with_boundaries(
        {
            name: lambda m, axis=axis, value=value: np.abs(m[axis] - value) < tolerance
            for name, (axis, value) in sides.items()
        }
    )


def with_middle(mesh: Mesh, name: str, half: float) -> Mesh:
    """Return a grid with a name for its top where the first coordinate is within ``half``."""
    top = np.asarray(mesh.boundaries["top"])
    middle = mesh.p[0, mesh.facets[:, top]].mean(axis=0)
    return mesh.with_boundaries({name: top[np.abs(middle) < half]})


def mapped(mesh: Mesh, function: Callable[[NDArray[np.float64]], NDArray[np.float64]]) -> Mesh:
    """Return a quadrilateral mesh with curved quadratic edges, its points moved by ``function``.

    ``function`` takes and returns coordinates (2, n); boundary names are kept. It must keep
    orientation.
    """
    from skfem import MeshQuad2

    curved = MeshQuad2.from_mesh(mesh)
    moved = MeshQuad2(
        doflocs=np.asarray(function(curved.doflocs)), t=curved.t, sort_t=False, validate=False
    )
    return moved.with_boundaries(dict(mesh.boundaries or {}))


def merged(mesh: MeshQuad2) -> MeshQuad2:
    """Return the mesh with coincident corners merged; boundary names are kept.

    A grid bent until its ends meet becomes a closed ring: its ends are no boundary any more.
    """
    from scipy.spatial import cKDTree
    from skfem import MeshQuad, MeshQuad2

    corners = mesh.p[:, : mesh.nvertices]
    tolerance = _SAME * float(np.ptp(corners, axis=1).max())
    first = np.arange(mesh.nvertices)
    pairs = cKDTree(corners.T).query_pairs(tolerance, output_type="ndarray")
    np.minimum.at(first, pairs.max(axis=1), pairs.min(axis=1))
    kept, number = np.unique(first, return_inverse=True)
    straight = MeshQuad(np.ascontiguousarray(corners[:, kept]), number[mesh.t], sort_t=False)
    ring = MeshQuad2.from_mesh(straight)
    nodes = ring.doflocs.copy()
    nodes[:, ring.dofs.element_dofs] = mesh.doflocs[:, mesh.dofs.element_dofs]
    ring = MeshQuad2(doflocs=nodes, t=ring.t, sort_t=False, validate=False)
    facets = {frozenset(ends): k for k, ends in enumerate(ring.facets.T.tolist())}

    def renumbered(which: NDArray[np.int64]) -> NDArray[np.int64]:
        found = [facets[frozenset(ends)] for ends in number[mesh.facets[:, which]].T.tolist()]
        return np.intersect1d(found, ring.boundary_facets())

    names = mesh.boundaries or {}
    return ring.with_boundaries({name: renumbered(which) for name, which in names.items()})
