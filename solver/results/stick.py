"""Where the contact sticks under load."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.results.quantities import declare

if TYPE_CHECKING:
    from solver.results.look import Look, Values
    from solver.results.touch import ContactPoints

STICK_HALF_WIDTH = declare(
    "stick_half_width", "half-width of the part of the contact that sticks under load", "mm"
)
STICK_FRACTION = declare(
    "stick_fraction", "half-width that sticks / half-width of the contact, under load"
)


def stick(look: Look) -> Values:
    """Return how much of the contact sticks: nothing without friction, NaN without contact."""
    from solver.results.touch import contact_points  # only who computes needs the solver

    points = contact_points(look.touch, look.loaded)
    if points is None:
        return {STICK_HALF_WIDTH: np.nan, STICK_FRACTION: np.nan}
    stuck = stick_half_width(points, symmetric=look.view.symmetric)
    whole, _ = look.touch.extent(look.loaded)
    return {STICK_HALF_WIDTH: stuck, STICK_FRACTION: stuck / whole if whole else np.nan}


def stick_half_width(points: ContactPoints, *, symmetric: bool) -> float:
    """Return the half-width of the part that sticks [mm].

    Its ends are half-way between the last point that sticks and the first that slips, so that they
    are known to half an element. Where no point sticks it is narrower than an element: 0.
    """
    stuck = np.flatnonzero(points.sticking)
    if not len(stuck):
        return 0.0

    def end(at: int, beyond: int) -> float:
        slips = 0 <= beyond < len(points.x) and points.closed[beyond]
        return float((points.x[at] + points.x[beyond]) / 2 if slips else points.x[at])

    right = end(stuck[-1], stuck[-1] + 1)
    return right if symmetric else (right - end(stuck[0], stuck[0] - 1)) / 2
