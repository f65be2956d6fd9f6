"""Tensor grids, and operations on meshes: map, join, remove cells, name boundaries.

A body takes any scikit-fem mesh with named boundaries, also one of `studies.scenes.meshfile`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence, Sized
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import scipy
from skfem import Mesh, MeshQuad, MeshQuad2, MeshTri

from solver.errors import ModelError
from solver.mesh.elements import element_type
from solver.mesh.rounding import ROUNDED, in_box
from solver.typing import Array, Ints

_SAME = 1e-9
"""Distance of two places over the size of the mesh: they are the same below this ratio."""


def grid(x: Array, y: Array, cells: str = "quad") -> Mesh:
    """Return the tensor grid with boundaries ``left``, ``right``, ``bottom``, ``top``."""
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


class GridSize(NamedTuple):
    """Numbers of elements and nodes of a grid, and of nodes on one line along x and along y."""

    elements: int
    nodes: int
    along: int
    up: int


def grid_size(x: Sized, y: Sized, element: str) -> GridSize:
    """Return the size of `grid` for these lines, without making it."""
    kind, columns, rows = element_type(element), len(x) - 1, len(y) - 1
    at_corner, on_edge = kind.element.nodal_dofs, kind.element.facet_dofs
    rectangles, parts = columns * rows, 1 + (kind.cells == "tri")  # a diagonal cuts a rectangle
    edges = columns * (rows + 1) + rows * (columns + 1) + (parts - 1) * rectangles
    inside = kind.element.interior_dofs * parts * rectangles
    return GridSize(
        elements=parts * rectangles,
        nodes=at_corner * (columns + 1) * (rows + 1) + on_edge * edges + inside,
        along=at_corner * (columns + 1) + on_edge * columns,
        up=at_corner * (rows + 1) + on_edge * rows,
    )


def within(
    mesh: Mesh,
    name: str,
    of: Sequence[str],
    x: tuple[float, float] | None = None,
    y: tuple[float, float] | None = None,
) -> Mesh:
    """Return a mesh with a new boundary ``name``: the facets of other boundaries in a box.

    Parameters
    ----------
    of : the other boundaries
    x, y : limits of the box for the midpoints of the facets [mm]; None sets no limit

    Raises
    ------
    ModelError
        for ``of``, if the mesh has no such boundary; for ``name``, if the box has no facet
    """
    known = mesh.boundaries or {}
    for other in of:
        if other not in known:
            allowed = f"must name boundaries of the mesh: {', '.join(known) or 'it has none'}"
            raise ModelError(f"boundaries.{name}.of", other, allowed)
    facets = np.unique(np.concatenate([np.asarray(known[other]) for other in of]))
    size = float(np.ptp(mesh.p, axis=1).max())
    inside = in_box(mesh.p[:, mesh.facets[:, facets]].mean(axis=1), (x, y), size)
    if not inside.any():
        raise ModelError(f"boundaries.{name}", {"x": x, "y": y}, "has no facet in its box")
    return mesh.with_boundaries({name: facets[inside]})


def marked(
    mesh: Mesh,
    name: str,
    x: tuple[float, float] | None = None,
    y: tuple[float, float] | None = None,
) -> Mesh:
    """Return a mesh with a new region ``name``: the elements whose middles lie in a box.

    Parameters
    ----------
    x, y : limits of the box [mm]; None sets no limit

    Raises
    ------
    ModelError
        if the box has no element
    """
    size = float(np.ptp(mesh.p, axis=1).max())
    inside = np.flatnonzero(in_box(mesh.p[:, mesh.t].mean(axis=1), (x, y), size))
    if not len(inside):
        box = ", ".join(
            f"{a} = {span[0]:g} to {span[1]:g}"
            for a, span in zip("xy", (x, y), strict=True)
            if span
        )
        raise ModelError(f"regions.{name}", box, "has no element in its box")
    return replace(mesh, _subdomains={**(mesh.subdomains or {}), name: inside})


def renamed(mesh: Mesh, names: Mapping[str, str]) -> Mesh:
    """Return a mesh with only some of its boundaries, renamed; ``names`` is new -> old."""
    known = mesh.boundaries or {}
    return replace(mesh, _boundaries={new: known[old] for new, old in names.items()})


def without(mesh: Mesh, name: str, x: tuple[float, float], y: tuple[float, float]) -> Mesh:
    """Return a mesh without the cells in a rectangle; the new boundary is called ``name``.

    Other boundaries keep their remaining facets. A rectangle at the side of a body makes a notch, a
    rectangle inside makes a hole.

    Parameters
    ----------
    mesh : mesh of straight cells, with edges along the sides of the rectangle
    x, y : limits of the rectangle [mm]; it may extend beyond the body

    Raises
    ------
    ModelError
        if no cell lies inside, none outside, or a cell lies across a side
    """
    (low, high), corners = np.array([x, y], dtype=float).T[:, :, None], mesh.p[:, mesh.t]
    slack = ROUNDED * float(np.ptp(mesh.p, axis=1).max())
    least, most = corners.min(axis=1), corners.max(axis=1)
    inside = ((least > low - slack) & (most < high + slack)).all(axis=0)
    touched = ((least < high - slack) & (most > low + slack)).all(axis=0)
    rectangle = f"x {x[0]:g} to {x[1]:g}, y {y[0]:g} to {y[1]:g}"
    if (touched & ~inside).any():
        raise ModelError(name, rectangle, "must have its sides along lines of the mesh")
    if inside.all() or not inside.any():
        raise ModelError(name, rectangle, "must hold some cells of the mesh, and leave some")
    kept = np.flatnonzero(~inside)
    facets = np.unique(mesh.t2f[:, kept])  # in the order in which the new mesh numbers them
    one, other = mesh.f2t[:, facets]
    opened = (other >= 0) & (inside[one] != inside[other])
    return mesh.restrict(kept).with_boundaries({name: np.flatnonzero(opened)})


def mapped(mesh: Mesh, function: Callable[[Array], Array]) -> Mesh:
    """Return a mesh of curved quadrilaterals, with points moved by ``function``, (2, n) -> (2, n).

    The function must preserve orientation. Boundary names are kept.
    """
    curved = MeshQuad2.from_mesh(mesh)
    moved = MeshQuad2(
        doflocs=np.asarray(function(curved.doflocs)), t=curved.t, sort_t=False, validate=False
    )
    return moved.with_boundaries(dict(mesh.boundaries or {}))


def merged(mesh: MeshQuad2) -> MeshQuad2:
    """Return the mesh with coincident corners merged; boundary names are kept.

    A grid bent until its ends coincide becomes a closed ring: its ends are no longer boundaries.
    """
    corners = mesh.p[:, : mesh.nvertices]
    tolerance = _SAME * float(np.ptp(corners, axis=1).max())
    first = np.arange(mesh.nvertices)
    pairs = scipy.spatial.cKDTree(corners.T).query_pairs(tolerance, output_type="ndarray")
    np.minimum.at(first, pairs.max(axis=1), pairs.min(axis=1))
    kept, number = np.unique(first, return_inverse=True)
    straight = MeshQuad(np.ascontiguousarray(corners[:, kept]), number[mesh.t], sort_t=False)
    ring = MeshQuad2.from_mesh(straight)
    nodes = ring.doflocs.copy()
    nodes[:, ring.dofs.element_dofs] = mesh.doflocs[:, mesh.dofs.element_dofs]
    ring = MeshQuad2(doflocs=nodes, t=ring.t, sort_t=False, validate=False)
    facets = {frozenset(ends): k for k, ends in enumerate(ring.facets.T.tolist())}

    def renumbered(which: Ints) -> Ints:
        found = [facets[frozenset(ends)] for ends in number[mesh.facets[:, which]].T.tolist()]
        return np.intersect1d(found, ring.boundary_facets())

    names = mesh.boundaries or {}
    return ring.with_boundaries({name: renumbered(which) for name, which in names.items()})


def joined(blocks: Sequence[MeshQuad2]) -> MeshQuad2:
    """Return one mesh of several, without boundaries; coincident nodes are merged."""
    corners = [block.p[:, : block.nvertices] for block in blocks]
    first = np.cumsum([0, *(c.shape[1] for c in corners)])
    cells = np.hstack([block.t + k for block, k in zip(blocks, first, strict=False)])
    whole = MeshQuad2.from_mesh(MeshQuad(np.hstack(corners), cells, sort_t=False))
    nodes = whole.doflocs.copy()
    own = np.dstack([block.doflocs[:, block.dofs.element_dofs] for block in blocks])
    nodes[:, whole.dofs.element_dofs] = own
    return merged(MeshQuad2(doflocs=nodes, t=whole.t, sort_t=False, validate=False))
