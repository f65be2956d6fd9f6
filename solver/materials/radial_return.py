"""Von Mises plasticity with mixed linear hardening: closed-form radial return."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.materials.elasticity import Elasticity
from solver.materials.state import PlasticState, Response
from solver.tensors import deviator, projections
from solver.typing import Array

SQRT23 = float(np.sqrt(2.0 / 3.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearHardening:
    """Linear isotropic and linear kinematic (Prager) hardening together.

    Attributes
    ----------
    yield_stress : Re, uniaxial stress at first yield; inf means never [MPa]
    isotropic_modulus : Hi, growth of the yield stress with equivalent plastic strain [MPa]
    kinematic_modulus : Hk, growth of the back stress with plastic strain in tension [MPa]
    """

    yield_stress: float
    isotropic_modulus: float = 0.0
    kinematic_modulus: float = 0.0

    @property
    def modulus(self) -> float:
        """H = Hi + Hk: slope of stress over plastic strain in tension [MPa]."""
        return self.isotropic_modulus + self.kinematic_modulus

    @property
    def prager_modulus(self) -> float:
        """2/3 Hk: ratio of back stress to plastic strain, as tensors [MPa]."""
        return 2 / 3 * self.kinematic_modulus

    def flow_stress(self, accumulated: Array) -> Array:
        """Return the size Re + Hi p (n,) of the yield surface at plastic strain p (n,) [MPa]."""
        return self.yield_stress + self.isotropic_modulus * accumulated

    def strength(self, accumulated: Array) -> Array:
        """Return the stress Re + H p (n,) of the tension curve at plastic strain p (n,) [MPa]."""
        return self.yield_stress + self.modulus * accumulated

    def back_stress(self, plastic_strain: Array) -> Array:
        """Return the centre of the yield surface (n_components, n) for Mandel strain [MPa]."""
        return self.prager_modulus * plastic_strain


def radial_return(
    strain: Array,
    state: PlasticState,
    elasticity: Elasticity,
    hardening: LinearHardening,
) -> Response:
    """Return stress, consistent tangent and new state for all strain components given.

    It serves plane strain and axisymmetry (4 components) and three dimensions (6 components).

    1. trial: elastic strain with the plastic strain frozen, relative deviator xi
    2. f = |xi| - sqrt(2/3) (Re + Hi p); elastic where f <= 0
    3. dgamma = f / (2G + 2/3 H), n = xi / |xi|
    4. plastic strain += dgamma n, p += sqrt(2/3) dgamma, stress -= 2G dgamma n
    5. tangent = C - 2G (1 - theta) Idev - 2G (theta_bar) n n

    Parameters
    ----------
    strain : (n_components, n_points) total Mandel strain
    state : internal variables of the last converged state, left unchanged

    References
    ----------
    J.C. Simo, T.J.R. Hughes, Computational Inelasticity (1998), boxes 3.1 and 3.2, p. 120-124.
    """
    n_components, n_points = strain.shape
    G, H = elasticity.shear_modulus, hardening.modulus
    C = elasticity.stiffness(n_components)
    stress = C @ (strain - state.plastic_strain)
    tangent = np.repeat(C[:, :, None], n_points, axis=2)
    if np.isinf(hardening.yield_stress):
        return Response(stress, tangent, state, np.zeros(n_points, dtype=bool))

    xi = deviator(stress) - hardening.back_stress(state.plastic_strain)
    size = np.linalg.norm(xi, axis=0)
    f = size - SQRT23 * hardening.flow_stress(state.accumulated)
    yielding = f > 0
    if not yielding.any():
        return Response(stress, tangent, state, yielding)

    at = np.flatnonzero(yielding)
    n = xi[:, at] / size[at]
    dgamma = f[at] / (2 * G + 2 / 3 * H)
    plastic_strain = state.plastic_strain.copy()
    accumulated = state.accumulated.copy()
    plastic_strain[:, at] += dgamma * n
    accumulated[at] += SQRT23 * dgamma
    stress[:, at] -= 2 * G * dgamma * n

    projection = projections(n_components)[1]
    reduction = 2 * G * dgamma / size[at]
    theta_bar = 2 * G / (2 * G + 2 / 3 * H) - reduction
    tangent[:, :, at] -= (
        2 * G * (reduction * projection[:, :, None] + theta_bar * n[:, None] * n[None])
    )
    return Response(stress, tangent, PlasticState(plastic_strain, accumulated), yielding)
