"""The prism of a scene: its zone, and the window around the load, in shares of the contact."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from solver.prism.track import PrismTrack

if TYPE_CHECKING:
    from solver.mesh.zone import Zone
    from solver.prism.section import Section

_AHEAD, _BEHIND, _LENGTH = 2.2, 2.6, 7.0
"""The window ahead and behind, and the length after which waves repeat, over half the length where
the load may act."""
_LEAST = 4
"""Least number of elements in half a zone or reach."""


def whole(length: float, size: float) -> float:
    """Return the least whole number of elements of a size that covers a length, 4 or more [mm]."""
    return size * max(_LEAST, math.ceil(round(length / size, 6)))


def windowed(
    section: Section, zone: Zone, *, spacing: float, reach: float, levels: int
) -> PrismTrack:
    """Return the prism of a section, with the window around the load.

    Parameters
    ----------
    spacing, reach : distance of stations; half the length where the load may act [mm]
    levels : levels of the far field
    """
    h = spacing
    return PrismTrack(
        section, np.arange(len(section.weights)) < zone.columns * zone.rows, "running",
        length=2 * h * math.ceil(_LENGTH * reach / h / 2), spacing=h,
        ahead=h * math.ceil(_AHEAD * reach / h), behind=h * math.ceil(_BEHIND * reach / h),
        reach=reach, levels=levels,
    )  # fmt: skip
