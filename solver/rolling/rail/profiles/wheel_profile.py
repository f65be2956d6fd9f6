"""Profiles of wheels: the height of the running surface over the position across.

Coordinates are those of the track, z across and y up, for a wheel on the right rail: z points away
from the middle of the track, the flange is at z < 0. The point of the running circle is (0, 0); the
wheel lies above the curve.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from solver.errors import ModelError
from solver.rolling.rail.profiles.points import checked_points
from solver.typing import Array

Curve = Callable[[Array, int], Array]  # height or derivative of this order, at z


_S1002 = {
    "tread": (
        0.0,
        -3.358537058e-02,
        1.565681624e-03,
        -2.810427944e-05,
        5.844240864e-08,
        -1.562379023e-08,
        5.309217349e-15,
        -5.957839843e-12,
        2.646656573e-13,
    ),
    "root": (
        -4.320221063e03,
        -1.038384026e03,
        -1.065501873e02,
        -6.051367875,
        -2.054332446e-01,
        -4.169739389e-03,
        -4.687195829e-05,
        -2.252755540e-07,
    ),
}
"""Coefficients of zones B and C of EN 13715, depth below the running circle over z [mm]."""


@dataclass(frozen=True, slots=True)
class WheelProfile:
    """A curve in pieces.

    Attributes
    ----------
    bounds : (n + 1,) ends of the pieces, increasing [mm]
    pieces : the n pieces, functions of z and of the order of the derivative, 0 to 2
    """

    bounds: tuple[float, ...]
    pieces: tuple[Curve, ...]

    def height(self, z: Array) -> Array:
        """Return the height (...) at positions ``z`` [mm]; beyond the ends it is inf."""
        return self._at(z, 0)

    def slope(self, z: Array) -> Array:
        """Return the slope dy/dz (...) at positions ``z``; beyond the ends it is 0."""
        return self._at(z, 1)

    def curvature(self, z: Array) -> Array:
        """Return the curvature (...) at positions ``z`` [1/mm]; positive where the centre is above.

        Beyond the ends it is 0.
        """
        return self._at(z, 2) / (1 + self._at(z, 1) ** 2) ** 1.5

    def _at(self, z: Array, order: int) -> Array:
        z = np.asarray(z, dtype=float)
        out = np.full(z.shape, 0.0 if order else np.inf)
        piece = np.searchsorted(self.bounds, z, side="right") - 1
        piece = np.where(z == self.bounds[-1], len(self.pieces) - 1, piece)
        for k, curve in enumerate(self.pieces):
            here = piece == k
            out[here] = curve(z[here], order)
        return out


def s1002() -> WheelProfile:
    """Return the profile S1002 from the back of the flange to the end of the tread, -70 to 60 mm.

    Its flange is 28 mm high. Its slope is 0.0336 on the running circle, and 1/15 from 32.158 mm on.
    The coefficients are rounded: zones meet within 0.0002 mm, and 0.00001 in slope.

    References
    ----------
    EN 13715:2006, annex A: zones A to H, here from H to A
    """
    return WheelProfile(
        (
            -70.0,
            -62.764705882,
            -49.662510381,
            -39.764473993,
            -38.426669071,
            -35.0,
            -26.0,
            32.15796,
            60.0,
        ),
        (
            _arc(20.5, -49.5, -9.519259302, below=True),
            _arc(12.0, -55.0, -16.0, below=True),
            _arc(20.0, -58.558326413, -8.834924130, below=True),
            _polynomial(93.576667419, 2.747477419),
            _arc(13.0, -26.210665, -16.446, below=False),
            _polynomial(*(-each for each in _S1002["root"])),
            _polynomial(*(-each for each in _S1002["tread"])),
            _polynomial(-1.364323640, 1 / 15),
        ),
    )


def conical(slope: float, half_width: float = 70.0) -> WheelProfile:
    """Return a cone: its height is slope times z, up to ``half_width`` on either side [mm]."""
    if not 0 < half_width < math.inf:
        raise ModelError("half_width", half_width, "must be positive [mm]")
    return WheelProfile((-half_width, half_width), (_polynomial(0.0, slope),))


def crowned(radius: float, half_width: float = 70.0) -> WheelProfile:
    """Return a cylinder with a crown of this radius, lowest at z = 0; inf makes it straight [mm].

    It ends at ``half_width``, or before at nine tenths of the radius.
    """
    if not radius > 0:
        raise ModelError("radius", radius, "must be positive [mm]")
    if math.isinf(radius):
        return conical(0.0, half_width)
    end = min(half_width, 0.9 * radius)
    return WheelProfile((-end, end), (_arc(radius, 0.0, radius, below=True),))


def measured(points: Array) -> WheelProfile:
    """Return the cubic spline through points.

    Parameters
    ----------
    points : (2, n) positions z, increasing, and heights y [mm]; measurements with noise must be
        smoothed before, since contact sees the curvature

    Raises
    ------
    ModelError
        for ``points``, if they are fewer than four or z does not increase
    """
    z, y = checked_points(points)
    spline: Curve = scipy.interpolate.CubicSpline(z, y)
    return WheelProfile((float(z[0]), float(z[-1])), (spline,))


def _polynomial(*coefficients: float) -> Curve:
    """Return the polynomial of these coefficients, the constant first."""
    orders = [np.polynomial.Polynomial(coefficients)]
    for _ in range(2):
        orders.append(orders[-1].deriv())
    return lambda z, order: np.asarray(orders[order](z))


def _arc(radius: float, z0: float, y0: float, *, below: bool) -> Curve:
    """Return the half circle below or above its centre (z0, y0)."""
    sign = -1.0 if below else 1.0

    def curve(z: Array, order: int) -> Array:
        q = np.sqrt(np.maximum(radius**2 - (z - z0) ** 2, (1e-9 * radius) ** 2))
        return (y0 + sign * q, -sign * (z - z0) / q, -sign * radius**2 / q**3)[order]

    return curve
