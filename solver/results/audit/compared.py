"""Compare values: the largest difference over the scale of its quantity."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from solver.typing import Array, Bools, Ints

LIMIT = 1e-6
"""Limit of difference / scale, a multiple of rounding: both interpolate in the same elements."""
MEASURED = 0.02
"""Limit for gap, slip and reactions if surfaces are curved or slide far: the audit projects points
differently, and means over hats differ with the angle of the surface within an edge."""
AREA = 1e-4
"""Limit for pressure and shear on such surfaces: at the ends of the contact another projection
gives another share of a hat that faces the partner."""
STEADY = 1e-3
"""Limit for stress under a steady load: its strains are those of equilibrium up to
`audit_steadiness`."""
LEAST_STRAIN = 1e-6
"""Least scale of strains; times Young's modulus, least scale of stresses."""
_COUNT = 24
"""Number of values of a field that are computed again, besides the largest."""
_GOLDEN = (5**0.5 - 1) / 2


@dataclass(slots=True)
class Compared:
    """The largest ratio of a difference to its scale so far, and the name of its quantity."""

    figure: float = 0.0
    name: str = ""
    seen: set[str] = field(default_factory=set)

    def add(self, name: str, stored: Any, own: Any, scale: float, share: float = 1.0) -> None:
        """Compare stored with recomputed values ``own``; NaN in ``own`` is not compared.

        The ratio is multiplied by ``share``, so that another limit becomes `LIMIT`.
        """
        self.seen.add(name)
        stored, own = np.broadcast_arrays(np.asarray(stored, float), np.asarray(own, float))
        known = np.isfinite(own)
        off = np.abs(stored[known] - own[known]) / max(scale, 1e-300) * share
        self._worst(name, float(np.where(np.isnan(off), 1.0, off).max(initial=0.0)))

    def absent(self, name: str, stored: Array, outside: Bools) -> None:
        """Check that values (..., n) are NaN at places outside the body."""
        if np.isfinite(stored[..., outside]).any():
            self._worst(name, 1.0)

    def _worst(self, name: str, figure: float) -> None:
        if figure > self.figure:
            self.figure, self.name = figure, name


def some(count: int, *fields: Array) -> Ints:
    """Return the numbers of some places, evenly spread, and where fields (..., n) are largest."""
    spread = np.floor(np.arange(1, _COUNT + 1) * _GOLDEN % 1.0 * count).astype(np.int64)
    largest = [np.argmax(np.abs(np.nan_to_num(one)))
               for field in fields for one in field.reshape(-1, count)]  # fmt: skip
    return np.unique(np.concatenate([spread, np.array(largest, dtype=np.int64)]))
