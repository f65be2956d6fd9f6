"""Indices of rolling contact fatigue, from the numbers of a contact."""

from __future__ import annotations

import numpy as np

from solver.typing import Array


def surface_index(utilised: Array, peak_pressure: Array, shear_strength: float) -> Array:
    """Return FI_surf = f - k / p0: above zero the surface ratchets.

    Parameters
    ----------
    utilised : utilised friction f, the tangential over the normal force
    peak_pressure : p0 [MPa]
    shear_strength : yield stress in shear k, hardened [MPa]

    References
    ----------
    A. Ekberg, E. Kabo, H. Andersson, Fatigue Fract. Eng. Mater. Struct. 25 (2002) 899-909.
    """
    return np.asarray(utilised - shear_strength / np.asarray(peak_pressure))


def subsurface_index(
    utilised: Array, peak_pressure: Array, residual: float = 0.0, sensitivity: float = 1 / 3
) -> Array:
    """Return FI_sub = p0 / 6 (1 + f^2) + c sigma_h [MPa]; a crack begins above the limit in shear.

    With the axes a, b of the ellipse p0 / 6 is F / (4 pi a b). The sensitivity c is that to the
    hydrostatic stress sigma_h that remains below the surface.

    References
    ----------
    A. Ekberg, E. Kabo, H. Andersson, Fatigue Fract. Eng. Mater. Struct. 25 (2002) 899-909.
    """
    shear = np.asarray(peak_pressure) / 6 * (1 + np.square(utilised))
    return np.asarray(shear + sensitivity * residual)


DAMAGE = ((15.0, 0.0), (65.0, 1e-5), (175.0, 0.0))
"""T gamma [N] and damage of a pass, of rail steel R260: initiation, worst, balance with wear."""


def t_gamma(force: tuple[Array, Array], creepage: tuple[Array, Array]) -> Array:
    """Return T gamma [N], the energy that the contact dissipates per length.

    Parameters
    ----------
    force, creepage : along and across the track [N, 1]
    """
    return np.abs(force[0] * creepage[0]) + np.abs(force[1] * creepage[1])


def crack_damage(energy: Array, points: tuple[tuple[float, float], ...] = DAMAGE) -> Array:
    """Return the damage of a pass from T gamma; at one a crack begins, below zero wear removes it.

    Parameters
    ----------
    energy : T gamma [N]
    points : corners of the damage function; it goes on as straight as at its end

    References
    ----------
    M. Burstow, Whole life rail model application and development, AEATR-ES-2003-832 (2003).
    """
    x, y = np.array(points).T
    beyond = np.maximum(np.asarray(energy) - x[-1], 0.0) * (y[-1] - y[-2]) / (x[-1] - x[-2])
    return np.asarray(np.interp(energy, x, y) + beyond)
