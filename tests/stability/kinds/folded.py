"""Meshes with elements no mapping covers once: refused, the element told."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from skfem import MeshQuad, MeshTri

from solver.mesh import grid, mapped
from tests.stability.kinds.plate import pull
from tests.stability.trial import Scene, numbers, tells

if TYPE_CHECKING:
    from skfem import Mesh

SIDE = np.arange(4.0)


def _points(move: dict[int, tuple[float, float]]) -> Mesh:
    """Return 3 x 3 unit squares, some of their corners moved."""
    mesh = grid(SIDE, SIDE)
    p = mesh.p.copy()
    for node, to in move.items():
        p[:, node] = to
    return MeshQuad(p, mesh.t, _boundaries=mesh.boundaries)


def _node(x: float, y: float) -> int:
    return int(np.flatnonzero((grid(SIDE, SIDE).p == [[x], [y]]).all(axis=0))[0])


def _element(x: float, y: float) -> int:
    """Return the element around a point."""
    mesh = grid(SIDE, SIDE)
    return int(np.flatnonzero((np.floor(mesh.p[:, mesh.t].min(axis=1)) == [[x], [y]]).all(0))[0])


def _order(orders: dict[int, tuple[int, ...]]) -> Mesh:
    """Return the squares, the corners of some elements in another order."""
    mesh = grid(SIDE, SIDE)
    t = mesh.t.copy()
    for element, order in orders.items():
        t[:, element] = t[list(order), element]
    # the facets are others now: the sides are found anew
    sides = {
        name: (lambda m, axis=axis, value=value: np.abs(m[axis] - value) < 1e-9)
        for name, (axis, value) in {"left": (0, 0), "right": (0, 3), "bottom": (1, 0)}.items()
    }
    return MeshQuad(mesh.p, t).with_boundaries(sides)


def _concave() -> tuple[Mesh, set[int]]:
    return _points({_node(1, 1): (1.7, 1.7)}), {_element(1, 1)}


def _bow_tie() -> tuple[Mesh, set[int]]:
    return _order({_element(1, 1): (0, 2, 1, 3)}), {_element(1, 1)}


def _scrambled() -> tuple[Mesh, set[int]]:
    elements = [_element(1, 1), _element(1, 0), _element(2, 1)]
    orders = ((0, 2, 1, 3), (1, 3, 2, 0), (2, 0, 1, 3))
    return _order(dict(zip(elements, orders, strict=True))), set(elements)


def _inside_out() -> tuple[Mesh, set[int]]:
    """The two middle columns of nodes changed places: the middle elements are turned over."""
    move = {_node(x, y): (3 - x, y) for x in (1.0, 2.0) for y in SIDE}
    return _points(move), {_element(1, y) for y in (0, 1, 2)}


def _flat() -> tuple[Mesh, set[int]]:
    """Two nodes at one place, and two more: no area between, and a side without length beside."""
    beside = {_element(1, y) for y in (0, 1, 2)}
    return _points({_node(2, 1): (1, 1), _node(2, 2): (1, 2)}), beside


def _folded_triangle() -> tuple[Mesh, set[int]]:
    mesh = grid(SIDE, SIDE, "tri")
    p = mesh.p.copy()
    node = int(np.flatnonzero((p == [[1.0], [1.0]]).all(axis=0))[0])
    p[:, node] = 2.6, 1.2
    # a fold is between two elements: either may be told
    around = np.flatnonzero((mesh.t == node).any(axis=0))
    return MeshTri(p, mesh.t, _boundaries=mesh.boundaries), set(around.tolist())


def _curved() -> tuple[Mesh, set[int]]:
    """A middle node of an edge pulled through the opposite edge."""
    mesh = mapped(grid(SIDE, SIDE), lambda p: p)
    p = mesh.doflocs.copy()
    node = int(np.flatnonzero((np.abs(p - [[1.5], [1.0]]) < 1e-9).all(axis=0))[0])
    p[:, node] = 1.5, 2.3
    bent = type(mesh)(doflocs=p, t=mesh.t, sort_t=False, validate=False)
    return bent.with_boundaries(dict(mesh.boundaries or {})), {_element(1, 1), _element(1, 0)}


def _not_a_number() -> tuple[Mesh, set[int]]:
    around = {_element(x, y) for x in (0, 1) for y in (0, 1)}
    return _points({_node(1, 1): (np.nan, 1.0)}), around | {_node(1, 1)}


def _mesh(make: Callable[[], tuple[Mesh, set[int]]]) -> Mesh:
    return make()[0]


def _told(elements: set[int], text: str) -> bool:
    return tells("crooked", "element|node")(text) and bool(numbers(text) & elements)


MESHES: tuple[tuple[Callable[[], tuple[Mesh, set[int]]], str], ...] = (
    (_concave, "quad8"),
    (_bow_tie, "quad8"),
    (_scrambled, "quad4"),
    (_inside_out, "quad9"),
    (_flat, "quad8"),
    (_folded_triangle, "tri6"),
    (_curved, "quad8"),
    (_not_a_number, "quad4"),
)


def scenes() -> list[Scene]:
    """Return one scene a kind of fold."""
    return [
        Scene(
            what=f"{make.__name__} of {element}; element one of {sorted(make()[1])}",
            run=partial(pull, partial(_mesh, make), name="crooked", element=element, left="x"),
            refusal=partial(_told, make()[1]),
        )
        for make, element in MESHES
    ]
