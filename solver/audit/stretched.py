"""Logarithmic strain and nominal stress of large strain, by principal stretches.

The solver has closed forms instead. With the principal values c and directions n of C = F'F, the
strain is ln(c) / 2 along n, and the stress S = 2 T : dE/dC has in these directions the components
``T_ij 2 (E_i - E_j) / (c_i - c_j)``, with the limit 1 / c_i for equal values. The nominal stress is
F S.
"""

from __future__ import annotations

import numpy as np

from solver.tensors import SQRT2
from solver.typing import Array

_EQUAL = 1e-8
"""(c_i - c_j) / c_j below which they count as equal: the error of the limit is half of it."""


def _gradient(H: Array) -> Array:
    """Return F (..., 2, 2) for displacement gradients (2, 2, ...)."""
    return np.moveaxis(H, (0, 1), (-2, -1)) + np.eye(2)


def logarithmic(H: Array, hoop: Array) -> Array:
    """Return the Mandel strain (4, ...) for displacement gradients (2, 2, ...) and hoop (...)."""
    F = _gradient(H)
    c, n = np.linalg.eigh(np.swapaxes(F, -1, -2) @ F)
    E = np.einsum("...ik,...k,...jk->ij...", n, np.log(c) / 2, n)
    return np.array([E[0, 0], E[1, 1], np.log(1 + hoop), SQRT2 * E[0, 1]])


def nominal(T: Array, H: Array, hoop: Array) -> tuple[Array, Array]:
    """Return the nominal stress (2, 2, ...) and its hoop part (...) [MPa].

    Parameters
    ----------
    T : (4, ...) tensor components of the stress that is conjugate to logarithmic strain [MPa]
    H, hoop : as of `logarithmic`
    """
    F = _gradient(H)
    c, n = np.linalg.eigh(np.swapaxes(F, -1, -2) @ F)
    one, other = c[..., :, None], c[..., None, :]
    apart = one / other - 1
    equal = np.abs(apart) < _EQUAL
    ratio = np.where(equal, 1.0, np.log1p(apart) / np.where(equal, 1.0, apart)) / other
    plane = np.array([[T[0], T[3]], [T[3], T[1]]])
    own = np.einsum("...ik,ij...,...jl->...kl", n, plane, n) * ratio
    S = n @ own @ np.swapaxes(n, -1, -2)
    return np.moveaxis(F @ S, (-2, -1), (0, 1)), T[2] / (1 + hoop)
