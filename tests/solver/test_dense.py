"""Dense equations in single precision, refined to double."""

import numpy as np
import pytest
from scipy.linalg import hilbert

from solver.linear.iterative import RefinedLU


@pytest.mark.parametrize("size", [3, 200])
def test_solution_has_the_digits_of_double_precision(size: int) -> None:
    random = np.random.default_rng(size)
    matrix, exact = np.eye(size) + random.normal(size=(size, size)), random.normal(size=size)
    found = RefinedLU(matrix).solve(matrix @ exact)
    assert np.abs(found - exact).max() < 1e-8 * np.linalg.cond(matrix)


def test_matrix_beyond_single_precision_is_solved_in_double() -> None:
    matrix, right = hilbert(10), np.ones(10)  # condition 1.6e13
    found = RefinedLU(matrix).solve(right)
    assert np.linalg.norm(matrix @ found - right) < 1e-14 * np.linalg.norm(found)


def test_singular_matrix_is_told() -> None:
    with pytest.raises(ZeroDivisionError, match="singular"):
        RefinedLU(np.ones((2, 2)))
