"""A mesh that is opened along a straight line of its edges: a crack."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from skfem import Mesh, MeshQuad, MeshQuad2, MeshTri, MeshTri2

from solver.errors import ModelError
from solver.mesh.rounding import ROUNDED
from solver.typing import Array, Bools, Ints

Point = tuple[float, float]
_QUARTER = 0.25


def faces_of(crack: str) -> tuple[str, str]:
    """Return the boundaries of a crack: left and right of one who walks from start to end."""
    return f"{crack}_left", f"{crack}_right"


def opened(mesh: Mesh, name: str, start: Point, end: Point) -> Mesh:
    """Return the mesh with a crack: nodes on the line from start to end are there twice.

    The faces are the boundaries of `faces_of`. An end inside the body is a tip. There the nodes
    within the sides of elements are moved to a quarter of their length: strain of quadratic
    elements then grows as 1/sqrt(r) towards the tip. The mesh is quadratic.

    Parameters
    ----------
    mesh : with edges along the whole line [mm]
    name : that of the crack
    start, end : ends of the line

    Raises
    ------
    ModelError
        if the line is not one of edges inside the body, or both ends lie on the outline but
        nothing in between

    References
    ----------
    R.S. Barsoum, Int. J. Numer. Methods Eng. 10 (1976) 25-37; R.D. Henshell, K.G. Shaw, ibid. 9
    (1975) 495-507: quarter-point elements.
    """
    corners = mesh.p[:, : mesh.nvertices]
    on, cut = _on_line(mesh, name, corners, np.array(start), np.array(end))
    outside = np.zeros(mesh.nvertices, dtype=bool)
    outside[mesh.facets[:, mesh.boundary_facets()]] = True
    count = np.bincount(mesh.facets[:, cut].ravel(), minlength=mesh.nvertices)
    tips = np.flatnonzero((count == 1) & ~outside)
    if not len(tips):
        raise ModelError(f"cracks.{name}", [start, end], "must have a tip, an end inside the body")
    along = np.array(end) - start
    middles = corners[:, mesh.t].mean(axis=1) - np.reshape(start, (2, 1))
    right = along[0] * middles[1] - along[1] * middles[0] < 0
    double = np.flatnonzero(on & (count > 0) & ~np.isin(np.arange(len(on)), tips))
    number = np.arange(mesh.nvertices)
    number[double] = mesh.nvertices + np.arange(len(double))
    t = np.where(_beyond(mesh, cut, double, right), number[mesh.t], mesh.t)
    plain, curved = (MeshQuad, MeshQuad2) if len(mesh.t) == 4 else (MeshTri, MeshTri2)
    straight = plain(np.hstack([corners, corners[:, double]]), t, sort_t=False)
    whole, before = curved.from_mesh(straight), mesh
    if len(before.dofs.element_dofs) == len(before.t):
        before = curved.from_mesh(mesh)
    nodes = whole.doflocs.copy()
    nodes[:, whole.dofs.element_dofs] = before.doflocs[:, before.dofs.element_dofs]
    _move_to_quarters(whole, nodes, tips)
    made = curved(doflocs=nodes, t=whole.t, sort_t=False, validate=False)
    facet = np.zeros(mesh.nfacets, dtype=int)
    facet[mesh.t2f] = made.t2f
    faces = [np.unique(made.t2f[np.isin(mesh.t2f, cut) & side]) for side in (~right, right)]
    old = {key: facet[np.asarray(own)] for key, own in (mesh.boundaries or {}).items()}
    made = made.with_boundaries({**old, **dict(zip(faces_of(name), faces, strict=True))})
    return replace(made, _subdomains=mesh.subdomains)


def _on_line(mesh: Mesh, name: str, corners: Array, start: Array, end: Array) -> tuple[Bools, Ints]:
    """Return which corners lie on a line (n_corners,), and the facets along it, which cover it."""
    length = float(np.hypot(*(end - start)))
    e = (end - start) / (length or 1.0)
    x, y = corners - start[:, None]
    slack = ROUNDED * float(np.ptp(corners, axis=1).max())
    s = x * e[0] + y * e[1]
    on = (np.abs(y * e[0] - x * e[1]) <= slack) & (s >= -slack) & (s <= length + slack)
    cut = np.flatnonzero(on[mesh.facets].all(axis=0) & (mesh.f2t[1] >= 0))
    covered = float(np.abs(np.diff(s[mesh.facets[:, cut]], axis=0)).sum())
    if not length or abs(covered - length) > slack * (len(cut) + 1):
        allowed = f"must run along edges inside the body, which cover {covered:g} of {length:g} mm"
        raise ModelError(f"cracks.{name}", [start.tolist(), end.tolist()], allowed)
    return np.asarray(on), cut


def _beyond(mesh: Mesh, cut: Ints, double: Ints, right: Bools) -> Bools:
    """Return which corners of elements (as ``mesh.t``) are at doubled vertices, on the right.

    Around each vertex one walks from element to element, not over cut facets: at a reentrant corner
    an element of the left side may be to the right of the whole line. Elements at cut facets are on
    their side of it: ``right`` (n_elements,).
    """
    n, corners = mesh.nvertices, np.isin(mesh.t, double)
    keys = (mesh.t + n * np.arange(mesh.nelements))[corners]
    order = np.argsort(keys)
    inner = np.setdiff1d(np.flatnonzero(mesh.f2t[1] >= 0), cut)
    one, other = (_corners(mesh, inner, side, double) for side in (0, 1))
    pairs = [order[np.searchsorted(keys, own, sorter=order)] for own in (one, other)]
    joined = coo_array((np.ones(len(one)), tuple(pairs)), shape=(len(keys), len(keys)))
    count, part = connected_components(joined, directed=False)
    first = [_corners(mesh, cut[right[mesh.f2t[side, cut]]], side, double) for side in (0, 1)]
    there = np.zeros(count, dtype=bool)
    there[part[np.isin(keys, np.concatenate(first))]] = True
    beyond = np.zeros(mesh.t.shape, dtype=bool)
    beyond[corners] = there[part]
    return beyond


def _corners(mesh: Mesh, facets: Ints, side: int, double: Ints) -> Ints:
    """Return keys of the corners at doubled vertices of facets, in the elements on one side."""
    ends = mesh.facets[:, facets]
    return np.asarray((ends + mesh.nvertices * mesh.f2t[side, facets])[np.isin(ends, double)])


def _move_to_quarters(mesh: Mesh, nodes: Array, tips: Ints) -> None:
    """Move the nodes within the sides at tips, and the middle of a quadrilateral with them.

    The middle goes where the eight other nodes put it, so that geometry and displacement have the
    same shape functions.
    """
    for tip in tips:
        sides = np.flatnonzero((mesh.facets == tip).any(axis=0))
        far = mesh.facets[:, sides].sum(axis=0) - tip
        at = nodes[:, [tip]]
        nodes[:, mesh.dofs.facet_dofs[0, sides]] = at + _QUARTER * (nodes[:, far] - at)
        if len(mesh.t) == 4:
            around = np.flatnonzero((mesh.t == tip).any(axis=0))
            of = mesh.dofs.element_dofs[:, around]
            nodes[:, of[8]] = nodes[:, of[4:8]].sum(axis=1) / 2 - nodes[:, of[:4]].sum(axis=1) / 4
