"""The work of a loading path of the rolling scene."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

from solver.loading.program import HALVINGS
from solver.rolling.plane.lines import half_space_nodes, rim_elements, track_lines, wheel_nodes
from solver.rolling.scenes.rolling_model import track_grid
from solver.rolling.scenes.rolling_parameters import RollingParameters
from solver.scenes.effort import Effort
from solver.scenes.grid_size import grid_size

_DECIDED = 3
"""Smallest number of passes after which a shakedown state may be decided."""


def effort(parameters: RollingParameters, passes: Sequence[float]) -> Effort:
    """Return the work of rolling up to the largest number of passes."""
    elements, unknowns = _size(parameters)
    if parameters.endless:
        count = int(max(passes))
        least = min(count, _DECIDED) if parameters.until == "decided" else count
        return Effort(elements=elements, unknowns=unknowns, increments=least, most_increments=count)
    schedule = parameters.schedule
    fixed = schedule.press * (1 + schedule.driven) + schedule.release
    rolled = 2 * schedule.half_steps
    n = int(max(passes))
    # the first pass is repeated for each halving; the other passes use the last halving
    times = [2**k for k in range(HALVINGS + 1 if parameters.advance_tolerance else 1)]
    first = sum(fixed + rolled * each for each in times)
    return Effort(
        elements=elements,
        unknowns=unknowns,
        increments=n * (fixed + rolled),
        most_increments=first + (n - 1) * (fixed + rolled * times[-1]),
    )


def _size(parameters: RollingParameters) -> tuple[int, int]:
    """Return the elements, and the unknowns of the half-space and of the wheel's rim.

    Those of the rim do not count in steady passes.
    """
    p = parameters
    if p.endless:
        elements, unknowns = _endless(p.mesh_width, p.element_size, p.growth, p.element)
    else:
        elements, unknowns = _track(*track_grid(p), p.element)
    if p.load == "hertz":
        return elements, unknowns
    own, rim = _wheel(p.radius, p.widest.reach, p.element_size, p.element)
    if p.endless:
        return elements + own, unknowns
    hub = 1 if p.guided else 2  # its height, and its rotation
    return elements + own, unknowns + rim + hub


@lru_cache(maxsize=4096)
def _track(
    fine: float, far: float, a: float, h: float, growth: float, element: str
) -> tuple[int, int]:
    """Return elements and unknowns of the half-space."""
    x, y = half_space_nodes(fine, far, a, h, growth)
    return _held(len(x), len(y), element)


@lru_cache(maxsize=4096)
def _endless(a: float, h: float, growth: float, element: str) -> tuple[int, int]:
    """Return elements and unknowns of the half-space of steady passes."""
    x, y = track_lines(a, h, growth)
    return _held(len(x), len(y), element)


def _held(columns: int, rows: int, element: str) -> tuple[int, int]:
    """Return elements and unknowns of a half-space of so many grid lines.

    x is held at both sides, x and y at the bottom.
    """
    track = grid_size(columns - 1, rows - 1, element)
    # at both lower corners x is held by the side and by the bottom
    return track.elements, 2 * track.nodes - 2 * track.up - 2 * track.along + 2


@lru_cache(maxsize=4096)
def _wheel(radius: float, reach: float, h: float, element: str) -> tuple[int, int]:
    """Return the elements of the wheel, and the unknowns of its rim."""
    angle, rings = wheel_nodes(radius, reach, h)
    ring = grid_size(len(angle) - 1, len(rings) - 1, element)
    return ring.elements, 2 * grid_size(rim_elements(reach, h), 0, element).along
