"""The section of a rail given by a mesh, as plain numbers."""

from __future__ import annotations

from typing import NamedTuple

RUNNING, FOOT = "running", "foot"
"""Lines that a section must have: where the wheel may touch, and where the foundation acts."""


class SectionMesh(NamedTuple):
    """A mesh of quadrilaterals with the lines `RUNNING` and `FOOT`, as plain numbers.

    Attributes
    ----------
    points : positions z, y [mm]
    cells : numbers of the points of each element, from 0 on: four corners, or with the middles of
        the sides
    running, foot : pairs of corners, the edges of the lines
    """

    points: tuple[tuple[float, float], ...]
    cells: tuple[tuple[int, ...], ...]
    running: tuple[tuple[int, int], ...]
    foot: tuple[tuple[int, int], ...]

    @property
    def told(self) -> str:
        """The mesh in a few words, for errors."""
        return f"a mesh of {len(self.cells)} elements"
