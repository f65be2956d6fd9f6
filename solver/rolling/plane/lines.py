"""Grid lines of tracks with and without ends, and of wheels."""

from __future__ import annotations

import math

import numpy as np

from solver.errors import ModelError
from solver.mesh.lines import continued, graded
from solver.typing import Array

_AHEAD, _BEHIND, _DEEP = 3.0, 5.0, 4.0
"""Extent of the window ahead of, behind and below the load, over the half-width. With only 3
half-widths behind a load with shear, stress near the surface has an error of 5 MPa in 500, because
points at yield still flow there. With elements that grow behind the load the error is 30 MPa:
points flow too much. Below, element sides grow faster than by ``growth``."""
_FAR = 1600.0
"""Distance of the sides and the bottom from the load, over the half-width. Half of this distance
changes stress by 1 MPa in 500."""
_FAR_GROWTH = 2.0
"""Ratio of neighbouring element sides outside the window. It changes stress by 0.1 MPa in 500
against a fine mesh, in a sixth of the time."""
MOST_COLUMNS = 3000
"""Largest number of elements along the window."""


def track_lines(
    half_width: float, element_size: float, growth: float, reach: float = 1.0
) -> tuple[Array, Array]:
    """Return the positions of the grid lines x = const and y = const [mm].

    Parameters
    ----------
    half_width : half-width of the contact [mm]
    element_size : side of the elements in the window [mm]
    growth : ratio of neighbouring element sides in depth
    reach : factor of the usual length and depth of the window
    """
    a, h = half_width, element_size
    ahead, behind = window_elements(a, h, reach)
    window: Array = h * np.arange(-behind, ahead + 1, dtype=float)
    far = _FAR * a
    x = continued(window, far, h, _FAR_GROWTH, far / 2, both=True)
    near = graded(window_depth(a, reach), h, growth, window_depth(a, reach))
    return x, -continued(near, far, near[-1] - near[-2], _FAR_GROWTH, far / 2)[::-1]


def window_elements(a: float, h: float, reach: float = 1.0) -> tuple[int, int]:
    """Return the numbers of elements in the window ahead of and behind the load.

    Raises
    ------
    ModelError
        for ``element_size``, if there are too many, or it is more than half the half-width
    """
    if not 0 < h <= a / 2:
        allowed = f"must be at most {a / 2:.4g} mm, half the half-width of the mesh"
        raise ModelError("element_size", h, allowed)
    ahead, behind = (math.ceil(each * reach * a / h) for each in (_AHEAD, _BEHIND))
    if (columns := ahead + behind) > MOST_COLUMNS:
        allowed = f"makes {columns} elements along a half-width of {a:g} mm; at most {MOST_COLUMNS}"
        raise ModelError("element_size", h, allowed)
    return ahead, behind


def window_depth(a: float, reach: float = 1.0) -> float:
    """Return the depth of the window [mm]."""
    return _DEEP * reach * a


_RECORDED = 30
"""Least number of positions of results per Hertz half-width."""
_ROUNDING = 1e-12
_HUB = 0.3
"""Ratio of the radius of the rigid hub to that of the wheel."""


def half_space_nodes(
    fine: float, far: float, a: float, h: float, growth: float
) -> tuple[Array, Array]:
    """Return x and y of the grid lines of the half-space [mm].

    Parameters
    ----------
    fine : half the length with elements of side ``h`` [mm]
    far : depth, and width beyond the fine length [mm]
    a : Hertz half-width [mm]
    growth : ratio of neighbouring element sides in depth
    """
    track = np.linspace(-fine, fine, 2 * math.ceil(fine / h) + 1)
    x = continued(track, far, h, 1.4, far / 4, both=True)
    deep = graded(_DEEP * a, h, growth, _DEEP * a)
    return x, -continued(deep, far - deep[-1], deep[-1] - deep[-2], 1.4, far / 4)[::-1]


def recorded_step(a: float) -> float:
    """Return the distance between positions of results along a track of given length [mm].

    It is 0.25 mm, halved until 30 positions lie in the Hertz half-width ``a`` [mm].
    """
    return 0.25 / 2 ** max(0, math.ceil(math.log2(0.25 * _RECORDED / a)))


def wheel_nodes(R: float, reach: float, h: float) -> tuple[Array, Array]:
    """Return angles [rad] and radii [mm] of the grid lines of a wheel of radius ``R``.

    Up to the arc length ``reach`` from the lowest point, elements have the side ``h``.
    """
    rim = np.linspace(-reach, reach, rim_elements(reach, h) + 1)
    angle = continued(rim, math.pi * R - reach, h, 1.5, 0.3 * R, both=True) / R
    return angle, R - graded((1 - _HUB) * R, h, 1.3, 0.2 * R)[::-1]


def rim_elements(reach: float, h: float) -> int:
    """Return the number of elements of side ``h`` along the part of the rim that may touch.

    Rounding of ``reach / h`` must not add an element: a steady pass needs equal sides on rim and
    track.
    """
    return 2 * math.ceil(reach / h * (1 - _ROUNDING))
