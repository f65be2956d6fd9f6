"""Von Mises plasticity with mixed linear hardening: closed-form radial return."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.materials.state import PlasticState, Response

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.materials.material import Material

SQRT23 = float(np.sqrt(2.0 / 3.0))


def _identity(n_components: int) -> NDArray[np.float64]:
    one = np.zeros(n_components)
    one[:3] = 1.0
    return one


def elastic_stiffness(material: Material, n_components: int = 4) -> NDArray[np.float64]:
    """Return the elastic stiffness (n_components, n_components) on Mandel strain [MPa]."""
    one = _identity(n_components)
    deviator = np.eye(n_components) - np.outer(one, one) / 3.0
    return material.bulk_modulus * np.outer(one, one) + 2 * material.shear_modulus * deviator


def relative_stress(
    stress: NDArray[np.float64], state: PlasticState, material: Material
) -> NDArray[np.float64]:
    """Return the deviator of stress less back stress (n_components, n_points) [MPa]."""
    one = _identity(len(stress))
    deviator = stress - one[:, None] * stress[:3].mean(axis=0)
    return deviator - 2 / 3 * material.kinematic_modulus * state.plastic_strain


def yield_function(
    stress: NDArray[np.float64], state: PlasticState, material: Material
) -> NDArray[np.float64]:
    """Return the von Mises stress of stress less back stress, minus the yield stress [MPa]."""
    radius = material.yield_stress + material.isotropic_modulus * state.accumulated
    return np.linalg.norm(relative_stress(stress, state, material), axis=0) / SQRT23 - radius


def radial_return(strain: NDArray[np.float64], state: PlasticState, material: Material) -> Response:
    """Return stress and consistent tangent where all strain components are given.

    Plane strain, axisymmetry (4 components) and three dimensions (6 components).

    1. trial: elastic strain with the plastic strain frozen, relative deviator xi
    2. f = |xi| - sqrt(2/3) (yield stress + Hi p); elastic where f <= 0
    3. dgamma = f / (2G + 2/3 (Hi + Hk)), n = xi / |xi|
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
    G, Hi, Hk = material.shear_modulus, material.isotropic_modulus, material.kinematic_modulus
    C = elastic_stiffness(material, n_components)
    stress = C @ (strain - state.plastic_strain)
    tangent = np.repeat(C[:, :, None], n_points, axis=2)
    yielding = np.zeros(n_points, dtype=bool)
    if material.elastic:
        return Response(stress, tangent, state, yielding)

    xi = relative_stress(stress, state, material)
    size = np.linalg.norm(xi, axis=0)
    f = size - SQRT23 * (material.yield_stress + Hi * state.accumulated)
    yielding = f > 0
    if not yielding.any():
        return Response(stress, tangent, state, yielding)

    at = np.flatnonzero(yielding)
    n = xi[:, at] / size[at]
    dgamma = f[at] / (2 * G + 2 / 3 * (Hi + Hk))
    plastic_strain = state.plastic_strain.copy()
    accumulated = state.accumulated.copy()
    plastic_strain[:, at] += dgamma * n
    accumulated[at] += SQRT23 * dgamma
    stress[:, at] -= 2 * G * dgamma * n

    one = _identity(n_components)
    deviator = np.eye(n_components) - np.outer(one, one) / 3.0
    reduction = 2 * G * dgamma / size[at]
    theta_bar = 2 * G / (2 * G + 2 / 3 * (Hi + Hk)) - reduction
    tangent[:, :, at] -= (
        2 * G * (reduction * deviator[:, :, None] + theta_bar * n[:, None] * n[None])
    )
    return Response(stress, tangent, PlasticState(plastic_strain, accumulated), yielding)
