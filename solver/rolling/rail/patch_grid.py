"""The surface of a prism where a load may touch it: hats across times stations along."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Interval
from scipy import sparse

from solver.errors import ModelError
from solver.fem.surface import extract
from solver.mesh.edges import shape_derivatives, shape_functions
from solver.parameters import Length, check
from solver.rolling.rail.section import Section
from solver.typing import Array

SHARES = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)
"""Positions of the two Gauss points of an edge, as shares of its length."""


@dataclass(frozen=True, slots=True)
class Hats:
    """The hats of m vertices at positions ``s`` (m,) along a surface, increasing [mm].

    A hat is 1 at its vertex, 0 at the others, and linear between.
    """

    s: Array

    @property
    def width(self) -> Array:
        """Integrals (m,) of the hats [mm]."""
        edges = np.diff(self.s)
        return np.asarray((np.append(edges, 0.0) + np.append(0.0, edges)) / 2)

    @property
    def points(self) -> Array:
        """Positions (2m - 2,) of two Gauss points an edge [mm]."""
        return self.along(self.s[:-1], self.s[1:])

    @property
    def mean(self) -> Array:
        """Weights (m, 2m - 2): mean values under the hats, of values at the points.

        The mean under hat j is the integral of value times hat, over that of the hat.
        """
        edges, m = np.arange(len(self.s) - 1), len(self.s)
        half = np.diff(self.s)[:, None] / 2
        weights = np.zeros((m, m - 1, 2))
        weights[edges, edges] = half * (1 - SHARES)
        weights[edges + 1, edges] = half * SHARES
        return weights.reshape(m, -1) / self.width[:, None]

    def nearest(self, shares: Array, weights: Array) -> Array:
        """Weights (m, n (m - 1)): the sum of hats nearest to a function, of its values at points.

        Nearest means least squares. The integral over all hats is that of the function, and so is
        its product with every hat: forces on the vertices of a mesh are those of the function.

        Parameters
        ----------
        shares, weights : (n,) positions of the points of an edge, over its length, and the weights
            by which values there make the mean over the edge
        """
        edges, m = np.arange(len(self.s) - 1), len(self.s)
        length = np.diff(self.s)[:, None]
        products = np.zeros((m, m - 1, len(shares)))
        products[edges, edges] = length * weights * (1 - shares)
        products[edges + 1, edges] = length * weights * shares
        hats = np.diag(4 * self.width) + np.diag(length[:, 0], 1) + np.diag(length[:, 0], -1)
        return np.asarray(np.linalg.solve(hats / 6, products.reshape(m, -1)))

    @staticmethod
    def along(first: Array, last: Array) -> Array:
        """Return values (2m - 2,) at the points, of functions linear on every edge.

        ``first`` and ``last`` (m - 1,) are the values at both ends of the edges.
        """
        return np.asarray((first[:, None] + (last - first)[:, None] * SHARES).ravel())


_FEWEST = 3
"""Least number of vertices and of stations: the outermost ones must not touch."""
_CUBIC = (
    [(t * (1 - t) ** 2, -(t**2) * (1 - t)) for t in SHARES],
    [((1 - t) * (1 - 3 * t), t * (3 * t - 2)) for t in SHARES],
)
"""Heights over the length of an edge, and slopes, at the points of the hats, of two cubics: both
are 0 at the ends, with slope 1 at one end and 0 at the other."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PatchGrid:
    """m vertices across times n stations along a surface.

    Tractions are linear across between vertices, and uniform along over the distance of two
    stations. A contact has its *local axes* at each vertex: x, the outward normal of the surface,
    and the tangent across; together they are right-handed.

    Attributes
    ----------
    z, y : (m,) positions of the vertices, z increasing [mm]
    angle : (m,) slope angle of the surface at the vertices, tan(angle) = dy/dz [rad]
    spacing : distance h of two stations [mm]
    ahead : position x_0 of the first station, x_c = x_0 - c h [mm]
    stations : number n of stations
    """

    z: Array
    y: Array
    angle: Array
    spacing: Length
    ahead: float
    stations: Annotated[int, Interval(ge=_FEWEST)]

    def __post_init__(self) -> None:
        """Raise `ModelError` for positions that are not a surface."""
        check(self)
        m = len(self.z)
        if m < _FEWEST or not (np.diff(self.z) > 0).all():
            raise ModelError("z", self.z, f"must increase, {_FEWEST} positions or more")
        for name in ("y", "angle"):
            if getattr(self, name).shape != (m,):
                raise ModelError(name, getattr(self, name), f"must have {m} values, as z")
        if not (np.abs(self.angle) < np.pi / 2).all():
            raise ModelError("angle", self.angle, "must lie between -pi/2 and pi/2")

    @property
    def x(self) -> Array:
        """Positions (n,) of the stations [mm]."""
        return np.asarray(self.ahead - self.spacing * np.arange(self.stations))

    @property
    def hats(self) -> Hats:
        """The hats across, over the length of the surface."""
        lengths = np.hypot(np.diff(self.z), np.diff(self.y))
        return Hats(np.append(0.0, np.cumsum(lengths)))

    @property
    def area(self) -> Array:
        """Area (m,) over which the traction of a vertex acts at one station [mm2]."""
        return self.spacing * self.hats.width

    @property
    def axes(self) -> Array:
        """Local axes (m, 3, 3): rows x, normal, tangent across, in x, y, z."""
        axes = np.zeros((len(self.z), 3, 3))
        cos, sin = np.cos(self.angle), np.sin(self.angle)
        axes[:, 0, 0] = 1.0
        axes[:, 1, 1], axes[:, 1, 2] = cos, -sin
        axes[:, 2, 1], axes[:, 2, 2] = sin, cos
        return axes

    @property
    def surface(self) -> tuple[Array, Array, Array]:
        """Positions z, y and slope angle (2m - 2,) of the surface at the points of the hats.

        Between vertices it is the cubic with their positions and directions over the straight line
        between them.
        """
        along = np.stack([np.diff(self.z), np.diff(self.y)])
        chord = np.arctan2(along[1], along[0])
        before, after = np.tan(self.angle[:-1] - chord), np.tan(self.angle[1:] - chord)
        rise, slope = (
            np.stack([a * before + b * after for a, b in pairs], axis=1) for pairs in _CUBIC
        )
        across = np.stack([-along[1], along[0]])[..., None] * rise
        first = np.stack([self.z, self.y])[:, :-1, None]
        z, y = (first + along[..., None] * SHARES + across).reshape(2, -1)
        return z, y, (chord[:, None] + np.arctan(slope)).ravel()


class RunningSurface:
    """A chain of m - 1 edges of a section, on which a load may act, from small to large z.

    Parameters
    ----------
    section : the cross-section
    boundary : name of the chain

    Attributes
    ----------
    z, y : (m,) positions of the vertices [mm]
    angle : (m,) slope angle of the surface at the vertices [rad]

    Raises
    ------
    ModelError
        if the edges are no chain along which z increases
    """

    def __init__(self, section: Section, boundary: str) -> None:
        plane = section.plane
        chain = extract(plane, boundary)
        edges = chain.nodes[chain.edges]
        if plane.X[0, edges[0, 0]] > plane.X[0, edges[-1, 1]]:
            edges = edges[::-1, [1, 0, 2]]
        self.z, self.y = plane.X[:, np.append(edges[:, 0], edges[-1, 1])]
        if not (np.diff(self.z) > 0).all():
            raise ModelError("boundary", boundary, "must be a chain along which z increases")
        self._edges, self._n = edges, plane.X.shape[1]
        ends = np.stack([plane.X[:, edges] @ shape_derivatives(np.array(xi), 3) for xi in (-1, 1)])
        slopes = np.arctan2(ends[:, 1], ends[:, 0])  # (2, m - 1): at both ends of each edge
        both = np.append(slopes[0], slopes[1, -1]), np.append(slopes[0, 0], slopes[1])
        self.angle = (both[0] + both[1]) / 2

    def grid(self, spacing: float, ahead: float, stations: int) -> PatchGrid:
        """Return the grid of the surface with some stations; see `PatchGrid`."""
        return PatchGrid(
            z=self.z, y=self.y, angle=self.angle, spacing=spacing, ahead=ahead, stations=stations
        )

    def rows(self, grid: PatchGrid) -> sparse.csr_array:
        """Return the means under the hats (3 m, n) of the section's displacements.

        Rows are along x at all vertices, then along y, then along z.
        """
        at = np.stack([shape_functions(np.array(2 * share - 1), 3) for share in SHARES])
        edges = len(self._edges)
        columns = np.broadcast_to(self._edges[:, None, :], (edges, *at.shape))
        values = np.broadcast_to(at, columns.shape)
        indptr = np.arange(0, values.size + 1, at.shape[1])
        at_points = sparse.csr_array(
            (values.ravel(), columns.ravel(), indptr), shape=(2 * edges, self._n)
        )
        mean = sparse.csr_array(sparse.csr_array(grid.hats.mean) @ at_points)
        each = [sparse.kron(mean, np.eye(3)[[axis]]) for axis in range(3)]
        return sparse.csr_array(sparse.vstack(each))
