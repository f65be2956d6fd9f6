"""The positions of the results of a scene."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from solver.results.quantities import declare, in_space
from solver.tensors import components
from solver.typing import Array

X = declare(
    "x", "position along the surface from its middle", "mm", dims=("x",), beside={"axis": "X"}
)
Y = declare("y", "height above the surface", "mm", dims=("y",), beside={"axis": "Y"})
Z = in_space(
    "z", "position across the track from its middle", "mm", dims=("z",), beside={"axis": "Z"}
)
DEPTH = declare(
    "depth", "depth below the surface", "mm", dims=("depth",), standard_name="depth",
    beside={"positive": "down"},
)  # fmt: skip
STATION = declare(
    "station", "position of a depth profile along the surface", "mm", dims=("station",)
)
S = declare(
    "s", "distance along the surface from the middle, of the contact if loaded", "mm",
    dims=("s",),
)  # fmt: skip
COMPONENT = declare("component", "component of the stress tensor", "", dims=("component",))
STAGE = declare("stage", "stage of loading", "", dims=("stage",))
BODY = declare("body", "body", "", dims=("body",))


class Places(NamedTuple):
    """Places in a body: positions (2, n), or (3, n) in three dimensions [mm]."""

    body: str
    X: Array


class Axis(NamedTuple):
    """The straight line along a contact surface before loading.

    ``origin`` is its middle [mm], ``along`` the unit vector of increasing s, in the plane or in
    space. In the plane the lower body is to the right of the line, in space below it (-y).
    """

    origin: tuple[float, ...] = (0.0, 0.0)
    along: tuple[float, ...] = (1.0, 0.0)

    @property
    def down(self) -> tuple[float, ...]:
        """The unit vector from the surface into the lower body."""
        x, y, *z = self.along
        return (0.0, -1.0, 0.0) if z else (y, -x)

    def place(self, s: Array, depth: Array) -> Array:
        """Return positions (n_axes, n) at ``s`` along the surface and ``depth`` below it [mm]."""
        ways = np.multiply.outer(np.array(self.along), s)
        ways = ways + np.multiply.outer(np.array(self.down), depth)
        return np.asarray(ways + np.array(self.origin)[:, None])

    def reached(self, X: Array) -> Array:
        """Return the coordinate s (n,) along the surface of positions (n_axes, n) [mm]."""
        return np.asarray(np.array(self.along) @ (X - np.array(self.origin)[:, None]))


ALONG_X = Axis()
"""The axis of a horizontal surface at y = 0, with the lower body below it."""
ACROSS_TRACK = Axis((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
"""The axis along z of a section at x = 0 across a track along x."""
_INSIDE = 1e-4
"""Least depth of profiles below a curved surface, over the largest."""
NOWHERE = np.zeros(0)
"""Empty positions, of a grid that a view does not have."""


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """The positions of the results of a scene, independent of its mesh.

    Attributes
    ----------
    x, y : map grid, along the contact surface from its middle, and above it [mm]
    z : map grid instead of x for a section across the track, with ``axis`` `ACROSS_TRACK` [mm]
    depth, station : positions of profiles: ``depth`` below the surface at each s = ``station`` [mm]
    s : positions along the contact surface from its centre [mm]
    axis : line of s and x
    profile_body : body of the profiles
    surfaces : boundary that is the contact surface of each body, in the order of the dimension
    stages : names of the program's stages whose states are stored
    loaded, unloaded : stages of the states under load and after release; ``unloaded`` is empty if
        the bodies are not released
    following : stages in which ``s`` is zero at the load instead of x = 0
    symmetric : whether the bodies are one half of a model symmetric about s = 0
    top : (2, n) the surface of a ``profile_body`` that is curved before loading: rising s, and
        height over the line of ``axis`` [mm]; without points, this line is the surface
    """

    x: Array
    y: Array
    depth: Array
    station: Array
    s: Array
    profile_body: str
    surfaces: dict[str, str]
    stages: tuple[str, ...] = ("loaded", "unloaded")
    loaded: str = "loaded"
    unloaded: str = "unloaded"
    following: tuple[str, ...] = ()
    symmetric: bool = False
    axis: Axis = ALONG_X
    z: Array = field(default_factory=lambda: NOWHERE)
    top: Array = field(default_factory=lambda: np.zeros((2, 0)))

    def below(self, X: Array) -> Array:
        """Return the depth (n,) of positions (n_axes, n) below the surface above them [mm]."""
        depth = np.array(self.axis.down) @ (X - np.array(self.axis.origin)[:, None])
        return np.asarray(depth + self._height(self.axis.reached(X)))

    @property
    def profiles(self) -> Array:
        """Positions (n_axes, n) of the profiles, those of one station after the other [mm]."""
        S, D = np.meshgrid(self.station, self.depth, indexing="ij")
        if self.top.size:  # sides of elements follow a curved surface to less than this
            D = np.maximum(D, _INSIDE * self.depth.max(initial=0.0))
        return self.axis.place(S.ravel(), (D - self._height(S)).ravel())

    def _height(self, s: Array) -> Array:
        """Return the height of the surface over the line of the axis [mm]."""
        return np.interp(s, *self.top) if self.top.size else np.zeros_like(s)

    @property
    def map_axes(self) -> tuple[str, str]:
        """Names of the axes of the map: horizontal, vertical."""
        return ("z" if self.z.size else "x"), "y"

    @property
    def map_grid(self) -> tuple[Array, Array]:
        """Positions on the axes of the map: horizontal, vertical [mm]."""
        across, up = (getattr(self, name) for name in self.map_axes)
        return across, up

    @property
    def coordinates(self) -> dict[str, Any]:
        """The record's coordinates; grids without points are left out."""
        grids = {
            "x": self.x,
            "y": self.y,
            "z": self.z,
            "depth": self.depth,
            "station": self.station,
            "s": self.s,
        }
        return {
            # four components with two coordinates, six with three
            "component": np.array(components(2 * len(self.axis.origin))),
            "stage": np.array(self.stages),
            "body": np.array(list(self.surfaces)),
            **{name: grid for name, grid in grids.items() if len(grid)},
        }
