"""The frame of rigid bodies and wheels: its rows are derivatives of its motion."""

from __future__ import annotations

import numpy as np
import pytest

from solver.fem.rigid import MovingFrame, RigidMotion, turning

FRAME = MovingFrame(centre=np.array([2.0, -1.0]), radius=5.0)
X = np.array([[2.0, 4.0, -3.0], [-1.0, 0.5, 2.5]])
Q = np.array([0.3, -0.7, 8.0])  # turned by 1.6 rad


def test_the_third_unknown_is_an_arc() -> None:
    assert FRAME.motion(Q) == RigidMotion(0.3, -0.7, pytest.approx(1.6))
    turned = FRAME.displacements(np.array([0.0, 0.0, np.pi / 2 * 5.0]), X) + X
    assert turned == pytest.approx(np.array([[2.0, 0.5, -1.5], [-1.0, 1.0, -6.0]]))


def test_a_frame_takes_along_what_is_displaced_in_it() -> None:
    d = np.array([[0.1, 0.2, 0.3], [0.4, -0.5, 0.6]])
    relative = FRAME.displacements(Q, X, d) - FRAME.displacements(Q, X)
    assert relative == pytest.approx(turning(1.6) @ d)
    assert np.linalg.norm(relative, axis=0) == pytest.approx(np.linalg.norm(d, axis=0))


def test_rows_are_derivatives_of_the_motion() -> None:
    nodal = np.random.default_rng(1).normal(size=(4, 3, 2))
    rows, h = FRAME.rows(Q, nodal.reshape(4, -1), FRAME.passing(X)), 1e-6
    for k, step in enumerate(h * np.eye(3)):
        moved = FRAME.displacements(Q + step, X) - FRAME.displacements(Q - step, X)
        change = np.einsum("mnd,dn->m", nodal, moved) / (2 * h)
        assert rows[:, k] == pytest.approx(change, abs=1e-8)
