"""The surface of a prism where a load may touch it: hats across times stations along."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Interval

from solver.errors import ModelError
from solver.kinds import check
from solver.parameters import Length
from solver.rolling.rail.hats import SHARES, Hats
from solver.typing import Array

_FEWEST = 3
"""Smallest number of vertices and of stations: the outermost ones must not touch."""
_CUBIC = (
    [(t * (1 - t) ** 2, -(t**2) * (1 - t)) for t in SHARES],
    [((1 - t) * (1 - 3 * t), t * (3 * t - 2)) for t in SHARES],
)
"""Heights and slopes at the points of the hats, over the length of an edge, of the two cubics that
are 0 at both ends, and have the slope 1 at one of them and 0 at the other."""


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
