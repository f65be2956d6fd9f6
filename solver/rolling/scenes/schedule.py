"""The loading history of passes over a track: set down, drive, roll, release, return.

The times of a pass:

====================  =====================================================================
0 to 1                the load grows where the pass begins
1 to 2                the moment grows (left out if there is none)
then 1 per millimetre the axle advances to the other end
then 1                the load is released, and the bodies are separated
then 1                the axle goes to where the next pass begins
====================  =====================================================================
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.loading.program import Lap, Program, Stage
from solver.model.amplitude import Amplitude

_ROUNDING = 1e-6
"""Difference of two times below which they are the same."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Schedule:
    """The loading history of ``n`` passes.

    Attributes
    ----------
    n : number of passes
    track : length rolled in a pass, centred on x = 0 [mm]
    step : advance of an increment [mm]
    directions : (n,) +1 or -1, direction of each pass along x
    driven : whether a moment acts
    press, release : numbers of increments of loading and of unloading
    """

    n: int
    track: float
    step: float
    directions: tuple[int, ...]
    driven: bool
    press: int = 8
    release: int = 4

    @property
    def half_steps(self) -> int:
        """Increments from the start to mid-track."""
        return round(self.track / 2 / self.step)

    @property
    def increment(self) -> float:
        """Advance of an increment, which divides half the track [mm]."""
        return self.track / (2 * self.half_steps)

    @property
    def cycle(self) -> int:
        """Passes after which the loading repeats itself."""
        return len(set(self.directions))

    @property
    def marks(self) -> tuple[float, ...]:
        """Times within a pass: loaded, driven, arrived, released, returned."""
        driven = 2.0 if self.driven else 1.0
        return 1.0, driven, driven + self.track, driven + self.track + 1, driven + self.track + 2

    @property
    def duration(self) -> float:
        """Time of a pass."""
        return self.marks[-1]

    def travel(self, time: float) -> float:
        """Return the length rolled at a time since its pass began [mm]."""
        number = min(int(time / self.duration + _ROUNDING), self.n - 1)
        _, driven, _, _, _ = self.marks
        return min(max(time - (number * self.duration + driven), 0.0), self.track)

    def place(self, time: float) -> str:
        """Return the text for a time in messages: the pass and its progress."""
        number = int(time / self.duration + _ROUNDING)
        since = max(0.0, time - number * self.duration)
        loaded, driven, arrived, released, _ = self.marks
        stages = ((loaded, "set down by"), (driven, "driven by"), (released, "released by"))
        where = f"rolled {since - driven:.4g} mm"
        if not driven - _ROUNDING <= since <= arrived + _ROUNDING:
            end, words = next((s for s in stages if since <= s[0] + _ROUNDING), stages[-1])
            where = f"{words} {1 - (end - since):.0%}"
        return f"pass {number + 1}, {where}"

    @property
    def load(self) -> Amplitude:
        """Factor of the load over time."""
        return self._amplitude([(0.0, 1.0, 1.0, 1.0, 0.0)] * self.n)

    @property
    def drive(self) -> Amplitude:
        """Factor of the moment over time, with the direction of the pass as its sign."""
        factor = float(self.driven)
        return self._amplitude([(0.0, 0.0, way * factor, way * factor, 0.0)
                                for way in self.directions])  # fmt: skip

    @property
    def position(self) -> Amplitude:
        """Position of the axle over time [mm]."""
        halves = [way * self.track / 2 for way in self.directions]
        return self._amplitude([(-half, -half, -half, half, half) for half in halves])

    @property
    def way(self) -> Amplitude:
        """Direction along x over time, +1 or -1."""
        return self._amplitude([(float(way),) * 5 for way in self.directions])

    def _amplitude(self, values: list[tuple[float, ...]]) -> Amplitude:
        """Return the amplitude with these values at the start and the first marks of each pass."""
        starts = [(0.0, *self.marks[:-1])] * self.n
        time = [k * self.duration + mark for k, marks in enumerate(starts) for mark in marks]
        return Amplitude(np.array(time), np.array(values).ravel())

    @property
    def program(self) -> Program:
        """The passes as a program, a lap for each."""
        return Program(
            laps=tuple(self._lap(k * self.duration) for k in range(self.n)),
            cycle=self.cycle,
            place=self.place,
        )

    def _lap(self, begin: float) -> Lap:
        """Return the pass that begins at a time."""
        loaded, driven, arrived, released, _ = (begin + mark for mark in self.marks)
        middle = driven + self.track / 2
        press, roll = self.press, self.half_steps
        stages = (
            Stage(name="set_down", target=loaded, steps=press),
            *([Stage(name="driven", target=driven, steps=press, turns=True)] * self.driven),
            Stage(name="mid_track", target=middle, steps=roll, turns=True, refined=True),
            Stage(name="loaded", target=arrived, steps=roll, refined=True),
            Stage(name="unloaded", target=released, steps=self.release, apart=True),
        )
        return Lap(stages, begin)
