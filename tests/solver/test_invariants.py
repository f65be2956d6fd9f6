"""Invariants that are derived from stored tensors."""

from __future__ import annotations

import numpy as np
import pytest

from solver.tensors import INVARIANTS, component, components, known_components, principal_of


@pytest.mark.parametrize("count", [4, 6])
def test_they_are_those_of_the_eigenvalues(count: int) -> None:
    tensor = np.random.default_rng(3).normal(size=(count, 5, 7))
    full = np.zeros((5, 7, 3, 3))
    for value, (i, j) in zip(
        tensor, ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0)), strict=False
    ):
        full[..., i, j] = full[..., j, i] = value
    wanted = np.linalg.eigvalsh(full)[..., ::-1]
    for number in range(3):
        found = component(tensor, f"principal_{number + 1}")
        np.testing.assert_allclose(found, wanted[..., number], atol=1e-13)
    np.testing.assert_allclose(
        component(tensor, "tresca"), wanted[..., 0] - wanted[..., 2], atol=1e-13
    )
    np.testing.assert_allclose(component(tensor, "hydrostatic"), wanted.mean(axis=-1), atol=1e-13)
    for name, values in zip(components(count), tensor, strict=True):
        np.testing.assert_array_equal(component(tensor, name), values)
    assert known_components(count) == (*components(count), *INVARIANTS)


def test_pure_shear_pulls_at_45_degrees() -> None:
    values, directions = principal_of(np.array([0.0, 0.0, 0.0, 50.0]))
    np.testing.assert_allclose(values, [50.0, 0.0, -50.0], atol=1e-12)
    np.testing.assert_allclose(np.abs(directions[:, 0]), [0.5**0.5, 0.5**0.5, 0.0], atol=1e-12)
    assert directions[0, 0] * directions[1, 0] > 0.0


def test_where_a_tensor_is_unknown_so_are_its_invariants() -> None:
    tensor = np.full((4, 2), np.nan)
    tensor[:, 1] = 1.0
    for name in INVARIANTS:
        assert np.isnan(component(tensor, name)).tolist() == [True, False]
