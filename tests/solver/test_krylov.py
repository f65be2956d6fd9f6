"""GMRES: residual, number of products, and what it does where there is no solution."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from solver.linear.iterative import gmres

Array = NDArray[np.float64]


def matrix(n: int) -> Array:
    """Identity less a smaller, unsymmetric matrix."""
    return np.eye(n) - 0.5 * np.random.default_rng(4).standard_normal((n, n)) / np.sqrt(n)


@pytest.mark.parametrize("tolerance", [0.1, 1e-4, 1e-10])
def test_the_residual_is_below_the_tolerance_and_no_product_is_left_over(tolerance: float) -> None:
    A, b = matrix(200), np.random.default_rng(5).standard_normal(200)
    taken: list[Array] = []

    def product(x: Array) -> Array:
        taken.append(x)
        return A @ x

    x, solved = gmres(product, b, tolerance, 60)
    assert solved
    assert np.linalg.norm(b - A @ x) <= tolerance * np.linalg.norm(b) * (1 + 1e-9)
    # the residual is the least one that the products allow, and one product less does not do
    for count, enough in ((len(taken), True), (len(taken) - 1, False)):
        made = A @ np.stack(taken[:count], axis=1)
        least = b - made @ np.linalg.lstsq(made, b)[0]
        small = np.linalg.norm(least) <= tolerance * np.linalg.norm(b) * (1 + 1e-9)
        assert bool(small) is enough


def test_too_few_products_are_told() -> None:
    A, b = matrix(50), np.ones(50)
    x, solved = gmres(lambda v: A @ v, b, 1e-12, 3)
    assert not solved
    assert np.linalg.norm(b - A @ x) < np.linalg.norm(b)


@pytest.mark.parametrize("good", [0, 2])
def test_a_product_that_is_not_finite_ends_it(good: int) -> None:
    made = iter(range(9))

    def product(v: Array) -> Array:
        return v[::-1] + v if next(made) < good else np.full_like(v, np.nan)

    x, small = gmres(product, np.arange(4.0), 1e-9, 5)
    assert not small
    assert np.isfinite(x).all()


def test_a_right_hand_side_of_zeros_needs_no_product() -> None:
    x, solved = gmres(lambda v: pytest.fail("a product was asked for"), np.zeros(3), 0.1, 5)
    assert solved
    assert not x.any()


def test_an_equation_without_solution_ends_at_the_least_residual() -> None:
    A, b = np.diag([1.0, 0.0]), np.array([1.0, 1.0])
    x, solved = gmres(lambda v: A @ v, b, 1e-3, 10)
    assert not solved
    assert A @ x == pytest.approx([1.0, 0.0], abs=1e-12)
