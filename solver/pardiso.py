"""MKL PARDISO through its documented C interface, phases apart.

The `mkl` wheel ships the library; its phases are called here one by one (analysis once per
pattern, a factorisation per matrix, half solves for compliances), which wrappers of the whole
call do not offer.
"""

from __future__ import annotations

import ctypes
import weakref
from functools import cache
from importlib import metadata
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from scipy.sparse import csr_array

_SEQUENTIAL = 1
_ANALYSE, _FACTORISE, _SOLVE, _FORWARD, _RELEASE = 11, 22, 33, 331, -1
POSITIVE_DEFINITE, INDEFINITE = 2, -2


@cache
def library() -> ctypes.CDLL | None:
    """Return MKL, set to one thread a process, or None where it is not installed."""
    try:
        files = metadata.distribution("mkl").files or []
    except metadata.PackageNotFoundError:
        return None
    for file in files:
        if file.name.startswith("libmkl_rt.so"):
            mkl = ctypes.CDLL(str(file.locate()))
            mkl.MKL_Set_Threading_Layer(_SEQUENTIAL)
            return mkl
    return None


class PardisoError(RuntimeError):
    """PARDISO's error number; -4 is a zero or negative pivot."""

    def __init__(self, phase: int, code: int) -> None:
        super().__init__(f"PARDISO phase {phase} failed with error {code}")
        self.code = code


class Pardiso:
    """One analysed pattern and the factor of the matrix last given.

    Parameters
    ----------
    upper : upper triangle of a symmetric matrix in CSR, diagonal present
    kind : `POSITIVE_DEFINITE` or `INDEFINITE`
    """

    def __init__(self, upper: csr_array, kind: int = POSITIVE_DEFINITE) -> None:
        self.kind = kind
        self.n = upper.shape[0]
        self._indptr = upper.indptr.astype(np.int32)
        self._indices = upper.indices.astype(np.int32)
        self._data = upper.data.astype(float)
        self._handle = np.zeros(64, dtype=np.int64)
        self._iparm = np.zeros(64, dtype=np.int32)
        self._iparm[0] = 1  # values below, not defaults
        self._iparm[1] = 2  # nested dissection
        self._iparm[9] = 8 if kind == INDEFINITE else 0  # pivot perturbation 1e-8
        self._iparm[34] = 1  # zero-based
        self._call(_ANALYSE)
        self._free = weakref.finalize(self, _release, self._handle, kind, self._iparm)

    def factorise(self, data: NDArray[np.float64]) -> None:
        """Factorise the matrix with these values on the analysed pattern."""
        self._data = np.ascontiguousarray(data, dtype=float)
        self._call(_FACTORISE)

    def solve(self, b: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the solution for ``b`` (n,) or (n, k)."""
        return self._call(_SOLVE, b)

    def compliance(self, columns: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return ``columns' A^-1 columns``, from forward substitution alone where A = L L'."""
        if self.kind == POSITIVE_DEFINITE:
            half = self._call(_FORWARD, columns)
            return half.T @ half
        W = columns.T @ self.solve(columns)
        return 0.5 * (W + W.T)

    def close(self) -> None:
        """Free the memory MKL holds."""
        self._free()

    def _call(self, phase: int, b: NDArray[np.float64] | None = None) -> Any:
        # PARDISO reads right-hand sides column by column
        rhs = np.zeros(1) if b is None else np.asfortranarray(b, dtype=float)
        x = np.zeros_like(rhs)
        count = rhs.shape[1] if rhs.ndim == 2 else 1
        if count == 0:
            return x
        _pardiso(
            phase, self._handle, self.kind, self._iparm, self.n, count,
            (self._data, self._indptr, self._indices), rhs, x,
        )  # fmt: skip
        return x


def _pointer(array: NDArray[Any]) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def _pardiso(
    phase: int,
    handle: NDArray[Any],
    kind: int,
    iparm: NDArray[Any],
    n: int,
    count: int,
    matrix: tuple[NDArray[Any], NDArray[Any], NDArray[Any]],
    b: NDArray[Any],
    x: NDArray[Any],
) -> None:
    mkl = library()
    if mkl is None:
        raise RuntimeError("MKL is not installed")
    error = ctypes.c_int32(0)

    def integer(value: int) -> Any:
        return ctypes.byref(ctypes.c_int32(value))

    mkl.pardiso(
        _pointer(handle), integer(1), integer(1), integer(kind), integer(phase), integer(n),
        *(_pointer(part) for part in matrix), _pointer(np.zeros(1, dtype=np.int32)),
        integer(count), _pointer(iparm), integer(0), _pointer(b), _pointer(x),
        ctypes.byref(error),
    )  # fmt: skip
    if error.value:
        raise PardisoError(phase, error.value)


def _release(handle: NDArray[Any], kind: int, iparm: NDArray[Any]) -> None:
    empty = np.zeros(1, dtype=np.int32)
    _pardiso(_RELEASE, handle, kind, iparm, 1, 1, (np.zeros(1), empty, empty), np.zeros(1),
             np.zeros(1))  # fmt: skip
