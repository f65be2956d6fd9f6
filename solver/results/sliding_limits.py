"""Sliding Hertz contact: closed-form stress, and limits of elastic shakedown.

K.L. Johnson, Contact Mechanics (1985), sections 4.6, 7.1 and 9.2.
"""

from __future__ import annotations

import numpy as np
import scipy  # loads scipy.optimize at its first use: few pictures need it

from solver.typing import Array

_X = np.linspace(-4.0, 4.0, 1601)


def sliding_contact(x: Array, depth: float, friction: float) -> tuple[Array, Array, Array]:
    """Return sigma_x, sigma_y and tau (n,) over p0 under a Hertz pressure that slides along +x.

    ``x`` (n,) and ``depth`` are in half-widths; tension is positive. The shear traction on the
    half-space acts along +x and is ``friction`` times the pressure; y and depth point down.
    E. McEwen, Phil. Mag. 40 (1949) 454-459; Johnson, eqs. (4.49), (7.8).
    """
    s = 1 - x**2 + depth**2
    root = np.sqrt(s**2 + 4 * x**2 * depth**2)
    m = np.sqrt((root + s) / 2)
    n = np.sign(x) * np.sqrt(np.maximum(root - s, 0.0) / 2)
    both = np.maximum(m**2 + n**2, np.finfo(float).tiny)
    along = 2 * depth - m * (1 + (depth**2 + n**2) / both)
    across = -m * (1 - (depth**2 + n**2) / both)
    shear = -n * (m**2 - depth**2) / both
    dragged = n * (2 + (m**2 - depth**2) / both) - 2 * x
    return along + friction * dragged, across + friction * shear, shear + friction * along


def largest_shear(friction: float) -> tuple[float, float]:
    """Return the largest shear over p0 below a sliding Hertz contact, its depth in half-widths."""

    def least(depth: float) -> float:
        return -float(np.abs(sliding_contact(_X, depth, friction)[2]).max())

    found = scipy.optimize.minimize_scalar(least, bounds=(0.05, 1.5), method="bounded")
    return -float(found.fun), float(found.x)


def johnson_limit(friction: float) -> float:
    """Return the largest p0 / k at which a sliding Hertz line contact shakes down elastically.

    The largest shear sets the limit, below the surface, or at the surface if friction exceeds about
    0.37: residual stress can remove the difference of normal stresses there, but not the shear.
    Johnson, section 9.2 (maximum shear stress criterion).
    """
    return 1 / max(largest_shear(friction)[0], friction)


def melan_limit(friction: float, poisson_ratio: float) -> float:
    """Return `johnson_limit` for von Mises' criterion in plane strain.

    At each depth one residual stress (sigma_x, sigma_z) must bring all stresses of the pass inside
    the yield surface (Melan). Below the surface both criteria agree. At the surface von Mises'
    limit is lower because of the out-of-plane stress, which depends on the other two stresses.
    """

    def least(depth: float) -> float:
        along, across, shear = sliding_contact(_X, depth, friction)
        out = poisson_ratio * (along + across)

        def largest(residual: Array) -> float:
            a, b, c = along + residual[0], across, out + residual[1]
            return float((((a - b) ** 2 + (b - c) ** 2 + (c - a) ** 2) / 6 + shear**2).max())

        found = (
            scipy.optimize.minimize(
                largest, start, method="Nelder-Mead",
                options={"xatol": 1e-6, "fatol": 1e-9, "maxiter": 4000},
            )
            for start in ((0.1, 0.1), (0.5, 0.2))
        )  # fmt: skip
        return min(float(each.fun) for each in found)

    return float(1 / np.sqrt(max(least(0.0), least(largest_shear(friction)[1]))))
