"""Normals of a contact surface, where it is smooth and where it has corners."""

from __future__ import annotations

import numpy as np

from solver.fem.surface import NO_TANGENT, Surface
from solver.mesh.edges import shape_derivatives
from solver.typing import Array, Bools

_CORNER = float(np.cos(np.radians(40.0)))
"""Cosine of the angle between the normals of two edges: they form a corner at a larger angle."""
_STRAIGHT = 1e-6
"""Change of the normal along a straight surface by rounding [rad], at most; the sagitta of an
element is then 1e-7 of its length."""


def _edge_normal(x: Array, surface: Surface, xi: float) -> Array:
    """Return outward unit normals (2, n_edges) at ``xi`` on every edge.

    Where the middle node of an edge is a quarter of it from an end, the tangent there is zero
    before loading: then it is the direction between the ends.
    """
    d = shape_derivatives(np.array(xi), surface.edges.shape[1])
    t = x[:, surface.edges] @ d
    gone = np.hypot(*(surface.X[:, surface.edges] @ d)) <= NO_TANGENT * surface.lengths
    t[:, gone] = np.diff(x[:, surface.edges[gone, :2]])[..., 0]
    n = np.stack([t[1], -t[0]])
    return np.asarray(n / np.linalg.norm(n, axis=0))


def end_normals(x: Array, surface: Surface) -> Array:
    """Return unit normals (2, 2, n_edges) at the starts and the ends of the edges.

    Two edges share the mean of their normals at the vertex between them. At a corner of the
    undeformed body, and at the ends of the chain, each edge keeps its own normal.
    """
    start, end = _edge_normal(x, surface, -1.0), _edge_normal(x, surface, 1.0)
    smooth = _smooth(surface)
    mean = end[:, :-1] + start[:, 1:]
    mean /= np.linalg.norm(mean, axis=0)
    start[:, 1:] = np.where(smooth, mean, start[:, 1:])
    end[:, :-1] = np.where(smooth, mean, end[:, :-1])
    return np.stack([start, end], axis=1)


def _smooth(surface: Surface) -> Bools:
    """Return whether the undeformed surface has no corner at each of its inner vertices."""
    before = _edge_normal(surface.X, surface, 1.0)[:, :-1]
    after = _edge_normal(surface.X, surface, -1.0)[:, 1:]
    return np.asarray((before * after).sum(axis=0) > _CORNER)


def end_turns(x: Array, surface: Surface) -> Array:
    """Return the rotations of `end_normals`, counter-clockwise, by displacements [1/mm].

    Shape (2, n_edges, 3, k, 2): at starts and ends, by the k nodes of the edge before, of the edge
    itself, and of the edge after it.
    """
    edges, half = surface.edges, _smooth(surface)[:, None, None] / 2

    def turns(xi: float) -> Array:
        d = shape_derivatives(np.array(xi), edges.shape[1])
        t = x[:, edges] @ d
        each = np.stack([-t[1], t[0]], axis=1) / (t**2).sum(axis=0)[:, None]
        return np.asarray(each[:, None] * d[:, None])

    start, end = turns(-1.0), turns(1.0)
    out = np.zeros((2, len(edges), 3, edges.shape[1], 2))
    out[:, :, 1] = start, end
    out[0, 1:, 0], out[1, :-1, 2] = half * end[:-1], half * start[1:]
    out[0, 1:, 1] -= half * start[1:]
    out[1, :-1, 1] -= half * end[:-1]
    return out


def is_curved(surface: Surface) -> bool:
    """Whether the normal changes along a surface before any load."""
    n = np.hstack([_edge_normal(surface.X, surface, xi) for xi in (-1.0, 1.0)])
    return bool(np.ptp(n, axis=1).max() > _STRAIGHT)
