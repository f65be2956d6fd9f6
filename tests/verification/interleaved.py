"""Tracks whose rows have points one element apart, as increments by which a load advances one."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from solver.rolling.plane.rows import FlowRows
from solver.rolling.plane.track import Track


class InterleavedRows(FlowRows):
    """Two rows of each, of every other column."""

    def _in_rows(self, elements: NDArray[np.bool_], deep: float) -> NDArray[np.int64]:
        rows = super()._in_rows(elements, deep)
        return rows.reshape(len(rows), -1, 2).swapaxes(1, 2).reshape(2 * len(rows), -1)


class InterleavedTrack(Track):
    """A track with interleaved rows."""

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        self.rows = InterleavedRows(self.part, self.operator, *self._window)
