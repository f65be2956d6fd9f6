"""Numbers that change in time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.errors import ModelError

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class Amplitude:
    """A number over time, piecewise linear between knots and constant beyond them.

    Time orders what happens and has no unit.

    Attributes
    ----------
    time : (n,) knots, not decreasing
    value : (n,) the number there
    """

    time: NDArray[np.float64]
    value: NDArray[np.float64]

    def __post_init__(self) -> None:
        time, value = np.asarray(self.time, dtype=float), np.asarray(self.value, dtype=float)
        if time.ndim != 1 or not len(time) or value.shape != time.shape:
            shapes = f"{time.shape} and {value.shape}"
            raise ModelError("amplitude", shapes, "time and value must be as long as each other")
        if not (np.isfinite(time).all() and np.isfinite(value).all()):
            raise ModelError("amplitude", "nan or inf", "time and value must be finite")
        if (np.diff(time) < 0).any():
            raise ModelError("amplitude.time", time.tolist(), "must not decrease")

    def times(self, factor: float) -> Amplitude:
        """Return ``factor`` times the number."""
        return Amplitude(self.time, factor * self.value)

    def at(self, time: float) -> float:
        """Return the number at a time."""
        return float(np.interp(time, self.time, self.value))
