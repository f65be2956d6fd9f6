"""A tip of a crack, and the elements around it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from solver.fem.nodes import Nodes
from solver.fem.surface import edges_of
from solver.mesh.opening import faces_of
from solver.typing import Array, Bools, Ints


class Tip(NamedTuple):
    """A tip of a crack.

    Attributes
    ----------
    name : that of the body and the crack, and ``start`` or ``end`` if it has two tips
    crack : name of the crack
    part : the body
    vertex, at : vertex of its mesh, and position (2,) [mm]
    ahead : (2,) unit vector in which the crack would go on
    edges : edges (n, 3) of its upper and its lower face, upper to the left of ``ahead``; the first
        of each is that at the tip
    others : vertices of the other tips of the body
    """

    name: str
    crack: str
    part: Nodes
    vertex: int
    at: Array
    ahead: Array
    edges: tuple[Ints, Ints]
    others: Ints

    @property
    def axes(self) -> Array:
        """Unit vectors (2, 2) of its own axes: ahead, and to the left of it."""
        x, y = self.ahead
        return np.array([[x, y], [-y, x]])

    def polar(self, X: Array) -> tuple[Array, Array]:
        """Return distance and angle from ahead of positions (2, ...)."""
        x, y = np.tensordot(self.axes, X - self.at.reshape(2, *(1,) * (X.ndim - 1)), 1)
        return np.hypot(x, y), np.arctan2(y, x)

    def domain(self, rings: int) -> tuple[Array, int]:
        """Return a function that falls from one at the tip to zero, by nodes, and its rings.

        It is one at the corners of so many rings of elements around the tip; of fewer if these
        reached the outline, another crack or another tip, and of none if there is no room.
        """
        mesh, basis = self.part.body.mesh, self.part.basis
        barred = np.zeros(mesh.nvertices, dtype=bool)
        barred[mesh.facets[:, np.setdiff1d(mesh.boundary_facets(), self.facets)]] = True
        inside, done = np.arange(mesh.nvertices) == self.vertex, 0
        for _ in range(rings):
            wider = _grown(mesh.t, inside)
            if (wider & barred).any() or _grown(mesh.t, wider)[self.others].any():
                break
            inside, done = wider, done + 1
        values = np.zeros(self.part.X.shape[1])
        values[basis.nodal_dofs[0]] = inside if done else 0.0
        values[basis.facet_dofs[0]] = inside[mesh.facets].mean(axis=0) if done else 0.0
        return values, done

    @property
    def sides(self) -> set[tuple[str, str]]:
        """Its faces, by body and boundary."""
        return {(self.part.body.name, face) for face in faces_of(self.crack)}

    @property
    def facets(self) -> Ints:
        """The facets of both faces."""
        return np.concatenate([self.part.body.facets(face) for _, face in self.sides])


def _grown(t: Ints, inside: Bools) -> Bools:
    """Return which vertices belong to an element that has one of some vertices."""
    wider = np.zeros_like(inside)
    wider[t[:, inside[t].any(axis=0)]] = True
    return wider


def tips_of(part: Nodes) -> list[Tip]:
    """Return the tips of all cracks of a body."""
    vertex = np.zeros(part.X.shape[1], dtype=int)
    vertex[part.basis.nodal_dofs[0]] = np.arange(part.body.mesh.nvertices)
    found: list[Tip] = []
    for crack in part.body.cracks:
        left, right = (edges_of(part, face) for face in faces_of(crack))
        nodes = np.intersect1d(left[:, :2], right[:, :2])
        for node in nodes:
            # the body is on the left of an edge: the upper face ends at the tip
            at_end = bool((left[:, 1] == node).any())
            upper, lower = (
                _from_tip(e, node) for e in ((left, right) if at_end else (right, left))
            )
            along = part.X[:, node] - part.X[:, upper[0, 0]]
            end = (".end" if at_end else ".start") if len(nodes) > 1 else ""
            found.append(Tip(
                f"{part.body.name}.{crack}{end}", crack, part, int(vertex[node]), part.X[:, node],
                along / np.hypot(*along), (upper, lower), np.zeros(0, dtype=int),
            ))  # fmt: skip
    every = np.array([tip.vertex for tip in found], dtype=int)
    return [tip._replace(others=every[every != tip.vertex]) for tip in found]


def _from_tip(edges: Ints, node: int) -> Ints:
    """Return the edges, that at a node first."""
    return edges[np.argsort(~(edges[:, :2] == node).any(axis=1), kind="stable")]
