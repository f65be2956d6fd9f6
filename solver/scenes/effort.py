"""The work of a loading path: elements, unknowns and increments."""

from __future__ import annotations

from dataclasses import dataclass

_FIRST, _PER_UNKNOWN, _EXPONENT = 4e7, 3500.0, 1.15
"""Bytes of a path in two dimensions: at least, and per unknown, to which power. Measured on endless
tracks of 14 000 to 81 000 unknowns; a punch needs half as much."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """The work of one loading path.

    Attributes
    ----------
    elements : number in all bodies, also in those condensed to their surface
    unknowns : displacement unknowns that no support holds, as `System.n_unknowns` counts them
    increments : number in all runs, shared ones counted once, if none is cut; the smallest number
        if passes end when the shakedown state is decided
    most_increments : the same with all halvings of `Scene.refinement`, or if the shakedown state is
        never decided
    seconds : processor time of the increments; None if it follows from unknowns and increments
    set_up : processor time [s] of what paths with equal `Scene.setup` share
    memory : most bytes that the path needs at a time, beside libraries; by default for its unknowns
    """

    elements: int
    unknowns: int
    increments: int
    most_increments: int
    seconds: float | None = None
    set_up: float = 0.0
    memory: float = 0.0

    def __post_init__(self) -> None:
        if not self.memory:
            object.__setattr__(self, "memory", _FIRST + _PER_UNKNOWN * self.unknowns**_EXPONENT)
