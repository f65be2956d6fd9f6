"""The prism of a scene: its zone, and the window around the load, in shares of the contact."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.prism.track import PrismTrack
from solver.scenes.prism_effort import PrismSize

if TYPE_CHECKING:
    from solver.mesh.zone import Zone
    from solver.prism.section import Section

_AHEAD, _BEHIND, _LENGTH = 2.2, 2.6, 7.0
"""The window ahead and behind, and the length after which waves repeat, over half the length where
the load may act."""
_LEAST = 4
"""Least number of elements in half a zone or reach."""


def whole(length: float, size: float) -> float:
    """Return the length of the fewest elements that cover ``length``, at least 4 of them [mm]."""
    return size * max(_LEAST, math.ceil(round(length / size, 6)))


@dataclass(frozen=True, slots=True, kw_only=True)
class PrismWindow:
    """Where a prism may yield, across and along.

    Attributes
    ----------
    zone : where elements are small and may yield
    spacing : distance of stations [mm]
    reach : half the length where the load may act [mm]
    """

    zone: Zone
    spacing: float
    reach: float

    @property
    def length(self) -> float:
        """Length after which waves repeat, an even number of stations [mm]."""
        return 2 * self._stations(_LENGTH / 2) * self.spacing

    @property
    def size(self) -> PrismSize:
        """Numbers that tell the work of a pass."""
        return PrismSize(
            columns=self.zone.columns,
            rows=self.zone.rows,
            window=self._stations(_AHEAD) + self._stations(_BEHIND) + 1,
            waves=self._stations(_LENGTH / 2) + 1,
        )

    def track(
        self,
        section: Section,
        levels: int,
        *,
        length: float | None = None,
        span: float | None = None,
    ) -> PrismTrack:
        """Return the prism of a section whose first elements are those of the zone.

        Parameters
        ----------
        levels : levels of the far field
        length : after which waves repeat [mm]; by default long enough for a pass
        span : length of a prism clamped at both ends [mm]; None if it is endless
        """
        return PrismTrack(
            section,
            np.arange(len(section.weights)) < self.zone.columns * self.zone.rows,
            "running",
            length=length or self.length,
            spacing=self.spacing,
            ahead=self._stations(_AHEAD) * self.spacing,
            behind=self._stations(_BEHIND) * self.spacing,
            reach=self.reach,
            levels=levels,
            span=span,
        )

    def _stations(self, ratio: float) -> int:
        """Return the number of stations that cover a ratio of the reach."""
        # a whole number is not rounded up, whatever the unit of length makes of its last digit
        return math.ceil(round(ratio * self.reach / self.spacing, 6))
