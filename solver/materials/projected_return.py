"""Von Mises plasticity in plane stress: the projected return of Simo and Taylor.

`PlaneStress` uses it for linear hardening; it is faster than solving for the thickness strain. In
the modes ``(xx + yy, xx - yy) / sqrt(2)`` and ``sqrt(2) xy`` both the elastic stiffness and the
deviatoric projection P are diagonal, and the return is one scalar equation per point.
"""

from __future__ import annotations

import numpy as np

from solver.materials.elasticity import Elasticity
from solver.materials.radial_return import SQRT23, LinearHardening
from solver.materials.state import PlasticState, Response
from solver.typing import Array

_IN_PLANE = np.array([0, 1, 3])
_MODES = np.array([[1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 0.0, np.sqrt(2.0)]]) / np.sqrt(2.0)
_FROM_ALL = np.zeros((3, 4))
_FROM_ALL[:, _IN_PLANE] = _MODES
_P = np.array([1 / 3, 1.0, 1.0])[:, None]
_MAX_ITERATIONS = 50


def plane_stiffness(elasticity: Elasticity) -> Array:
    """Return the elastic stiffness (4, 4) on Mandel strain, row and column zz zero [MPa]."""
    return np.asarray((_FROM_ALL.T * _modal_stiffness(elasticity)) @ _FROM_ALL)


def _modal_stiffness(elasticity: Elasticity) -> Array:
    G = elasticity.shear_modulus
    return np.array([elasticity.youngs_modulus / (1 - elasticity.poisson_ratio), 2 * G, 2 * G])


def projected_return(
    strain: Array, state: PlasticState, elasticity: Elasticity, hardening: LinearHardening
) -> Response:
    """Return stress with zz = 0, consistent tangent and new state.

    With eta = stress - back stress in the modes, c the modal stiffness and g the multiplier:

    1. eta(g) = eta_trial / (1 + g (c P + 2/3 Hk)), phi(g) = sqrt(eta P eta)
    2. solve sqrt(2/3) R(p) = phi(g), p = p_n + sqrt(2/3) g phi; written as
       F(g) = sqrt(2/3) R_n / phi(g) + 2/3 Hi g - 1 = 0, which is increasing and concave, so
       Newton's iteration from g = 0 approaches the root from the left without a safeguard
    3. plastic strain += g P eta, its zz part is minus the sum of xx and yy
    4. tangent = Xi - (Xi P eta)(Xi P eta)' / (eta P Xi P eta (1 + beta))

    Parameters
    ----------
    strain : (4, n_points) total Mandel strain; its zz row is not read
    state : internal variables of the last converged state, left unchanged

    References
    ----------
    J.C. Simo, R.L. Taylor, Int. J. Numer. Meth. Engng 22 (1986) 649-670;
    Simo & Hughes (1998), box 3.3, p. 130-131.
    """
    n_points = strain.shape[1]
    C = plane_stiffness(elasticity)
    stress = C @ (strain - state.plastic_strain)
    tangent = np.repeat(C[:, :, None], n_points, axis=2)
    if np.isinf(hardening.yield_stress):
        return Response(stress, tangent, state, np.zeros(n_points, dtype=bool))

    Hi, Hk = hardening.isotropic_modulus, hardening.kinematic_modulus
    prager = hardening.prager_modulus
    radius = SQRT23 * hardening.flow_stress(state.accumulated)
    # P back = prager * plastic strain, P diagonal in the modes
    modal_back = hardening.back_stress(_MODES @ state.plastic_strain[_IN_PLANE]) / _P
    trial = _MODES @ stress[_IN_PLANE] - modal_back
    yielding = np.sqrt((_P * trial**2).sum(axis=0)) > radius
    if not yielding.any():
        return Response(stress, tangent, state, yielding)

    at = np.flatnonzero(yielding)
    c = _modal_stiffness(elasticity)[:, None]
    g, eta, phi = _multiplier(trial[:, at], radius[at], c * _P + prager, Hi)

    flow = _P * eta
    increment = _MODES.T @ (g * flow)
    plastic_strain = state.plastic_strain.copy()
    accumulated = state.accumulated.copy()
    plastic_strain[np.ix_(_IN_PLANE, at)] += increment
    plastic_strain[2, at] -= increment[0] + increment[1]
    accumulated[at] += SQRT23 * g * phi
    stress[np.ix_(_IN_PLANE, at)] -= _MODES.T @ (c * g * flow)

    theta1 = 1 + prager * g
    theta2 = 1 - 2 / 3 * Hi * g
    Xi = 1 / (1 / c + g / theta1 * _P)
    Xi_flow = Xi * flow
    along = (flow * Xi_flow).sum(axis=0)
    beta = 2 / 3 * theta1 / theta2 * (Hi * theta1 + Hk * theta2) * phi**2 / along
    modal = -Xi_flow[:, None] * Xi_flow[None] / (along * (1 + beta))
    modal[np.arange(3), np.arange(3)] += Xi
    rows, columns = np.ix_(_IN_PLANE, _IN_PLANE)
    tangent[rows[..., None], columns[..., None], at] = np.einsum(
        "ma,mnp,nb->abp", _MODES, modal, _MODES
    )
    return Response(stress, tangent, PlasticState(plastic_strain, accumulated), yielding)


def _multiplier(trial: Array, radius: Array, rate: Array, Hi: float) -> tuple[Array, Array, Array]:
    """Solve step 2 for each point; return the multiplier, eta and phi."""
    g = np.zeros(trial.shape[1])
    for _ in range(_MAX_ITERATIONS):
        eta = trial / (1 + g * rate)
        phi = np.sqrt((_P * eta**2).sum(axis=0))
        F = radius / phi + 2 / 3 * Hi * g - 1
        if np.abs(F).max() < 1e-13:
            break
        slope = radius / phi**3 * (_P * eta**2 * rate / (1 + g * rate)).sum(axis=0) + 2 / 3 * Hi
        g = g - F / slope
    return g, eta, phi
