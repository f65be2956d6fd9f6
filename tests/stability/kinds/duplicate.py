"""Meshes whose elements do not hang together as they seem to: refused."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from skfem import MeshQuad, MeshTri
from skfem.mesh import Mesh

from solver.mesh import grid
from tests.stability.kinds.plate import pull
from tests.stability.trial import Scene, tells

SIDES = {
    "left": lambda m: np.abs(m[0]) < 1e-9,
    "right": lambda m: np.abs(m[0] - 4) < 1e-9,
    "bottom": lambda m: np.abs(m[1]) < 1e-9,
}


def _torn(nodes: Callable[[np.ndarray], np.ndarray], shift: float = 0.0, cells="quad") -> Mesh:
    """Return 4 x 4 squares, those right of x = 2 with copies of some nodes there."""
    mesh = grid(np.arange(5.0), np.arange(5.0), cells)
    torn = np.flatnonzero((np.abs(mesh.p[0] - 2) < 1e-9) & nodes(mesh.p[1]))
    copy = np.arange(mesh.p.shape[1])
    copy[torn] = mesh.p.shape[1] + np.arange(len(torn))
    t = mesh.t.copy()
    beyond = mesh.p[0, t].mean(axis=0) > 2
    t[:, beyond] = copy[t[:, beyond]]
    p = np.hstack([mesh.p, mesh.p[:, torn] + [[shift], [0.0]]])
    make = MeshTri if cells == "tri" else MeshQuad
    return make(p, t).with_boundaries(SIDES)


def _unmerged() -> Mesh:
    return _torn(lambda y: y == 2)


def _crack() -> Mesh:
    return _torn(lambda y: y > 1.5)


def _inner_crack() -> Mesh:
    return _torn(lambda y: (y > 0.5) & (y < 3.5), 1e-12, "tri")


def _split() -> Mesh:
    return _torn(lambda y: y > -1)


def _two_parts() -> Mesh:
    return _torn(lambda y: y > -1, 0.5)


def _hanging() -> Mesh:
    """One element beside two: the middle node of its side is not its own."""
    p = np.array([[0, 2, 2, 0, 4, 4, 2, 4], [0, 0, 4, 4, 0, 2, 2, 4]], dtype=float)
    t = np.array([[0, 1, 2, 3], [1, 4, 5, 6], [6, 5, 7, 2]]).T
    return MeshQuad(p, t).with_boundaries(SIDES)


def _hinge() -> Mesh:
    """Two squares that share a corner only."""
    p = np.array([[0, 2, 2, 0, 4, 4, 2], [0, 0, 2, 2, 2, 4, 4]], dtype=float)
    t = np.array([[0, 1, 2, 3], [2, 4, 5, 6]]).T
    return MeshQuad(p, t).with_boundaries(SIDES)


def _twice() -> Mesh:
    """An element that stands in the list twice."""
    mesh = grid(np.arange(5.0), np.arange(5.0))
    t = np.hstack([mesh.t, mesh.t[:, 5:6]])
    return MeshQuad(mesh.p, t).with_boundaries(SIDES)


MESHES: tuple[tuple[Callable[[], Mesh], str], ...] = (
    (_unmerged, "quad8"),
    (_crack, "quad8"),
    (_inner_crack, "tri6"),
    (_split, "quad4"),
    (_two_parts, "quad9"),
    (_hanging, "quad8"),
    (_hinge, "quad4"),
    (_twice, "quad8"),
)


def scenes() -> list[Scene]:
    """Return one scene a kind of tear."""
    return [
        Scene(
            what=f"{make.__name__} of {element}",
            run=partial(pull, make, name="torn", element=element, left="xy"),
            refusal=tells("torn", "node|element|part|piece|connect"),
        )
        for make, element in MESHES
    ]
