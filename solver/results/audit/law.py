"""Whether stress and internal variables at the points of a body obey its law.

Backward Euler with linear elasticity, von Mises' yield condition and linear hardening is *stated*
here, not solved: with xi the deviator of stress less back stress, q = sqrt(3/2 xi:xi) and dp the
plastic strain accumulated in the increment,

- stress is Hooke's of strain less plastic strain
- q <= Re + Hi p, and equal where dp > 0
- plastic strain grew by 3/2 dp xi / q, dp >= 0

So the return mapping, its multiplier and its plane-stress projection are tested without being
called. `increment_error` then follows the same strain in smaller steps.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.materials import PlasticState
    from solver.materials.material import Material

    Array = NDArray[np.float64]

_TRIALS = 60
_NO_STRESS = 1e-9


def _deviator(tensor: Array) -> Array:
    out = tensor.copy()
    out[:3] -= tensor[:3].mean(axis=0)
    return out


def _norm(tensor: Array) -> Array:
    """Return the size of tensor components (4, ...) whose last one stands twice."""
    return np.asarray(np.sqrt((tensor[:3] ** 2).sum(axis=0) + 2 * tensor[3] ** 2))


def hooke(elastic: Array, material: Material, kinematics: str) -> Array:
    """Return the stress of an elastic strain, tensor components (4, ...) [MPa]."""
    E, nu = material.youngs_modulus, material.poisson_ratio
    strain = elastic.copy()
    if kinematics == "plane_stress":
        strain[2] = -nu / (1 - nu) * (elastic[0] + elastic[1])
    stress = E / (1 + nu) * strain
    stress[:3] += E * nu / ((1 + nu) * (1 - 2 * nu)) * strain[:3].sum(axis=0)
    return np.asarray(stress)


def _relative(stress: Array, plastic: Array, material: Material) -> Array:
    return _deviator(stress) - 2 / 3 * material.kinematic_modulus * plastic


def excess(stress: Array, plastic: Array, accumulated: Array, material: Material) -> Array:
    """Return the von Mises stress of stress less back stress, less the strength [MPa]."""
    q = np.sqrt(1.5) * _norm(_relative(stress, plastic, material))
    return np.asarray(q - material.yield_stress - material.isotropic_modulus * accumulated)


def law_error(
    strain: Array,
    stress: Array,
    before: tuple[Array, Array],
    after: tuple[Array, Array],
    material: Material,
    kinematics: str,
) -> float:
    """Return by how much an increment breaks its law [MPa].

    ``before`` and ``after`` are plastic strain (4, n) and accumulated strain (n,); all tensors have
    tensor components.
    """
    plastic, accumulated = after
    miss = stress - hooke(strain - plastic, material, kinematics)
    worst = float(np.abs(miss).max(initial=0.0))
    if material.elastic:
        return worst
    dp = accumulated - before[1]
    flowing = dp > 0
    f = excess(stress, plastic, accumulated, material)
    worst = max(worst, float(f.max(initial=0.0)), float(np.abs(f[flowing]).max(initial=0.0)))
    xi = _relative(stress, plastic, material)
    flow = 1.5 * dp * xi / np.maximum(np.sqrt(1.5) * _norm(xi), 1e-300)
    stray = np.abs(plastic - before[0] - flow).max(initial=0.0)
    G = material.youngs_modulus / (2 * (1 + material.poisson_ratio))
    reverse = max(0.0, -float(dp.min(initial=0.0)))
    return float(max(worst, 2 * G * stray, 2 * G * reverse))


def increment_error(
    strains: tuple[Array, Array],
    stress: Array,
    before: tuple[Array, Array],
    material: Material,
    kinematics: str,
    steps: int = 4,
) -> float:
    """Return the change of stress, over the yield stress, that smaller steps of strain make.

    Strain goes straight from the first to the second of ``strains`` (4, n); the state before is as
    in `law_error`.
    """
    plastic, accumulated = before
    first, last = strains
    found = stress
    for k in range(1, steps + 1):
        strain = first + (last - first) * k / steps
        found, plastic, accumulated = _step(strain, plastic, accumulated, material, kinematics)
    return float(np.abs(found - stress).max(initial=0.0)) / material.yield_stress


def _step(
    strain: Array, plastic: Array, accumulated: Array, material: Material, kinematics: str
) -> tuple[Array, Array, Array]:
    """Return stress, plastic strain and accumulated strain after one step of strain."""
    if kinematics != "plane_stress":
        return _return(strain, plastic, accumulated, material)
    # the stress out of plane rises with the strain out of plane: false position, the value of the
    # end that stays halved so that it moves too
    largest = np.abs(strain).max(axis=0) + np.abs(plastic).max(axis=0)
    ends = np.stack([-4 * largest, 4 * largest])
    values = np.stack([_return(_with_zz(strain, zz), plastic, accumulated, material)[0][2]
                       for zz in ends])  # fmt: skip
    for _ in range(_TRIALS):
        zz = (ends[0] * values[1] - ends[1] * values[0]) / (values[1] - values[0])
        out = _return(_with_zz(strain, zz), plastic, accumulated, material)
        high = (out[0][2] > 0).astype(int)
        at = np.arange(len(zz))
        ends[high, at], values[high, at] = zz, out[0][2]
        values[1 - high, at] /= 2
        if np.abs(out[0][2]).max() < _NO_STRESS * material.yield_stress:
            break
    return out


def _with_zz(strain: Array, zz: Array) -> Array:
    out = strain.copy()
    out[2] = zz
    return out


def _return(
    strain: Array, plastic: Array, accumulated: Array, material: Material
) -> tuple[Array, Array, Array]:
    """Return stress and internal variables where all of the strain is given."""
    Hi, Hk = material.isotropic_modulus, material.kinematic_modulus
    G = material.youngs_modulus / (2 * (1 + material.poisson_ratio))
    trial = hooke(strain - plastic, material, "plane_strain")
    xi = _relative(trial, plastic, material)
    q = np.sqrt(1.5) * _norm(xi)
    dp = np.maximum(q - material.yield_stress - Hi * accumulated, 0.0) / (3 * G + Hi + Hk)
    flow = 1.5 * dp * xi / np.maximum(q, 1e-300)
    return trial - 2 * G * flow, plastic + flow, accumulated + dp


def of_state(state: PlasticState) -> tuple[Array, Array]:
    """Return plastic strain, tensor components (4, n), and accumulated strain (n,)."""
    tensor = state.plastic_strain.copy()
    tensor[3] /= np.sqrt(2.0)
    return tensor, state.accumulated
