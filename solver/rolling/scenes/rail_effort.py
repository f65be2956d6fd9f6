"""The work of steady passes over a prism, told from the size of its zone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from solver.rolling.rail.section import Section
from solver.scenes.effort import Effort

_FIRST, _FACTOR = 0.5, 2.2e-5
"""Seconds of a set-up: at least, and per wave and unknown of the zone."""
_LEAST_BYTES, _BYTES = 1.4e8, 4400.0
"""Bytes of a path: at least, and per wave and unknown of the zone."""
_STILL, _POINT = 0.01, 1.5e-6
"""Seconds of a pass where nothing yields: at least, and per point and station of the window."""
_YIELDS = 28.0
"""Work of all yielding under a wheel that rolls again and again, in passes where nothing yields.
Half of it is in the first pass, a quarter in the second, and so on."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PrismSize:
    """The size of a zone that may yield; seconds are those of one core, measured on rails.

    Attributes
    ----------
    columns, elements : elements of the zone, along its surface and in all
    window : stations where the material may yield
    waves : waves along the prism
    """

    columns: int
    elements: int
    window: int
    waves: int

    @property
    def set_up(self) -> float:
        """Seconds to set up the prism."""
        return _FIRST + _FACTOR * self._factorised

    @property
    def memory(self) -> float:
        """Most bytes of a path at a time, measured on rails and a raceway."""
        return _LEAST_BYTES + _BYTES * self._factorised

    @property
    def _factorised(self) -> int:
        """Unknowns of the zone in all waves."""
        along, up = self.columns, self.elements / self.columns
        nodes = round((along + 1) * (up + 1) + along * (up + 1) + up * (along + 1))
        return self.waves * 3 * nodes

    def passes(self, count: int, turns: int, *, scattered: bool) -> float:
        """Return the seconds of passes of ``turns`` loads in turn.

        If they are scattered, ever heavier ones come along, ever more rarely.
        """
        still = _STILL + _POINT * 4 * self.elements * self.window
        yields = _YIELDS * turns * (1 - 0.5 ** (count / turns))
        return still * (count + yields * (1 + math.log(count) * scattered))


def effort_of(
    section: Section,
    size: PrismSize,
    passes: Sequence[float],
    *,
    turns: int = 1,
    scattered: bool = False,
) -> Effort:
    """Return the work of so many passes over a prism with this section; see `PrismSize.passes`."""
    count = int(max(passes))
    return Effort(
        elements=len(section.weights),
        unknowns=len(section.free),
        increments=count,
        most_increments=count,
        seconds=size.passes(count, turns, scattered=scattered),
        set_up=size.set_up,
        memory=size.memory,
    )
