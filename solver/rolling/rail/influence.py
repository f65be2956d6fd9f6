"""How tractions at one station act at others: kernels that depend on their distance alone."""

from __future__ import annotations

import numpy as np

from solver.late import late
from solver.typing import Array, Ints

(between,) = late("rolling.kernels", "between")


class Influence:
    """A linear map from values (n, m, 3) at stations and vertices to others of this shape.

    Parameters
    ----------
    kernel : (2n, m, 3, m, 3), entry ``[d, i, a, j, b]`` is the effect on value a at vertex i, d
        stations downstream of value b at vertex j; negative d are at the end, as in an FFT
    """

    def __init__(self, kernel: Array) -> None:
        length, m = kernel.shape[:2]
        self.shape = (length // 2, m, 3)
        self._spectrum = np.fft.rfft(kernel.reshape(length, 3 * m, 3 * m), axis=0)
        self._blocks = np.ascontiguousarray(kernel.transpose(0, 1, 3, 2, 4))

    def of(self, values: Array) -> Array:
        """Return the effects (n, m, 3) of values (n, m, 3)."""
        return self.everywhere(values)[: self.shape[0]]

    def everywhere(self, values: Array) -> Array:
        """Return the effects (2n, m, 3); those at stations before the first are at the end."""
        n, m, _ = self.shape
        modes = np.fft.rfft(values.reshape(n, 3 * m, 1), 2 * n, axis=0)
        return np.fft.irfft(self._spectrum @ modes, 2 * n, axis=0).reshape(2 * n, m, 3)

    def own(self) -> Array:
        """Return the effects (m, 3, 3) of the values at a point on that point itself."""
        vertices = np.arange(self.shape[1])
        return self._blocks[0, vertices, vertices]

    def between(self, at: Ints, rows: Array, by: Ints, columns: Array) -> Array:
        """Return the effects (len(at), len(by)) of some combinations of values on others.

        Parameters
        ----------
        at, by : flat numbers of points, station * m + vertex
        rows : (len(at), 3) weights of the effects' components
        columns : (len(by), 3) components of the values
        """
        return between(self._blocks, at, rows, by, columns)
