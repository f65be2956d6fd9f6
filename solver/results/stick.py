"""Size of the stick zone of the contact under load."""

from __future__ import annotations

import numpy as np

from solver.results.contact_result import ContactResult
from solver.results.outputs import output
from solver.results.quantities import declare
from solver.results.run import FinishedRun, Values

STICK_HALF_WIDTH = declare(
    "stick_half_width", "half-width of the stick zone of the contact under load", "mm"
)
STICK_FRACTION = declare(
    "stick_fraction", "ratio of the half-width of the stick zone to that of the contact, under load"
)


@output("stick", "contact")
def stick(run: FinishedRun) -> Values:
    """Return the size of the stick zone: zero without friction, NaN without contact."""
    acting = run.acting(run.loaded)
    if acting.points is None:
        return {STICK_HALF_WIDTH: np.nan, STICK_FRACTION: np.nan}
    stuck = stick_half_width(acting.points, symmetric=run.view.symmetric)
    return {
        STICK_HALF_WIDTH: stuck,
        STICK_FRACTION: stuck / whole if (whole := acting.half_width) else np.nan,
    }


def stick_half_width(points: ContactResult, *, symmetric: bool) -> float:
    """Return the half-width of the stick zone [mm].

    Each end is half-way between the last point that sticks and the first that slips, accurate to
    half an element. If no point sticks, the zone is narrower than an element, and the result is 0.
    """
    stuck = np.flatnonzero(points.sticking)
    if not len(stuck):
        return 0.0

    def end(at: int, beyond: int) -> float:
        slips = 0 <= beyond < len(points.s) and points.closed[beyond]
        return float((points.s[at] + points.s[beyond]) / 2 if slips else points.s[at])

    right = end(stuck[-1], stuck[-1] + 1)
    return right if symmetric else (right - end(stuck[0], stuck[0] - 1)) / 2
