"""Overlap of bodies before loading, and the largest one allowed.

Contact pushes bodies with a small overlap apart before any load acts. A large overlap is an error
of the model: small strains cannot remove it, and it is unknown through which surface a point
entered.
"""

from __future__ import annotations

import numpy as np
from skfem import Mesh

from solver.errors import ModelError
from solver.fem.surface import Surface
from solver.mesh.edges import shape_functions
from solver.model.body import Body
from solver.model.rigid import RigidBody
from solver.typing import Array

_ALLOWED = 0.05
"""Largest overlap over the smaller body's narrow side."""


def largest_overlap(first: Body | RigidBody, second: Body | RigidBody) -> float:
    """Return the overlap allowed: a twentieth of the smaller body's narrow side [mm].

    The sides are those of the box around a body.
    """
    return _ALLOWED * float(min(body.box.min() for body in (first, second)))


def check_overlap(
    slave: Body | RigidBody, master: Body | RigidBody, sides: tuple[Surface, Surface]
) -> None:
    """Raise `ModelError` where a vertex of either surface is too deep inside a meshed body."""
    allowed = largest_overlap(slave, master)
    for body, other, surface in ((slave, master, sides[0]), (master, slave, sides[1])):
        if isinstance(other, RigidBody):
            continue
        points = surface.X[:, surface.vertices]
        depth = _depth(points, other, allowed)
        if depth.max(initial=0.0) > allowed:
            x, y = points[:, depth.argmax()]
            raise ModelError(
                "contacts", (body.name, other.name),
                f"body {body.name!r} overlaps {other.name!r} by {depth.max():.4g} mm at "
                f"x = {x:.4g}, y = {y:.4g} mm; at most {allowed:.4g} mm, a twentieth of the "
                "smaller body's narrow side, can be pushed apart: move one of the bodies",
            )  # fmt: skip


def _depth(points: Array, body: Body, allowed: float) -> Array:
    """Return how deep points (2, n) are inside a body (n,) [mm], 0 for those outside."""
    mesh = body.mesh
    low, high = mesh.p.min(axis=1) + allowed, mesh.p.max(axis=1) - allowed
    within = ((points.T > low) & (points.T < high)).all(axis=1)
    depth = np.zeros(points.shape[1])
    start, end = _outline(mesh)
    for i in np.flatnonzero(within):
        point = points[:, i, None]
        # a ray along x crosses the outline an odd number of times from inside
        above, below = start[1] > point[1], end[1] > point[1]
        crosses = above != below
        share = (point[1] - start[1, crosses]) / (end[1, crosses] - start[1, crosses])
        at = start[0, crosses] + share * (end[0, crosses] - start[0, crosses])
        if (at > point[0]).sum() % 2:
            along = end - start
            share = ((point - start) * along).sum(axis=0) / (along**2).sum(axis=0)
            foot = start + np.clip(share, 0.0, 1.0) * along
            depth[i] = np.linalg.norm(point - foot, axis=0).min()
    return depth


def _outline(mesh: Mesh) -> tuple[Array, Array]:
    """Return starts and ends (2, n) of the chords of a body's outline, four on a curved edge."""
    outside = mesh.boundary_facets()
    first, last = (mesh.p[:, nodes] for nodes in mesh.facets[:, outside])
    if not mesh.dofs.facet_dofs.size:
        return first, last
    middle = mesh.doflocs[:, mesh.dofs.facet_dofs[0][outside]]
    N = shape_functions(np.linspace(-1.0, 1.0, 5), 3)
    points = np.stack([first, last, middle], axis=-1) @ N.T
    return points[..., :-1].reshape(2, -1), points[..., 1:].reshape(2, -1)
