"""MKL PARDISO through its documented C interface, phase by phase.

The wheel `mkl` contains the library. Existing wrappers do not offer its phases one by one: analysis
once per pattern, one factorisation per matrix, elimination down to a Schur complement.
"""

from __future__ import annotations

import ctypes
import weakref
from functools import cache
from importlib import metadata
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cho_factor, cho_solve, solve_triangular
from scipy.sparse import csr_array

from solver.typing import Array, Ints

_SEQUENTIAL = 1
_ANALYSE, _FACTORISE, _SOLVE, _FORWARD, _BACKWARD, _RELEASE = 11, 22, 33, 331, 333, -1
NOT_POSITIVE = -4
POSITIVE_DEFINITE, INDEFINITE = 2, -2
MINIMUM_DEGREE, DISSECTION = 0, 2


@cache
def library() -> ctypes.CDLL | None:
    """Return MKL, limited to one thread per process; None if it is not installed."""
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
    """An error of PARDISO with its ``code``: `NOT_POSITIVE` for a zero or negative pivot."""

    def __init__(self, phase: int, code: int) -> None:
        super().__init__(f"PARDISO phase {phase} failed with error {code}")
        self.code = code


class Pardiso:
    """An analysed pattern and the factors of one or several matrices.

    All unknowns except the ``kept`` ones are eliminated. The Schur complement on these is
    factorised densely, so that their compliances need no sparse solves.

    Parameters
    ----------
    upper : upper triangle of a symmetric matrix in CSR, diagonal present
    kept : (m,) increasing, unknowns eliminated last, of a positive definite matrix; by default none
    kind : `POSITIVE_DEFINITE` or `INDEFINITE`
    ordering : `DISSECTION` (nested) or `MINIMUM_DEGREE`
    count : number of matrices whose factors are held at the same time; with more than one there are
        no kept unknowns
    single : whether factors, right-hand sides and solutions are in single precision
    """

    def __init__(
        self,
        upper: csr_array,
        kept: Ints | None = None,
        kind: int = POSITIVE_DEFINITE,
        ordering: int = DISSECTION,
        count: int = 1,
        single: bool = False,
    ) -> None:
        self.kind, self._precision = kind, np.dtype(np.float32 if single else float)
        self.n = upper.shape[0]
        self._count = count
        self._kept = np.zeros(0, dtype=np.int64) if kept is None else kept
        self._last = np.zeros(self.n, dtype=np.int32)
        self._last[self._kept] = 1
        self._indptr = upper.indptr.astype(np.int32)
        self._indices = upper.indices.astype(np.int32)
        self._data = upper.data.astype(self._precision)
        self._handle = np.zeros(64, dtype=np.int64)
        self._iparm = np.zeros(64, dtype=np.int32)
        self._iparm[0] = 1  # values below, not defaults
        self._iparm[1] = ordering
        self._iparm[9] = 8 if kind == INDEFINITE else 0  # pivot perturbation 1e-8
        self._iparm[27] = int(single)
        self._iparm[34] = 1  # zero-based
        self._iparm[35] = 2 if len(self._kept) else 0  # Schur complement, and factors to solve with
        nothing = np.zeros(1, self._precision)
        self._call(_ANALYSE, nothing, nothing)
        weakref.finalize(self, _release, self._handle, kind, self._iparm, count)

    def factorise(self, data: Array, which: int = 0) -> None:
        """Factorise the matrix with these values on the pattern, as matrix number ``which``."""
        schur = self.eliminate(data, which)
        if len(self._kept):
            try:
                self._schur = cho_factor(schur, lower=True)
            except LinAlgError as failure:
                raise PardisoError(_FACTORISE, NOT_POSITIVE) from failure

    def eliminate(self, data: Array, which: int = 0) -> Array:
        """Eliminate all unknowns but the kept ones; return the Schur complement (m, m) on these."""
        self._data = np.ascontiguousarray(data, dtype=self._precision)
        m = len(self._kept)
        schur = np.zeros((m, m) if m else 1, self._precision)
        self._call(_FACTORISE, np.zeros(1, self._precision), schur, which)
        return schur

    def solve(self, b: Array, which: int = 0) -> Array:
        """Return the solution for ``b`` (n,) or (n, k) with the matrix number ``which``."""
        # PARDISO stores right-hand sides by columns
        b = np.asfortranarray(b, dtype=self._precision)
        x = np.zeros_like(b)
        if b.size == 0:
            return x
        if not len(self._kept):
            self._call(_SOLVE, b, x, which)
            return x
        half = self.forward(b)
        return self.backward(half, self.on_kept(half[self._kept]))

    def forward(self, b: Array) -> Array:
        """Return a right-hand side (n,) or (n, k) after elimination down to the kept unknowns.

        Its values on the kept unknowns are the right-hand side of the Schur complement.
        """
        b = np.asfortranarray(b)
        half = np.zeros_like(b)
        if b.size:
            self._call(_FORWARD, b, half)
        return half

    def on_kept(self, right: Array) -> Array:
        """Return the kept unknowns (m,) for a right-hand side of the Schur complement."""
        return np.asarray(cho_solve(self._schur, right, check_finite=False))

    def backward(self, half: Array, kept: Array) -> Array:
        """Return the solution after `forward`, given the unknowns ``kept`` (m,)."""
        half = half.copy(order="F")
        half[self._kept] = kept
        x = np.zeros_like(half)
        self._call(_BACKWARD, half, x)
        return x

    def compliance(self, rows: Array) -> Array:
        """Return ``rows F rows'`` with the part F (m, m) of the inverse on the kept unknowns."""
        half = solve_triangular(self._schur[0], rows.T, lower=True, check_finite=False)
        return np.asarray(half.T @ half)

    def __sizeof__(self) -> int:
        """Return the bytes including analysis and factors, which are not on Python's heap."""
        highest, analysis, factors = self._iparm[14:17]
        return object.__sizeof__(self) + 1024 * int(max(highest, analysis + factors))

    def _call(self, phase: int, b: Array, x: Array, which: int = 0) -> None:
        if not self.n:  # every displacement of a body is prescribed
            return
        _pardiso(
            phase, self._handle, self.kind, self._iparm, self.n, b.shape[1] if b.ndim == 2 else 1,
            (self._data, self._indptr, self._indices), self._last, b, x,
            self._count, which,
        )  # fmt: skip


def _pointer(array: NDArray[Any]) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.__array_interface__["data"][0])  # array.ctypes is slow


def _pardiso(
    phase: int,
    handle: NDArray[Any],
    kind: int,
    iparm: NDArray[Any],
    n: int,
    count: int,
    matrix: tuple[NDArray[Any], NDArray[Any], NDArray[Any]],
    last: NDArray[Any],
    b: NDArray[Any],
    x: NDArray[Any],
    factors: int,
    which: int,
) -> None:
    mkl = library()
    if mkl is None:
        raise RuntimeError("MKL is not installed: pip install mkl")
    error = ctypes.c_int32(0)

    def integer(value: int) -> Any:
        return ctypes.byref(ctypes.c_int32(value))

    mkl.pardiso(
        _pointer(handle), integer(factors), integer(which + 1), integer(kind), integer(phase),
        integer(n), *(_pointer(part) for part in matrix), _pointer(last),
        integer(count), _pointer(iparm), integer(0), _pointer(b), _pointer(x),
        ctypes.byref(error),
    )  # fmt: skip
    if error.value:
        raise PardisoError(phase, error.value)


def _release(handle: NDArray[Any], kind: int, iparm: NDArray[Any], factors: int) -> None:
    empty = np.zeros(1, dtype=np.int32)
    _pardiso(_RELEASE, handle, kind, iparm, 1, 1, (np.zeros(1), empty, empty), empty,
             np.zeros(1), np.zeros(1), factors, 0)  # fmt: skip
