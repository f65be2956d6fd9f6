"""Tresca plasticity with isotropic hardening: return mapping to a face or an edge."""

from __future__ import annotations

import numpy as np

from solver.materials.curves import Curve
from solver.materials.principal_return import Returned, grown
from solver.typing import Array

_FACE = np.array([1.0, 0.0, -1.0])
_EDGES = np.array([[1.0, -1.0, 0.0], [0.0, 1.0, -1.0]])
"""Flow on the second face at the edges s2 = s3 and s1 = s2; `_FACE` is that on face s1 - s3."""


def tresca_return(trial: Array, before: Array, G: float, curve: Curve) -> Returned:
    """Return to the face or, where the result is not on it, to the edge.

    1. return to the face, flow (1, 0, -1): 4 G dp + R(p + dp) = s1 - s3
    2. if that changes the order of the stresses, return to the edge: flow on two faces with
       multipliers a and b, dp = a + b. With the differences f1 and f2 of trial stresses on them:
       3 G dp + R(p + dp) = (f1 + f2) / 2 and a - b = (f1 - f2) / (2 G)

    Parameters
    ----------
    trial : (3, n) principal trial stresses s1 >= s2 >= s3 beyond the surface [MPa]
    before : (n,) p, the accumulated plastic strain

    References
    ----------
    E.A. de Souza Neto, D. Peric, D.R.J. Owen, Computational Methods for Plasticity (2008),
    section 8.1.
    """
    growth, slope = grown(4 * G, trial[0] - trial[2], before, curve)
    face = growth * _FACE[:, None]
    inside = (np.diff(trial - 2 * G * face, axis=0) <= 0).all(axis=0)
    out = np.outer(_FACE, _FACE)[:, :, None] * (2 * G / (4 * G + slope))

    derivative = np.eye(3)[:, :, None] - out
    at = np.flatnonzero(~inside)
    if len(at):
        face[:, at], growth[at], derivative[:, :, at] = _on_edge(trial[:, at], before[at], G, curve)
    return Returned(face, growth, derivative)


def _on_edge(trial: Array, before: Array, G: float, curve: Curve) -> Returned:
    """Return to the nearer edge."""
    other = np.where(trial[0] + trial[2] > 2 * trial[1], _EDGES[0][:, None], _EDGES[1][:, None])
    first, second = trial[0] - trial[2], (other * trial).sum(axis=0)
    both, slope = grown(3 * G, 0.5 * (first + second), before, curve)
    mean, half = 0.5 * (_FACE[:, None] + other), 0.5 * (_FACE[:, None] - other)
    edge = both * mean + (first - second) / (2 * G) * half
    stiff = 2 * G / (3 * G + slope)
    out = stiff * mean[:, None] * mean[None] + 2 * half[:, None] * half[None]
    return Returned(edge, both, np.eye(3)[:, :, None] - out)
