"""A wheel of revolution that rolls along a surface: its gap, and its rigid slip.

The surface is a prism along x, so that its normals lie in planes across. The wheel may be yawed:
its axle is turned about y, and with it its shape. The track may be a ring of revolution: its own
gap to the straight prism is then part of the gap, and its turning part of the slip.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Interval, Unit

from solver.errors import ModelError
from solver.materials import Elasticity
from solver.parameters import Infinite, Length, check
from solver.rolling.rail.patch_grid import PatchGrid
from solver.typing import Array

_FAR = 10.0
"""Gaps are capped at this value [mm]; such points never come into contact."""
_STEPS, _CLOSE = 40, 1e-13
"""Largest number of Newton steps along a normal; length of the last step over the radius."""
_STEEP = 4.0
"""Largest slope of a profile for which the lowest place of a yawed wheel is within the search."""
_SAMPLES, _FINE = 33, 1e-3
"""Number of samples along x in the search for the lowest place, and their least distance [mm]."""
_LONGEST, _LEAST = 1.0, 0.1
"""Longest Newton step [mm], and least assumed rate at which a gap closes along a normal."""
_ASIDE = 1e-4
"""Half the distance of the two points of a difference that gives the slope of the wheel [mm]."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ProfiledWheel:
    """A wheel whose running circle touches y = 0 at x = 0 when its height is 0.

    Attributes
    ----------
    profile : (positions z) -> height of the wheel's lowest line above the height of the wheel, when
        its axle is along z [mm]; inf where there is no wheel
    radius : R, rolling radius where the profile is zero [mm]
    elasticity : elastic constants of its surface; with an infinite modulus it is rigid
    middle : position z of the vertical axis of yaw and spin [mm]
    yaw : angle by which the wheel is turned about y: a positive one turns its heading from x
        towards -z [rad]
    track_radius : radius of the track along x at y = 0 [mm]: inf where it is straight, positive
        where it bulges towards the wheel, negative where it is hollow
    """

    profile: Callable[[Array], Array]
    radius: Length
    elasticity: Elasticity
    middle: float = 0.0
    yaw: Annotated[float, Interval(gt=-math.pi / 4, lt=math.pi / 4), Unit("rad")] = 0.0
    track_radius: float | Infinite = np.inf

    def __post_init__(self) -> None:
        """Raise `ModelError` for radii that do not fit, or a yaw of a quarter turn."""
        check(self)
        if not (self.track_radius > 0 or -self.track_radius > self.radius):
            allowed = f"must be positive, or below {-self.radius:g}"
            raise ModelError("track_radius", self.track_radius, allowed)

    def lowest(self, z: Array) -> Array:
        """Return the position x (...) where the wheel is lowest over a line along x at ``z`` [mm].

        There a surface along x touches the wheel first: ahead of the axle, or behind it, on the
        slopes of a yawed wheel.
        """
        x = np.zeros_like(z)
        far = np.abs(z - self.middle).max(initial=0.0) + _STEEP * self.radius
        half = min(abs(np.tan(self.yaw)) * far, self.radius / 2)
        while half > _FINE:
            beside = np.linspace(-half, half, _SAMPLES).reshape(-1, *[1] * z.ndim)
            # of equal heights, as where there is no wheel, the middle one
            order = np.argsort(np.abs(beside.ravel()), kind="stable")
            places = (x + beside)[order]
            lowest = self.surface(places, z).argmin(axis=0)
            x = np.take_along_axis(places, lowest[None], axis=0)[0]
            half *= 2 / (_SAMPLES - 1)
        return x

    def surface(self, x: Array, z: Array) -> Array:
        """Return the height y (...) of the wheel's surface over places, inf where it is not [mm].

        Over a ring it is the height above the ring, from the straight surface. Raises `ModelError`
        for places beyond the radius.
        """
        rise = np.asarray(self.profile(self._axial(x, z)), dtype=float)
        here = np.isfinite(rise)
        rise = np.where(here, rise, 0.0)
        across = np.cos(self.yaw) * x - np.sin(self.yaw) * (z - self.middle)
        below, ring = (self.radius - rise) ** 2 - across**2, np.abs(self.track_radius + rise)
        if not ((below > 0) & (ring > np.abs(x))).all():
            reach = float(np.where(here, np.minimum(self.radius - rise, ring), np.inf).min())
            allowed = f"stations must lie within {reach:g} of x = 0"
            raise ModelError("ahead", float(np.abs(x).max()), allowed)
        curved = x**2 / (ring + np.sqrt(ring**2 - x**2)) * np.sign(self.track_radius)
        return np.asarray(np.where(here, self.radius - np.sqrt(below) + curved, np.inf))

    def above(self, x: Array, z: Array, y: Array, angle: Array) -> tuple[Array, Array, float]:
        """Return the gap to the wheel above places on a surface, along its normals.

        The gap is that of the wheel at a height at which it touches one of the places.

        Parameters
        ----------
        x, z, y : (...) positions, arrays that fit together [mm]
        angle : (...) slope angles of the surface [rad]

        Returns
        -------
        gap (...), at most 10 [mm]; position z of the wheel's surface there (...); that height [mm]
        """
        x, z, y, angle = np.broadcast_arrays(x, z, y, angle)
        vertical = self.surface(x, z) - y
        height = -float(vertical.min())
        sin, cos = np.sin(angle), np.cos(angle)

        def left(t: Array) -> Array:
            return self.surface(x, z - t * sin) + height - y - t * cos

        # the first root along the normal lies between what was found open and what was closed
        t, last = np.zeros_like(z), np.full_like(z, _FAR)
        first, gap = t, vertical + height
        for _ in range(_STEPS):
            beside = [self.surface(x, z - t * sin + side) for side in (-_ASIDE, _ASIDE)]
            with np.errstate(invalid="ignore"):
                slope = (beside[1] - beside[0]) / (2 * _ASIDE)
                rate = np.maximum(np.nan_to_num(cos + sin * slope, posinf=1.0), _LEAST)
            step = np.nan_to_num(gap, posinf=_FAR) / rate
            t_new = np.minimum(t + np.clip(step, -_LONGEST, _LONGEST), _FAR)
            t_new = np.where((first <= t_new) & (t_new <= last), t_new, (first + last) / 2)
            done = np.abs(t_new - t).max() <= _CLOSE * self.radius
            t, gap = t_new, left(t_new)
            if done:
                break
            first, last = np.where(gap > 0, t, first), np.where(gap > 0, last, t)
        return t, z - t * sin, height

    def _axial(self, x: Array, z: Array) -> Array:
        """Return the position along the axle, as profiles take it."""
        along = np.sin(self.yaw) * x + np.cos(self.yaw) * (z - self.middle)
        return np.asarray(self.middle + along)

    def _at(self, grid: PatchGrid) -> tuple[Array, Array]:
        """Return gap at height 0 [mm], and rolling radius of the wheel above over R, (n, m).

        At height d the gap is larger by d cos(angle). It is exact at the height at which the
        undeformed bodies touch. Raises `ModelError` where there is no wheel above.
        """
        z, y, angle = grid.surface
        x = grid.x[:, None]
        if not np.isfinite(self.surface(x, z)).all():
            allowed = "must be finite at every vertex and between"
            raise ModelError("profile", f"{z[0]:g} to {z[-1]:g} mm", allowed)
        gap, at, height = self.above(x, z, y, angle)
        rise = np.asarray(self.profile(self._axial(x, at)), dtype=float)
        arc = 1 - np.where(np.isfinite(rise), rise, y) / self.radius
        mean = grid.hats.mean.T
        return gap @ mean - height * np.cos(grid.angle), arc @ mean

    def rolling(self, grid: PatchGrid) -> tuple[Array, Array]:
        """Return slip and gap of the rigid wheel: (n, m, 3) at rest, (4, n, m, 3) of its motions.

        Slip is that of the surface over the wheel while the load advances by one station, along x
        and across; the gap lies between, as the normal does among local axes. Motions are height
        [mm], longitudinal creepage, lateral creepage, spin [1/mm]. With a wheel that turns by w and
        advances by V per time, longitudinal creepage is 1 - w R / V, lateral creepage its velocity
        along z over V, spin its rotation about -y over V. The slip by yaw is part of that at rest.
        """
        h, sin, cos = grid.spacing, np.sin(grid.angle), np.cos(grid.angle)
        x, z = grid.x[:, None], grid.z - self.middle
        gap, arc = self._at(grid)
        turn, path = 1 / self.track_radius, grid.hats.mean @ grid.surface[1]  # of a ring
        ahead, aside = np.cos(self.yaw), np.sin(self.yaw)
        # the velocity of the wheel's surface over w R, about the axle (aside, 0, ahead)
        along, up, across = ahead * arc, (ahead * x - aside * z) / self.radius, -aside * arc
        turned = up * sin + across * cos
        rest = np.zeros((grid.stations, len(z), 3))
        rest[..., 0], rest[..., 1] = h * (along - 1 - turn * path), gap
        rest[..., 2] = h * (turned + turn * x * sin)
        motions = np.zeros((4, *rest.shape))
        motions[0, ..., 1] = cos
        motions[1, ..., 0], motions[1, ..., 2] = -h * along, -h * turned
        motions[2, ..., 2] = -h * cos
        motions[3, ..., 0], motions[3, ..., 2] = h * z, -h * cos * x
        return rest, motions
