"""Linear solvers: the same answers behind one interface."""

from __future__ import annotations

import gc

import numpy as np
import pytest
from scipy import sparse

from solver.errors import ModelError
from solver.linear import pardiso
from solver.linear import solvers as linear
from solver.linear.schur import SchurComplement

NAMES = ["superlu", *(["pardiso"] if pardiso.library() else [])]


def matrix(n=30, shift=0.0, seed=0):
    one = sparse.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(n, n))
    eye = sparse.eye_array(n)
    A = (sparse.kron(one, eye) + sparse.kron(eye, one) - shift * sparse.eye_array(n * n)).tocsr()
    return A, sparse.csr_array(sparse.triu(A, format="csr"))


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("shift", [0.0, 0.51])
def test_solve_and_compliance_match_dense_algebra(name, shift):
    A, upper = matrix(shift=shift)
    columns = np.random.default_rng(3).standard_normal((A.shape[0], 7))
    kept = np.array([3, 17, 18, 400, 899])
    rows = np.random.default_rng(4).standard_normal((7, len(kept)))
    solver = linear.analyse(upper, name, kept)
    for scale in (1.0, 3.0):
        solver.factorise(scale * upper.data)
        exact = np.linalg.solve(scale * A.toarray(), columns)
        size = np.abs(exact).max()
        assert np.abs(solver.solve(columns) - exact).max() < 1e-9 * size
        assert np.abs(solver.solve(columns[:, 0]) - exact[:, 0]).max() < 1e-9 * size
        W = rows @ np.linalg.inv(scale * A.toarray())[np.ix_(kept, kept)] @ rows.T
        assert np.abs(solver.compliance(rows) - W).max() < 1e-9 * np.abs(W).max()


@pytest.mark.parametrize("name", NAMES)
def test_several_matrices_of_one_pattern_keep_their_factors(name):
    A, upper = matrix()
    b = np.random.default_rng(5).standard_normal((A.shape[0], 2))
    factors = linear.analyse_several(upper, 3, name)
    for which, shift in enumerate((0.0, 1.0, 5.0)):
        shifted = upper + shift * sparse.eye_array(A.shape[0])
        factors.factorise(sparse.csr_array(shifted).data, which)
    for which, shift in ((2, 5.0), (0, 0.0), (1, 1.0)):
        exact = np.linalg.solve(A.toarray() + shift * np.eye(A.shape[0]), b)
        assert factors.solve(b, which) == pytest.approx(exact, abs=1e-9 * np.abs(exact).max())
    with pytest.raises(linear.Singular):
        factors.factorise(np.full_like(upper.data, np.nan), 1)


@pytest.mark.parametrize("name", NAMES)
def test_indefinite_matrix_is_solved_too(name):
    A, upper = matrix(shift=0.51)
    assert np.linalg.eigvalsh(A.toarray()).min() < 0
    solver = linear.analyse(upper, name)
    solver.factorise(upper.data)
    b = np.ones(A.shape[0])
    assert np.abs(A @ solver.solve(b) - b).max() < 1e-8


def test_matrix_that_is_not_finite_is_refused():
    _, upper = matrix(n=4)
    for name in NAMES:
        with pytest.raises(linear.Singular):
            linear.analyse(upper, name).factorise(np.full_like(upper.data, np.nan))


@pytest.mark.skipif(not pardiso.library(), reason="needs the mkl extra")
def test_pardiso_frees_its_memory():
    import psutil

    _, upper = matrix(n=120)

    def once():
        solver = linear.analyse(upper, "pardiso")
        solver.factorise(upper.data)
        solver.solve(np.ones(upper.shape[0]))

    once()
    gc.collect()
    before = psutil.Process().memory_info().rss
    for _ in range(20):
        once()
    gc.collect()
    growth = psutil.Process().memory_info().rss - before
    assert growth < 40e6  # 20 leaked handles of this matrix hold over 200 MB


def test_unknown_solver_is_refused_by_name():
    _, upper = matrix(n=3)
    with pytest.raises(ModelError, match="linear_solver"):
        linear.analyse(upper, "umfpack")


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("shift", [0.0, 0.51])
def test_a_solution_begun_is_finished_for_any_change_on_the_kept_unknowns(name, shift):
    """Positive definite by halves, indefinite by two whole solutions."""
    A, upper = matrix(shift=shift)
    kept = np.array([3, 17, 18, 400, 899])
    b, change = np.random.default_rng(5).standard_normal((2, A.shape[0]))
    changed = b.copy()
    changed[kept] += change[kept]
    solver = linear.analyse(upper, name, kept)
    solver.factorise(upper.data)
    begun = solver.begin(b)
    size = np.abs(solver.solve(b)).max()
    assert np.abs(A @ begun.finish(change[kept]) - changed).max() < 1e-9 * size
    assert np.abs(A @ begun.finish(0 * kept) - b).max() < 1e-9 * size
    assert np.abs(begun.kept - solver.solve(b)[kept]).max() < 1e-9 * size


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("held", [True, False], ids=["held", "free"])
def test_a_schur_complement_is_that_of_dense_algebra(name, held):
    """A grid of 30 by 30 springs: 50 unknowns are kept, held ones are zero."""
    A, _ = matrix()
    if not held:  # no force for equal displacements of all
        A = sparse.csr_array(A - sparse.diags_array(A.sum(axis=1)))
    at = np.arange(A.shape[0])
    kept = at[100:150]
    inside = np.setdiff1d(at, np.concatenate([kept, at[:100] if held else []]))
    found = SchurComplement(A, kept, inside, name)
    dense = A.toarray()
    couple, inverse = dense[np.ix_(kept, inside)], np.linalg.inv(dense[np.ix_(inside, inside)])
    taken = np.zeros((50, 50))
    taken[np.ix_(found.boundary, found.boundary)] = found.taken
    assert np.abs(taken - couple @ inverse @ couple.T).max() < 1e-13 * np.abs(dense).max()
    force = np.random.default_rng(7).standard_normal((len(at), 3))
    u = np.random.default_rng(8).standard_normal((50, 3))
    for k in (np.s_[:], 0):
        begun = found.begin(force[:, k])
        condensed = force[kept][:, k] - couple @ inverse @ force[inside][:, k]
        assert np.abs(begun.condensed - condensed).max() < 1e-12 * np.abs(condensed).max()
        inner = inverse @ (force[inside][:, k] - couple.T @ u[:, k])
        whole = begun.finish(u[:, k])
        assert np.abs(whole[inside] - inner).max() < 1e-11 * np.abs(inner).max()
        assert np.array_equal(whole[kept], u[:, k])
        assert not whole[:100].any() or not held
