"""A ball, meshed ever finer towards the point where it touches a plane."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.mesh.grids import graded, grid, mapped

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from skfem import Mesh

    Array = NDArray[np.float64]

_EXTENT = 6.0
"""Side of the grid that is bent into the ball / radius: it leaves out a cap on the far side."""


def graded_lines(extent: float, fine: float, side: float, growth: float) -> Array:
    """Return lines from 0 to ``extent``: of one ``side`` as far as ``fine``, then growing [mm]."""
    near = np.linspace(0.0, fine, max(1, round(fine / side)) + 1)
    beyond = graded(extent - fine, side, growth, extent / 4)[1:]
    return np.concatenate([near, fine + beyond])


def ball_lines(radius: float, fine: float, side: float, growth: float) -> Array:
    """Return the lines of the grid that is bent into a ball [mm]."""
    return graded_lines(_EXTENT * radius, fine, side, growth)


def onto_disc(x: Array, radius: float) -> Array:
    """Return points (2, n), those of either half-plane mapped on a disc in it that touches y = 0.

    The Moebius map ``w = z / (1 - i z / 2 R)`` leaves what is near the origin where it is, and
    takes the line y = 0 to the circle. It keeps angles, so that squares stay squares.
    """
    side = np.where(x[1].mean() < 0, -1.0, 1.0)
    z = x[0] + 1j * side * x[1]
    w = z / (1 - 0.5j * z / radius)
    return np.stack([w.real, side * w.imag])


def ball(radius: float, fine: float, side: float, growth: float, *, above: bool) -> Mesh:
    """Return half of a section through a ball that touches y = 0 at the origin; its axis is x = 0.

    It lies ``above`` or below. Of its boundaries ``left`` is the axis. Of ``bottom`` and ``top``
    the one at the origin is the surface; the other one and ``right`` are where a cap is left out,
    from 1.5 radii away from the origin on the axis to 1.8 at the surface.

    Parameters
    ----------
    radius : of the ball [mm]
    fine : distance from the origin within which elements are of one size [mm]
    side : their side [mm]
    growth : ratio of neighbouring sides beyond
    """
    lines = ball_lines(radius, fine, side, growth)
    across = lines if above else -lines[::-1]
    return mapped(grid(lines, across), lambda x: onto_disc(x, radius))


def cap_area(radius: float) -> float:
    """Return the area around the axis of the surface where the cap is left out [mm2]."""
    extent = _EXTENT * radius
    way, weight = np.polynomial.legendre.leggauss(60)
    along, weight = extent * (way + 1) / 2, extent * weight / 2
    area = 0.0
    for z in (along + 1j * extent, extent + 1j * along):
        bent = 1 - 0.5j * z / radius
        area += float(weight @ (2 * np.pi * (z / bent).real / np.abs(bent) ** 2))
    return area
