"""A rail whose section is a mesh of its own."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from skfem import Mesh, MeshQuad2

from solver.errors import ModelError
from solver.mesh.cells import facets_of, mesh_of_cells
from solver.rolling.rail.profiles.outline import Outline, smooth_curve
from solver.rolling.rail.profiles.points import FOOT, RUNNING, SectionMesh
from solver.rolling.rail.profiles.rail import Rail
from solver.rolling.rail.profiles.zone import Zone
from solver.typing import Array, Bools, Ints

_DIGITS = 6
"""Number of decimals of positions in mm."""
_SIDES = (4, 8)
"""Numbers of points of a cell: corners one after the other, then the middles of the sides."""


def section_of(mesh: Mesh) -> SectionMesh:
    """Return a scikit-fem mesh with these lines as plain numbers, coordinates z and y."""
    nodes = mesh.dofs.element_dofs[:8]
    used, cells = np.unique(nodes, return_inverse=True)
    lines = (
        np.searchsorted(used, mesh.facets[:, mesh.boundaries[name]]).T.tolist()
        for name in (RUNNING, FOOT)
    )
    points = np.round(mesh.doflocs[:, used], _DIGITS).T.tolist()
    rows = (points, cells.reshape(nodes.shape).T.tolist(), *lines)
    return SectionMesh(*(tuple(map(tuple, each)) for each in rows))


def checked(section: SectionMesh, field: str) -> SectionMesh:
    """Return the mesh, or raise `ModelError` for ``field`` if it is no section of a rail."""
    count = len(section.points)

    def refuse(allowed: str) -> ModelError:
        return ModelError(field, section.in_words, allowed)

    if not np.isfinite(np.array(section.points, dtype=float)).all():
        raise refuse("must have finite points")
    if len({len(each) for each in section.cells}) != 1 or len(section.cells[0]) not in _SIDES:
        raise refuse("must have elements of four points each, or of eight")
    for rows in (section.cells, section.running, section.foot):
        if rows and not 0 <= np.min(rows) <= np.max(rows) < count:
            raise refuse(f"must have points numbered from 0 to {count - 1}")
    if any(len(set(each)) < len(each) for each in section.cells):
        raise refuse("must have elements of different points")
    mesh, number = _made(section)
    for name in (RUNNING, FOOT):
        edges = getattr(section, name)
        facets = _facets(section, mesh, number, name)
        if not edges or (facets < 0).any() or (mesh.f2t[1, facets] >= 0).any():
            raise refuse(f"must have a line {name} of edges of elements, on the outside")
    try:
        ends = _chain(section)
        around = len(ends) + len(_rest(section)) - 2
    except ValueError as error:
        raise refuse(str(error)) from None
    if around != len(mesh.boundary_facets()):
        raise refuse("must be one piece, without holes and cracks")
    z = np.array(section.points)[ends, 0]
    if not (np.diff(z) > 0).all():
        raise refuse(f"must have a line {RUNNING} along which z increases, without its sides")
    return section


def _made(section: SectionMesh) -> tuple[Mesh, Ints]:
    """The mesh, and the number of its corner at each point."""
    return mesh_of_cells(np.array(section.points), np.array(section.cells), 4)


def _facets(section: SectionMesh, mesh: Mesh, number: Ints, name: str) -> Ints:
    """Return the facets of a line."""
    return facets_of(mesh, number[np.array(getattr(section, name), dtype=np.int64).reshape(-1, 2)])


def _chain(section: SectionMesh) -> list[int]:
    """The corners of the running line from small to large z."""
    ends = _walked(np.array(section.running))
    return ends if section.points[ends[0]][0] < section.points[ends[-1]][0] else ends[::-1]


def _rest(section: SectionMesh) -> list[int]:
    """The corners of the outline from the first one of the running line below to its last."""
    mesh, number = _made(section)
    point = np.flatnonzero(number >= 0)
    around = point[mesh.facets[:, mesh.boundary_facets()].T]
    chain = _chain(section)
    return _walked(around, start=chain[0], away=chain[1], end=chain[-1])


@dataclass(frozen=True, slots=True)
class ZonedMesh:
    """A section whose first elements are the zone that may yield; ``running`` is its surface.

    Attributes
    ----------
    mesh : 8-node quadrilaterals, as of `solver.rolling.rail.profiles.zone`
    elements : number of elements of the zone
    """

    mesh: MeshQuad2
    elements: int


@dataclass(frozen=True, eq=False)
class MeshedRail(Rail):
    """A rail with the section of a mesh; the highest point of its running line is at y = 0.

    Attributes
    ----------
    section : the mesh
    points : (n, 2) its points in their places [mm]
    """

    section: SectionMesh
    points: Array

    @classmethod
    def of(cls, section: SectionMesh) -> MeshedRail:
        """Return the rail as it stands in the mesh.

        Raises
        ------
        ModelError
            for ``running``, if it is not above the section; for ``points``, if it has too few
        """
        found = cls(section, np.array(section.points))
        if not found.outline.area > 0:
            raise ModelError(RUNNING, section.in_words, "must be above the section")
        return found._on_top()

    def canted(self, slope: float) -> MeshedRail:
        """Return the rail turned about its top, as `RailSection.canted` does."""
        c, s = np.array([1.0, slope]) / np.hypot(1.0, slope)
        return replace(self, points=self.points @ [[c, s], [-s, c]])._on_top()

    def _on_top(self) -> MeshedRail:
        top = self.outline.at(np.array(self.outline.highest(self.running)))[1]
        return replace(self, points=self.points - [0.0, float(top)])

    @property
    def foot(self) -> float:
        """Length of the foot line [mm]."""
        ends = self.points[np.array(self.section.foot)]
        return float(np.hypot(*(ends[:, 1] - ends[:, 0]).T).sum())

    def _along(self, corners: list[int]) -> Array:
        """Return the nodes (2, n) along edges from corner to corner."""
        middle = {
            frozenset((cell[k], cell[(k + 1) % 4])): cell[4 + k]
            for cell in self.section.cells
            for k in range(len(cell) - 4)
        }
        nodes = [corners[0]]
        for pair in pairwise(corners):
            between = middle.get(frozenset(pair))
            nodes += [pair[1]] if between is None else [between, pair[1]]
        return self.points[nodes].T

    @cached_property
    def _surface(self) -> tuple[Array, Array]:
        """Joints and bends of the running line from small to large z, as of `smooth_curve`."""
        return smooth_curve(self._along(_chain(self.section)))

    @cached_property
    def outline(self) -> Outline:
        """The outline, counterclockwise; it begins below the left end of the running line."""
        joints, bends = self._surface
        below = self._along(_rest(self.section))[:, 1:-1]
        return Outline(
            np.hstack([below, joints[:, ::-1]]),
            np.concatenate([np.zeros(below.shape[1]), -bends[::-1], [0.0]]),
        )

    @cached_property
    def running(self) -> tuple[float, float]:
        """See `Rail.running`."""
        lengths = self.outline.lengths
        arcs = self._surface[1].size
        return float(lengths[: -arcs - 1].sum()), float(lengths[:-1].sum())

    def zoned(self, zone: Zone, largest: float) -> ZonedMesh:
        """Return the mesh with the elements of a zone first; ``zone.size`` has no effect.

        Raises
        ------
        ModelError
            for ``rail_profile``, if an edge of the surface is longer than ``largest`` [mm]
        """
        mesh, number = _made(self.section)
        chain = np.array(_chain(self.section))
        ends = np.stack([chain[:-1], chain[1:]], axis=1)
        X = self.points[ends]  # (edges, 2, zy)
        side = np.hypot(*(X[:, 1] - X[:, 0]).T)
        right = self.running[1]
        s = right - np.cumsum(side) + side / 2
        away = abs(s - self.place(zone.at))
        chosen = np.flatnonzero(away < zone.half_width)
        reaches = away < zone.half_width + (side - largest) / 2
        for k in np.flatnonzero(reaches & (side > largest))[:1]:
            raise ModelError(
                "rail_profile", self.section.in_words,
                f"must have elements at most {largest:g} mm wide where the wheel may touch, not "
                f"{side[k]:.3g} at z = {X[k, 0, 0]:.3g} mm",
            )  # fmt: skip
        under = mesh.f2t[0, facets_of(mesh, number[ends[chosen]])]
        cells = np.array(self.section.cells)
        centre = self.points[cells].mean(axis=1)
        nearest, depth = _nearest(centre, X[chosen])
        inside = (depth < zone.depth) & nearest
        inside[under] = True
        order = np.argsort(~inside, kind="stable")
        whole, number = mesh_of_cells(self.points, cells[order], 4)
        boundaries = {
            RUNNING: facets_of(whole, number[ends[chosen]]),
            FOOT: _facets(self.section, whole, number, FOOT),
        }

        curved = whole if cells.shape[1] > 4 else MeshQuad2.from_mesh(whole)
        return ZonedMesh(curved.with_boundaries(boundaries), int(inside.sum()))


def _nearest(points: Array, edges: Array) -> tuple[Bools, Array]:
    """Return whether the place of a chain nearest to points (n, 2) is inside it, and its distance.

    Parameters
    ----------
    edges : (m, 2, 2) the ends of its edges, in their order
    """
    along = edges[:, 1] - edges[:, 0]
    apart = points[:, None] - edges[:, 0]
    share = (apart * along).sum(-1) / (along**2).sum(-1)
    distance = np.linalg.norm(apart - np.clip(share, 0, 1)[..., None] * along, axis=-1)
    nearest, row = distance.argmin(axis=1), np.arange(len(points))
    at = share[row, nearest]
    beyond = ((nearest == 0) & (at < 0)) | ((nearest == len(edges) - 1) & (at > 1))
    return ~beyond, distance[row, nearest]


def _walked(
    edges: Ints, start: int | None = None, away: int | None = None, end: int | None = None
) -> list[int]:
    """Return the corners along edges (n, 2), one after the other.

    Parameters
    ----------
    start, away, end : first corner, its neighbour in the other direction, and last corner; by
        default the edges are one chain from an end to the other

    Raises
    ------
    ValueError
        if they are no chain
    """
    wrong = ValueError(
        f"must have a line {RUNNING} that is one chain of edges" if start is None
        else "must have an outline that does not touch itself"
    )  # fmt: skip
    beside: dict[int, list[int]] = {}
    for one, other in edges.tolist():
        beside.setdefault(one, []).append(other)
        beside.setdefault(other, []).append(one)
    if start is None:
        ends = [corner for corner, others in beside.items() if len(others) == 1]
        if len(ends) != 2:
            raise wrong
        start, end = ends
    found, before = [start], away
    while found[-1] != end:
        onward = [each for each in beside[found[-1]] if each != before]
        if len(onward) != 1 or len(found) > len(edges):
            raise wrong
        before = found[-1]
        found += onward
    if away is None and len(found) != len(edges) + 1:
        raise wrong
    return found
