"""Return mapping of an isotropic material in principal stresses, for any yield surface."""

from __future__ import annotations

import numpy as np

from solver.materials.curves import Curve
from solver.materials.elasticity import Elasticity
from solver.materials.state import PlasticState, Response
from solver.materials.yield_surface import IsotropicSurface
from solver.tensors import PAIRS, dyad, principal, von_mises
from solver.typing import Array

_ALIKE = 1e-10
"""Ratio of the difference of two principal stresses to the largest one; up to it they are equal."""


def principal_return(
    strain: Array,
    state: PlasticState,
    elasticity: Elasticity,
    curve: Curve,
    surface: IsotropicSurface,
) -> Response:
    """Return stress, consistent tangent and new state for all strain components given.

    1. trial: elastic strain with the plastic strain frozen, its principal stresses s1 >= s2 >= s3
    2. elastic where their equivalent stress is not above R(p)
    3. elsewhere the surface gives the plastic flow; the order of the stresses does not change
    4. principal directions are those of the trial stress. Tangent: the derivative of the principal
       stresses, and (s_i - s_j) / (trial_i - trial_j) for the rotation of the directions

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
    most = surface.over_mises * von_mises(stress)
    at = np.flatnonzero(most > curve.flow_stress(state.accumulated))
    values, directions = principal(stress[:, at])
    beyond = surface.of_principal(values) > curve.flow_stress(state.accumulated[at])
    at, values, directions = at[beyond], values[:, beyond], directions[:, :, beyond]
    if not len(at):
        return Response(stress, tangent, state, yielding)

    yielding[at] = True
    G = elasticity.shear_modulus
    found = surface.returned(values, state.accumulated[at], G, curve)
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
        difference = values[i] - values[j]
        alike = difference <= _ALIKE * (values[0] - values[2])
        ratio = (after[i] - after[j]) / np.where(alike, 1.0, difference)
        limit = found.derivative[i, i] - found.derivative[i, j]
        mixed = dyad(directions, i, j, n_components)
        turn += np.where(alike, limit, ratio) * mixed[:, None] * mixed[None]
    tangent[:, :, at] = np.einsum("abn,bc->acn", turn, C)
    return Response(stress, tangent, PlasticState(plastic_strain, accumulated), yielding)
