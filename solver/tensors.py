"""Components of symmetric tensors, and their scaling.

Inside the solver strain and stress are Mandel vectors, components first, points last:
``(xx, yy, zz, sqrt(2) xy)`` in two dimensions, followed by ``(sqrt(2) yz, sqrt(2) zx)`` in three,
so that the dot product of two vectors is the double contraction of the tensors, the norm is the
tensor norm and a tangent that has a potential is a symmetric matrix. Results leave the solver as
tensor components (``xy`` without the factor): `to_tensor`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

COMPONENTS = ("xx", "yy", "zz", "xy")
SQRT2 = float(np.sqrt(2.0))


def to_tensor(mandel: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return tensor components ``(n_components, ...)`` from Mandel components of that shape."""
    tensor = np.array(mandel, dtype=float)
    tensor[3:] /= SQRT2
    return tensor


def to_mandel(tensor: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return Mandel components ``(n_components, ...)`` from tensor components of that shape."""
    mandel = np.array(tensor, dtype=float)
    mandel[3:] *= SQRT2
    return mandel


def identity(n_components: int) -> NDArray[np.float64]:
    """Return the Mandel components (n_components,) of the unit tensor."""
    one = np.zeros(n_components)
    one[:3] = 1.0
    return one


def deviator(mandel: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the deviator (n_components, ...) of Mandel components of that shape."""
    out = np.array(mandel)
    out[:3] -= mandel[:3].mean(axis=0)
    return out


def von_mises(mandel: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the von Mises stress (...) of Mandel components (n_components, ...) [MPa]."""
    return np.asarray(np.sqrt(1.5 * (deviator(mandel) ** 2).sum(axis=0)))


def not_below_zero(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return values of an invariant that has no sign, without what interpolation undershoots."""
    return np.maximum(values, 0.0)


def stress_difference(stress: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return sigma1 - sigma2 (...) of the xy plane, of components xx, yy, zz, xy (4, ...) [MPa]."""
    xx, yy, _, xy = stress
    return np.hypot(xx - yy, 2 * xy)
