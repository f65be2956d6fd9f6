"""Components of symmetric tensors, and their scaling.

Inside the solver strain and stress are Mandel vectors, components first, points last:
``(xx, yy, zz, sqrt(2) xy)``, so that the dot product of two vectors is the double contraction of
the tensors, the norm is the tensor norm and every tangent is a symmetric matrix. Tensor
components (``xy`` without the factor) appear only in what leaves the solver: `to_tensor`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

COMPONENTS = ("xx", "yy", "zz", "xy")
SQRT2 = float(np.sqrt(2.0))


def to_tensor(mandel: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return tensor components ``(4, ...)`` from Mandel components ``(4, ...)``."""
    tensor = np.array(mandel, dtype=float)
    tensor[3:] /= SQRT2
    return tensor


def von_mises(mandel: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the von Mises stress of Mandel components (4, ...) [MPa]."""
    deviator = np.array(mandel)
    deviator[:3] -= mandel[:3].mean(axis=0)
    return np.asarray(np.sqrt(1.5 * (deviator**2).sum(axis=0)))
