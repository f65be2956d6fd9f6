"""Values compared with others: the largest difference over the scale of its quantity."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

LIMIT = 1e-6
"""Largest difference / scale: rounding. The same places are interpolated in the same elements."""
MEASURED = 0.02
"""The same of gap, slip and reactions where surfaces are curved or slide far: another projection
measures them, and means over hats differ by what surfaces turn within an edge."""
AREA = 1e-4
"""The same of pressure and shear there: at its ends, another projection finds another share of the
surface that faces its partner."""
STEADY = 1e-3
"""The same of stress under a load that passes: its strains are those of equilibrium, up to
`audit_steadiness`."""
LEAST_STRAIN = 1e-6
"""Strain, and times Young's modulus stress, that is next to nothing."""
_COUNT = 24
"""Values of a field that are computed anew, besides the largest."""
_GOLDEN = (5**0.5 - 1) / 2


@dataclass(slots=True)
class Compared:
    """The largest difference so far / scale of its quantity, and which quantity that is."""

    figure: float = 0.0
    name: str = ""
    seen: set[str] = field(default_factory=set)

    def add(self, name: str, stored: Any, own: Any, scale: float, share: float = 1.0) -> None:
        """Compare values with others; where these are not known (NaN) nothing is compared.

        A difference counts with a ``share``.
        """
        self.seen.add(name)
        stored, own = np.broadcast_arrays(np.asarray(stored, float), np.asarray(own, float))
        known = np.isfinite(own)
        off = np.abs(stored[known] - own[known]) / max(scale, 1e-300) * share
        self._worst(name, float(np.where(np.isnan(off), 1.0, off).max(initial=0.0)))

    def absent(self, name: str, stored: Array, outside: NDArray[np.bool_]) -> None:
        """Compare values (..., n) where there is no body: there must be none."""
        if np.isfinite(stored[..., outside]).any():
            self._worst(name, 1.0)

    def _worst(self, name: str, figure: float) -> None:
        if figure > self.figure:
            self.figure, self.name = figure, name


def some(count: int, *fields: Array) -> NDArray[np.int64]:
    """Return numbers of places spread over all, and those where fields (..., n) are largest."""
    spread = np.floor(np.arange(1, _COUNT + 1) * _GOLDEN % 1.0 * count).astype(np.int64)
    largest = [np.argmax(np.abs(np.nan_to_num(one)))
               for field in fields for one in field.reshape(-1, count)]  # fmt: skip
    return np.unique(np.concatenate([spread, np.array(largest, dtype=np.int64)]))
