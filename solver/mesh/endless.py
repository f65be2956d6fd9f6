"""The lines of the mesh of a track without ends: a window around the load, and what is far away."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from solver.mesh.lines import continued, graded

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

_AHEAD, _BEHIND, _DEEP = 3.0, 5.0, 4.0
"""Reach of the window from the load / half-width. A window that ends 3 half-widths behind a load
that pushes errs by 5 MPa in 500 near the surface, as rows at yield still flow there; elements that
grow behind the load make them flow too much, and err by 30."""
_FAR = 1600.0
"""Distance of the sides and the bottom / half-width. Half of it moves stress by 1 MPa in 500."""
_FAR_GROWTH = 2.0
"""Ratio of neighbouring element sides outside the window: 0.1 MPa in 500, a sixth of the time."""
MOST_COLUMNS = 3000
"""Most elements along the window."""


def track_lines(
    half_width: float, element_size: float, growth: float, reach: float = 1.0
) -> tuple[Array, Array]:
    """Return where the lines x = const and y = const of the mesh are [mm].

    Parameters
    ----------
    half_width : of the contact [mm]
    element_size : side of the elements in the window [mm]
    growth : ratio of neighbouring sides in depth
    reach : how much longer and deeper the window is than usual
    """
    a, h = half_width, element_size
    ahead, behind = window_elements(a, h, reach)
    window: Array = h * np.arange(-behind, ahead + 1, dtype=float)
    far = _FAR * a
    x = continued(window, far, h, _FAR_GROWTH, far / 2, both=True)
    near = graded(window_depth(a, reach), h, growth, window_depth(a, reach))
    return x, -continued(near, far, near[-1] - near[-2], _FAR_GROWTH, far / 2)[::-1]


def window_elements(a: float, h: float, reach: float = 1.0) -> tuple[int, int]:
    """Return the elements of the window before and behind the load."""
    ahead, behind = (math.ceil(each * reach * a / h) for each in (_AHEAD, _BEHIND))
    return ahead, behind


def window_depth(a: float, reach: float = 1.0) -> float:
    """Return how deep the window is [mm]."""
    return _DEEP * reach * a
