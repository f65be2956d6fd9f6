"""Amplitudes: loads and motions as functions of time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.errors import ModelError
from solver.typing import Array


@dataclass(frozen=True, slots=True, eq=False)
class Amplitude:
    """A number as a function of time: linear between knots, constant before and after them.

    Time gives the order of events and has no unit.

    Attributes
    ----------
    time : (n,) knots, not decreasing
    value : (n,) the number at the knots
    """

    time: Array
    value: Array

    def __post_init__(self) -> None:
        time, value = np.asarray(self.time, dtype=float), np.asarray(self.value, dtype=float)
        if time.ndim != 1 or not len(time) or value.shape != time.shape:
            shapes = f"{time.shape} and {value.shape}"
            raise ModelError(
                "amplitude", shapes, "time and value must be lists as long as each other"
            )
        if not (np.isfinite(time).all() and np.isfinite(value).all()):
            raise ModelError("amplitude", "nan or inf", "time and value must be finite")
        if (np.diff(time) < 0).any():
            raise ModelError("amplitude.time", time.tolist(), "must not decrease")

    @classmethod
    def constant(cls, value: float) -> Amplitude:
        """Return a number that is the same at all times."""
        return cls(np.zeros(1), np.array([value]))

    def times(self, factor: float) -> Amplitude:
        """Return the amplitude with its values multiplied by ``factor``."""
        return Amplitude(self.time, factor * self.value)

    def at(self, time: float) -> float:
        """Return the number at a time."""
        return float(np.interp(time, self.time, self.value))
