"""Symmetric sparse systems behind one interface: analyse once, factorise, solve many.

A matrix is given by its upper triangle in CSR form. `analyse` chooses MKL PARDISO where it is
installed and SuperLU elsewhere; ``RESIDUA_LINEAR_SOLVER`` (``pardiso`` or ``superlu``) decides
otherwise.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Protocol

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from solver import pardiso
from solver.errors import ModelError

if TYPE_CHECKING:
    from numpy.typing import NDArray

_NOT_POSITIVE = -4
SOLVERS = ("auto", "pardiso", "superlu")


class Singular(ArithmeticError):
    """The matrix has no factor."""


class LinearSolver(Protocol):
    """An analysed pattern; after `factorise`, a factor."""

    def factorise(self, data: NDArray[np.float64]) -> None:
        """Take these values of the upper triangle; raise `Singular` when there is no factor."""

    def solve(self, b: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the solution for ``b`` (n,) or (n, k)."""

    def compliance(self, columns: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return ``columns' A^-1 columns`` for ``columns`` (n, k)."""


class SuperLU:
    """The factorisation every machine has."""

    def __init__(self, upper: sparse.csr_array) -> None:
        self._upper = upper.copy()

    def factorise(self, data: NDArray[np.float64]) -> None:
        """See `LinearSolver`."""
        self._upper.data = np.asarray(data, dtype=float)
        full = self._upper + sparse.triu(self._upper, 1, format="csr").T
        try:
            self._factor = splu(
                full.tocsc(),
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )
        except RuntimeError as error:
            raise Singular(str(error)) from error

    def solve(self, b: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `LinearSolver`."""
        return np.asarray(self._factor.solve(np.ascontiguousarray(b)))

    def compliance(self, columns: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `LinearSolver`."""
        if columns.shape[1] == 0:
            return np.zeros((0, 0))
        W = columns.T @ self.solve(columns)
        return 0.5 * (W + W.T)


class PardisoSolver:
    """MKL PARDISO: Cholesky, and LDL' when a pivot is not positive."""

    def __init__(self, upper: sparse.csr_array) -> None:
        self._upper = upper
        self._definite = pardiso.Pardiso(upper, pardiso.POSITIVE_DEFINITE)
        self._indefinite: pardiso.Pardiso | None = None
        self._current = self._definite

    def factorise(self, data: NDArray[np.float64]) -> None:
        """See `LinearSolver`."""
        if not np.isfinite(data).all():
            raise Singular("the matrix is not finite")
        try:
            self._definite.factorise(data)
            self._current = self._definite
        except pardiso.PardisoError as failure:
            if failure.code != _NOT_POSITIVE:
                raise Singular(str(failure)) from failure
            if self._indefinite is None:
                self._indefinite = pardiso.Pardiso(self._upper, pardiso.INDEFINITE)
            try:
                self._indefinite.factorise(data)
            except pardiso.PardisoError as error:
                raise Singular(str(error)) from error
            self._current = self._indefinite

    def solve(self, b: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `LinearSolver`."""
        return self._current.solve(b)

    def compliance(self, columns: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `LinearSolver`."""
        return self._current.compliance(columns)


def analyse(upper: sparse.csr_array, name: str = "auto") -> LinearSolver:
    """Return a solver for matrices with the pattern of ``upper``.

    Raises
    ------
    ModelError : the solver named is unknown or not installed
    """
    name = os.environ.get("RESIDUA_LINEAR_SOLVER", name) if name == "auto" else name
    if name not in SOLVERS:
        raise ModelError("linear_solver", name, "must be one of " + ", ".join(SOLVERS))
    available = pardiso.library() is not None
    if name == "pardiso" and not available:
        raise ModelError("linear_solver", name, "needs MKL: pip install 'residua[mkl]'")
    return PardisoSolver(upper) if available and name != "superlu" else SuperLU(upper)
