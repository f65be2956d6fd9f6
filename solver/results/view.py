"""Where the results of a scene are taken."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

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


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """Where the results of a scene are taken; independent of its mesh, so that runs compare.

    Attributes
    ----------
    x, y : map grid [mm]
    depth, station : profiles go down to ``depth`` below the surface at x = ``station`` [mm]
    s : positions along the contact surface from its centre [mm]
    profile_body : the body whose profiles are taken
    surfaces : body -> boundary that is its contact surface, in the order of the dimension
    stages : states whose contact is recorded, by the names of the program's stages
    loaded, unloaded : those of them that are taken as the states under load and after release
    following : those of them in which ``s`` is zero where the load is, not at x = 0
    symmetric : whether the bodies are one half of a model symmetric about x = 0
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

    @property
    def coordinates(self) -> dict[str, Any]:
        """The record's coordinates."""
        return {
            "component": np.array(COMPONENTS),
            "stage": np.array(self.stages),
            "body": np.array(list(self.surfaces)),
            "x": self.x,
            "y": self.y,
            "depth": self.depth,
            "station": self.station,
            "s": self.s,
        }
