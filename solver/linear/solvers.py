"""Symmetric sparse systems behind one interface: analyse once, factorise, solve many.

A matrix is given by its upper triangle in CSR form. `LinearSolver.compliance` is available on the
``kept`` unknowns. `analyse` chooses MKL PARDISO if it is installed, else SuperLU; the environment
variable ``RESIDUA_LINEAR_SOLVER`` (``pardiso`` or ``superlu``) overrides this choice.

BLAS uses one thread (`one_thread`): the dense blocks are small, and runs are parallel. Several
threads spend their time on synchronisation: on two busy cores a run took seven times as long.
"""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu
from threadpoolctl import ThreadpoolController

from solver.errors import ModelError
from solver.linear import pardiso
from solver.typing import Array, Ints

SOLVERS = ("auto", "pardiso", "superlu")


class Singular(ArithmeticError):
    """The matrix cannot be factorised."""


@dataclass(frozen=True, slots=True)
class Begun:
    """A solution whose right-hand side may still change on the kept unknowns.

    Attributes
    ----------
    kept : (m,) the kept unknowns, for an unchanged right-hand side
    finish : (change (m,) of the right-hand side on the kept unknowns) -> solution (n,)
    """

    kept: Array
    finish: Callable[[Array], Array]


class LinearSolver(ABC):
    """An analysed pattern; after `factorise`, a factor."""

    def __init__(self, upper: sparse.csr_array, kept: Ints) -> None:
        self._upper, self._kept = upper, kept

    @abstractmethod
    def factorise(self, data: Array) -> None:
        """Factorise the upper triangle with these values; raise `Singular` if that fails."""

    @abstractmethod
    def solve(self, b: Array) -> Array:
        """Return the solution for ``b`` (n,) or (n, k)."""

    def begin(self, b: Array) -> Begun:
        """Return the solution for ``b`` (n,) on the kept unknowns, to be finished later.

        It needs a second solve if the right-hand side changes.
        """
        first = self.solve(b)

        def finish(change: Array) -> Array:
            if not change.any():
                return first
            changed = b.copy()
            changed[self._kept] += change
            return self.solve(changed)

        return Begun(first[self._kept], finish)

    def compliance(self, rows: Array) -> Array:
        """Return ``rows A^-1 rows'`` (k, k) for ``rows`` (k, m) on the m kept unknowns."""
        columns = np.zeros((self._upper.shape[0], len(rows)))
        columns[self._kept] = rows.T
        W = rows @ self.solve(columns)[self._kept]
        return 0.5 * (W + W.T)


class SuperLU(LinearSolver):
    """SuperLU, which comes with SciPy."""

    def __init__(self, upper: sparse.csr_array, kept: Ints) -> None:
        super().__init__(upper.copy(), kept)

    def __sizeof__(self) -> int:
        """Return the bytes including the factor, which is not on Python's heap."""
        entries = self._factor.nnz if hasattr(self, "_factor") else 0
        return object.__sizeof__(self) + 12 * entries

    def factorise(self, data: Array) -> None:
        """See `LinearSolver`."""
        self._upper.data = np.asarray(data, dtype=float)
        matrix = self._upper + sparse.triu(self._upper, 1, format="csr").T
        try:
            self._factor = splu(
                matrix.tocsc(),
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )
        except RuntimeError as error:
            raise Singular(str(error)) from error

    def solve(self, b: Array) -> Array:
        """See `LinearSolver`."""
        return np.asarray(self._factor.solve(np.ascontiguousarray(b)))


class PardisoSolver(LinearSolver):
    """MKL PARDISO: Cholesky, or LDL' if a pivot is not positive."""

    def __init__(self, upper: sparse.csr_array, kept: Ints, ordering: int) -> None:
        super().__init__(upper, kept)
        self._definite = pardiso.Pardiso(upper, kept, ordering=ordering)
        self._indefinite: pardiso.Pardiso | None = None
        self._current = self._definite

    def factorise(self, data: Array) -> None:
        """See `LinearSolver`."""
        if not np.isfinite(data).all():
            raise Singular("the matrix is not finite")
        try:
            self._definite.factorise(data)
            self._current = self._definite
        except pardiso.PardisoError as failure:
            if failure.code != pardiso.NOT_POSITIVE:
                raise Singular(str(failure)) from failure
            if self._indefinite is None:
                self._indefinite = pardiso.Pardiso(self._upper, kind=pardiso.INDEFINITE)
            try:
                self._indefinite.factorise(data)
            except pardiso.PardisoError as error:
                raise Singular(str(error)) from error
            self._current = self._indefinite

    def solve(self, b: Array) -> Array:
        """See `LinearSolver`."""
        return self._current.solve(b)

    def begin(self, b: Array) -> Begun:
        """See `LinearSolver`."""
        if self._current is not self._definite or not len(self._kept):
            return super().begin(b)
        half = self._definite.forward(b)
        right = half[self._kept]

        def finish(change: Array) -> Array:
            return self._definite.backward(half, self._definite.on_kept(right + change))

        return Begun(self._definite.on_kept(right), finish)

    def compliance(self, rows: Array) -> Array:
        """See `LinearSolver`."""
        if self._current is self._definite:
            return self._definite.compliance(rows)
        return super().compliance(rows)


class _SuperLUFactors:
    """The factors of several positive definite matrices of one pattern."""

    def __init__(self, upper: sparse.csr_array, count: int) -> None:
        self._each = [SuperLU(upper, np.zeros(0, dtype=np.int64)) for _ in range(count)]

    def factorise(self, data: Array, which: int) -> None:
        """Factorise the upper triangle with these values, as matrix number ``which``.

        Raises `Singular` if that fails.
        """
        self._each[which].factorise(data)

    def solve(self, b: NDArray[Any], which: int) -> NDArray[Any]:
        """Return the solution for ``b`` (n,) or (n, k) with the matrix number ``which``.

        It has the precision of ``b``, single or double.
        """
        return self._each[which].solve(b.astype(float)).astype(b.dtype)


class _PardisoFactors:
    """The same by PARDISO: one analysis per precision, ordered by minimum degree.

    A matrix that is not positive definite in single precision has factors only in double.
    """

    def __init__(self, upper: sparse.csr_array, count: int) -> None:
        self._double, self._single = (
            pardiso.Pardiso(upper, ordering=pardiso.MINIMUM_DEGREE, count=count, single=single)
            for single in (False, True)
        )
        self._in_single = np.zeros(count, dtype=bool)

    def factorise(self, data: Array, which: int) -> None:
        """See `_SuperLUFactors`."""
        try:
            self._double.factorise(data, which)
        except pardiso.PardisoError as failure:
            raise Singular(str(failure)) from failure
        self._in_single[which] = True
        try:
            self._single.factorise(data, which)
        except pardiso.PardisoError:
            self._in_single[which] = False

    def solve(self, b: NDArray[Any], which: int) -> NDArray[Any]:
        """See `_SuperLUFactors`."""
        if b.dtype == np.float32 and self._in_single[which]:
            return self._single.solve(b, which)
        return self._double.solve(b, which).astype(b.dtype, copy=False)


Factors = _SuperLUFactors | _PardisoFactors


def chosen(name: str = "auto") -> str:
    """Return the solver that ``name`` stands for here: ``"pardiso"`` or ``"superlu"``.

    Raises
    ------
    ModelError : the solver named is unknown or not installed
    """
    name = os.environ.get("RESIDUA_LINEAR_SOLVER", name) if name == "auto" else name
    if name not in SOLVERS:
        raise ModelError("linear_solver", name, "must be one of " + ", ".join(SOLVERS))
    available = pardiso.library() is not None
    if name == "pardiso" and not available:
        raise ModelError("linear_solver", name, "needs MKL: pip install mkl")
    return "pardiso" if available and name != "superlu" else "superlu"


def analyse(
    upper: sparse.csr_array,
    name: str = "auto",
    kept: Ints | None = None,
    *,
    coupled: bool = False,
) -> LinearSolver:
    """Return a solver for matrices with the pattern of ``upper``.

    Parameters
    ----------
    kept : (m,) increasing, unknowns of `LinearSolver.compliance`
    coupled : whether part of the unknowns are densely coupled and none kept: PARDISO then orders by
        minimum degree. In a window of 13 600 unknowns of a half-plane this halves the time of
        analysis and solves

    Raises
    ------
    ModelError : the solver named is unknown or not installed
    """
    kept = np.zeros(0, dtype=np.int64) if kept is None else kept
    if chosen(name) != "pardiso":
        return SuperLU(upper, kept)
    ordering = pardiso.MINIMUM_DEGREE if coupled else pardiso.DISSECTION
    return PardisoSolver(upper, kept, ordering)


def analyse_several(upper: sparse.csr_array, count: int, name: str = "auto") -> Factors:
    """Return a solver for ``count`` positive definite matrices of one pattern.

    It suits some thousand unknowns, part of them densely coupled: PARDISO orders by minimum degree,
    which gives a fifth fewer entries than nested dissection.

    Raises
    ------
    ModelError : the solver named is unknown or not installed
    """
    if chosen(name) == "pardiso":
        return _PardisoFactors(upper, count)
    return _SuperLUFactors(upper, count)


@cache
def _controller() -> ThreadpoolController:
    return ThreadpoolController()


def one_thread() -> AbstractContextManager[object]:
    """Return a context in which BLAS uses one thread."""
    return _controller().limit(limits=1, user_api="blas")
