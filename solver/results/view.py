"""Where the results of a scene are taken."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from solver.results.quantities import declare, in_space
from solver.tensors import components

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

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
    """Places in a body: (2, n), or (3, n) where the body has three coordinates [mm]."""

    body: str
    X: Array


class Axis(NamedTuple):
    """The straight line along a contact surface before loading.

    ``origin`` is its middle [mm], ``along`` the unit vector in which s grows. Both have as many
    coordinates as places of the bodies: with two the lower body is on the right of the line, with
    three below it, down along y.
    """

    origin: tuple[float, ...] = (0.0, 0.0)
    along: tuple[float, ...] = (1.0, 0.0)

    @property
    def down(self) -> tuple[float, ...]:
        """The unit vector from the surface into the lower body."""
        x, y, *z = self.along
        return (0.0, -1.0, 0.0) if z else (y, -x)

    def place(self, s: Array, depth: Array) -> Array:
        """Return positions (n_axes, n) at ``s`` along the surface and a depth below it [mm]."""
        ways = np.multiply.outer(np.array(self.along), s)
        ways = ways + np.multiply.outer(np.array(self.down), depth)
        return np.asarray(ways + np.array(self.origin)[:, None])

    def reached(self, X: Array) -> Array:
        """Return how far along the surface positions (n_axes, n) are (n,) [mm]."""
        return np.asarray(np.array(self.along) @ (X - np.array(self.origin)[:, None]))


ALONG_X = Axis()
"""The axis of a horizontal surface at y = 0, the lower body below it."""
ACROSS_TRACK = Axis((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
"""The axis across a horizontal track along x, at x = 0: that of a section in z and y."""
NOWHERE = np.zeros(0)
"""The positions of a grid that a view does not have."""


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """Where the results of a scene are taken; independent of its mesh, so that runs compare.

    Attributes
    ----------
    x, y : map grid, along the contact surface from its middle and above it [mm]
    z : in the place of x for a section across the track, whose ``axis`` is `ACROSS_TRACK` [mm]
    depth, station : profiles go down to ``depth`` below the surface at s = ``station`` [mm]
    s : positions along the contact surface from its centre [mm]
    axis : the line that s and x run along
    profile_body : the body whose profiles are taken
    surfaces : body -> boundary that is its contact surface, in the order of the dimension
    stages : states whose contact is recorded, by the names of the program's stages
    loaded, unloaded : those of them that are taken as the states under load and after release;
        ``unloaded`` is empty where the bodies are not released
    following : those of them in which ``s`` is zero where the load is, not at x = 0
    symmetric : whether the bodies are one half of a model symmetric about s = 0
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

    @property
    def map_axes(self) -> tuple[str, str]:
        """Names of the axes of the map: that across, and that up."""
        return ("z" if self.z.size else "x"), "y"

    @property
    def map_grid(self) -> tuple[Array, Array]:
        """Positions on the axes of the map: across, and up [mm]."""
        across, up = (getattr(self, name) for name in self.map_axes)
        return across, up

    @property
    def coordinates(self) -> dict[str, Any]:
        """The record's coordinates; of a grid without points there is none."""
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
