"""The figures of the audit that are nearest to their limits, over the runs of a study."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from solver.audit.figures import LIMITS


@dataclass(frozen=True, slots=True)
class Worst:
    """The largest value of a figure of the audit.

    Attributes
    ----------
    name, value, limit : the figure, its value, and the limit above which a run fails
    at : position of the run among all runs
    """

    name: str
    value: float
    limit: float
    at: int

    @property
    def share(self) -> float:
        """Value over limit."""
        return self.value / self.limit


def worst(numbers: Mapping[str, np.ndarray]) -> list[Worst]:
    """Return the largest value of each figure that has a limit, the nearest to its limit first.

    Parameters
    ----------
    numbers : values over all runs by name, NaN where there is none; others than figures are ignored
    """
    found = []
    for name, limit in LIMITS.items():
        values = np.asarray(numbers.get(name, ()), dtype=float).ravel()
        if np.isfinite(values).any():
            at = int(np.nanargmax(values))
            found.append(Worst(name, float(values[at]), limit, at))
    return sorted(found, key=lambda each: -each.share)
