"""Where the results of a scene are taken."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from solver.results.quantities import declare
from solver.tensors import COMPONENTS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

X = declare(
    "x", "position along the surface from its middle", "mm", dims=("x",), beside={"axis": "X"}
)
Y = declare("y", "height above the surface", "mm", dims=("y",), beside={"axis": "Y"})
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
    """Places in a body: (2, n) [mm]."""

    body: str
    X: Array


class Axis(NamedTuple):
    """The straight line along a contact surface before loading.

    ``origin`` (2,) is its middle [mm], ``along`` the unit vector in which s grows, with the lower
    body on its right.
    """

    origin: tuple[float, float] = (0.0, 0.0)
    along: tuple[float, float] = (1.0, 0.0)

    def place(self, s: Array, depth: Array) -> Array:
        """Return positions (2, n) at ``s`` along the surface and a depth below it [mm]."""
        x, y = self.along
        ways = np.multiply.outer(np.array([x, y]), s) + np.multiply.outer(np.array([y, -x]), depth)
        return np.asarray(ways + np.array(self.origin)[:, None])

    def reached(self, X: Array) -> Array:
        """Return how far along the surface positions (2, n) are (n,) [mm]."""
        return np.asarray(np.array(self.along) @ (X - np.array(self.origin)[:, None]))


ALONG_X = Axis()
"""The axis of a horizontal surface at y = 0, the lower body below it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """Where the results of a scene are taken; independent of its mesh, so that runs compare.

    Attributes
    ----------
    x, y : map grid, along the contact surface from its middle and above it [mm]
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

    @property
    def coordinates(self) -> dict[str, Any]:
        """The record's coordinates; of a grid without points there is none."""
        grids = {
            "x": self.x,
            "y": self.y,
            "depth": self.depth,
            "station": self.station,
            "s": self.s,
        }
        return {
            "component": np.array(COMPONENTS),
            "stage": np.array(self.stages),
            "body": np.array(list(self.surfaces)),
            **{name: grid for name, grid in grids.items() if len(grid)},
        }
