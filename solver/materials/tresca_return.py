"""Tresca plasticity with isotropic hardening: the return in principal stresses."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from solver.materials.principal import PAIRS, dyad, principal
from solver.materials.scalar import multiplier
from solver.materials.state import PlasticState, Response
from solver.tensors import von_mises

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.materials.curves import Curve
    from solver.materials.elasticity import Elasticity

    Array = NDArray[np.float64]

_FACE = np.array([1.0, 0.0, -1.0])
_EDGES = np.array([[1.0, -1.0, 0.0], [0.0, 1.0, -1.0]])
"""Flow on the face s1 - s3, and on the other one at the edges s2 = s3 and s1 = s2."""
_INSCRIBED = 2 / np.sqrt(3)
"""Tresca's equivalent stress is at most so many times that of von Mises."""
_ALIKE = 1e-10


def tresca_return(
    strain: Array, state: PlasticState, elasticity: Elasticity, curve: Curve
) -> Response:
    """Return stress and consistent tangent where all strain components are given.

    1. trial: elastic strain with the plastic strain frozen, its principal stresses s1 >= s2 >= s3
    2. f = s1 - s3 - R(p); elastic where f <= 0
    3. return to the face, flow (1, 0, -1): 4 G dp + R(p + dp) = s1 - s3
    4. where that changes the order of the stresses, to the edge: flow on two faces by multipliers a
       and b, dp = a + b, with the differences f1 and f2 of trial stresses on them:
       3 G dp + R(p + dp) = (f1 + f2) / 2 and a - b = (f1 - f2) / (2 G)
    5. principal directions are those of the trial stress. Tangent: the derivative of the principal
       stresses, and (s_i - s_j) / (trial_i - trial_j) for what turns the directions

    Parameters
    ----------
    strain : (n_components, n_points) total Mandel strain
    state : internal variables of the last converged state, left unchanged

    References
    ----------
    E.A. de Souza Neto, D. Peric, D.R.J. Owen, Computational Methods for Plasticity (2008),
    section 8.1 (return), appendix A (isotropic functions of a tensor).
    """
    n_components, n_points = strain.shape
    C = elasticity.stiffness(n_components)
    stress = C @ (strain - state.plastic_strain)
    tangent = np.repeat(C[:, :, None], n_points, axis=2)
    yielding = np.zeros(n_points, dtype=bool)
    at = np.flatnonzero(_INSCRIBED * von_mises(stress) > curve.flow_stress(state.accumulated))
    values, directions = principal(stress[:, at])
    beyond = values[0] - values[2] > curve.flow_stress(state.accumulated[at])
    at, values, directions = at[beyond], values[:, beyond], directions[:, :, beyond]
    if not len(at):
        return Response(stress, tangent, state, yielding)

    yielding[at] = True
    G = elasticity.shear_modulus
    found = _returned(values, state.accumulated[at], G, curve)
    plastic_strain, accumulated = state.plastic_strain.copy(), state.accumulated.copy()
    accumulated[at] += found.growth
    turn = np.zeros((n_components, n_components, len(at)))
    own = [dyad(directions, i, i, n_components) for i in range(3)]
    for i in range(3):
        plastic_strain[:, at] += found.flow[i] * own[i]
        stress[:, at] -= 2 * G * found.flow[i] * own[i]
        for j in range(3):
            turn += found.derivative[i, j] * own[i][:, None] * own[j][None]
    after = values - 2 * G * found.flow
    for i, j in PAIRS:
        apart = values[i] - values[j]
        alike = apart <= _ALIKE * (values[0] - values[2])
        ratio = (after[i] - after[j]) / np.where(alike, 1.0, apart)
        limit = found.derivative[i, i] - found.derivative[i, j]
        mixed = dyad(directions, i, j, n_components)
        turn += np.where(alike, limit, ratio) * mixed[:, None] * mixed[None]
    tangent[:, :, at] = np.einsum("abn,bc->acn", turn, C)
    return Response(stress, tangent, PlasticState(plastic_strain, accumulated), yielding)


class _Returned(NamedTuple):
    """Principal plastic strains (3, n), multiplier (n,), d stress / d trial stress (3, 3, n)."""

    flow: Array
    growth: Array
    derivative: Array


def _returned(trial: Array, before: Array, G: float, curve: Curve) -> _Returned:
    """Return to the face, and where that is not on it, to the edge."""
    growth, slope = _grown(4 * G, trial[0] - trial[2], before, curve)
    face = growth * _FACE[:, None]
    inside = (np.diff(trial - 2 * G * face, axis=0) <= 0).all(axis=0)
    out = np.outer(_FACE, _FACE)[:, :, None] * (2 * G / (4 * G + slope))

    derivative = np.eye(3)[:, :, None] - out
    at = np.flatnonzero(~inside)
    if len(at):
        face[:, at], growth[at], derivative[:, :, at] = _on_edge(trial[:, at], before[at], G, curve)
    return _Returned(face, growth, derivative)


def _on_edge(trial: Array, before: Array, G: float, curve: Curve) -> _Returned:
    """Return to the edge that the trial stress is nearer to."""
    other = np.where(trial[0] + trial[2] > 2 * trial[1], _EDGES[0][:, None], _EDGES[1][:, None])
    first, second = trial[0] - trial[2], (other * trial).sum(axis=0)
    both, slope = _grown(3 * G, 0.5 * (first + second), before, curve)
    mean, half = 0.5 * (_FACE[:, None] + other), 0.5 * (_FACE[:, None] - other)
    edge = both * mean + (first - second) / (2 * G) * half
    stiff = 2 * G / (3 * G + slope)
    out = stiff * mean[:, None] * mean[None] + 2 * half[:, None] * half[None]
    return _Returned(edge, both, np.eye(3)[:, :, None] - out)


def _grown(stiff: float, trial: Array, before: Array, curve: Curve) -> tuple[Array, Array]:
    """Return the multipliers dp (n,) of ``stiff dp + R(p + dp) = trial``, and the slopes of R."""

    def excess(growth: Array) -> tuple[Array, Array]:
        p = before + growth
        return trial - stiff * growth - curve.flow_stress(p), -stiff - curve.slope(p)

    most = np.maximum(trial - curve.flow_stress(before), 0.0) / stiff
    growth = multiplier(excess, most * (1 + 1e-9), np.abs(trial))
    return growth, curve.slope(before + growth)
