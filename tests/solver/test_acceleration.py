"""What a tangent lacks steadily is measured from the steps it makes."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from solver.loading.step import Series


def steps_needed(M, *, mixed=True, most=300, share=lambda iteration: 1.0):
    """Iterations until ``x - x* -> M (x - x*)`` has left 1e-10 of its first error."""
    series, solution = Series(), np.arange(1.0, len(M) + 1)
    x, forces, status = np.zeros(len(M)), np.zeros(2), np.array([1, 0])
    for iteration in range(most):
        error = x - solution
        if np.abs(error).max() < 1e-10 * np.abs(solution).max():
            return iteration
        du = M @ error - error
        candidates = SimpleNamespace(vertices=(np.array([0, 1]),), forces=forces)
        step = SimpleNamespace(u=(du,), forces=forces + du[:2], status=status)
        part = share(iteration)
        ahead = series.sum((x,), candidates, step, part) if mixed else None
        (x,), forces = ahead if ahead is not None else ((x + part * du,), step.forces)
    return most


def turning(size, angle):
    """A map that turns by an angle and shrinks to ``size``."""
    c, s = np.cos(angle), np.sin(angle)
    return size * np.array([[c, -s], [s, c]])


@pytest.mark.parametrize(
    "M", [np.diag([0.9, 0.1]), np.diag([-1.05, 0.2]), np.diag([0.95, -0.9]), turning(0.95, 1.2)]
)
def test_a_slow_series_is_summed(M):
    assert steps_needed(M) < 20
    assert steps_needed(M, mixed=False) > 100


def test_a_fast_series_is_left_alone():
    M = np.diag([0.5, 0.1, -0.3])
    assert steps_needed(M) == steps_needed(M, mixed=False)


def test_steps_that_grow_in_one_direction_are_left_alone():
    """A body that flows moves on and on; the way back to where it came from is no solution."""
    assert steps_needed(np.diag([1.5, 0.1])) == 300


def test_a_partial_step_ends_a_series():
    """After it points are plastic that were elastic: what the tangent lacks is not the same."""
    M, every_fifth = np.diag([0.9, 0.1]), lambda iteration: 1.0 if iteration % 5 else 0.99
    mixed, alone = (steps_needed(M, mixed=m, share=every_fifth) for m in (True, False))
    assert mixed == alone > 100
