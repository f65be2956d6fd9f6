"""Types of arrays for annotations."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]  # real numbers
Ints: TypeAlias = NDArray[np.int64]  # indices and counts
Bools: TypeAlias = NDArray[np.bool_]  # masks
Complexes: TypeAlias = NDArray[np.complex128]  # amplitudes of waves
