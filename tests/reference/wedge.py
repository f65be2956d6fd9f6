"""Power of the stress singularity at the corner of a punch, by the fields of two elastic wedges.

The corner is the origin. The half-plane lies below the x-axis; the punch lies left of the corner,
above the x-axis, between the contact (polar angle pi) and its own free side (polar angle
pi - ``angle``). Near the corner stress ~ r^(p-1), displacement ~ r^p.
"""

from __future__ import annotations

from math import pi
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

Array = NDArray[np.float64]
Slip = Literal["outward", "inward", "stuck"]

SEARCHED = np.linspace(0.01, 0.99999, 200)


def wedge_fields(s: float, theta: float, compliances: tuple[float, float]) -> Array:
    """Return hoop stress, shear stress, radial and hoop displacement at r = 1, polar angle theta.

    Four rows; the columns are the real and imaginary parts of a and b in the potentials a z^s and
    b z^s. ``compliances`` are kappa/mu and 1/mu, mu the shear modulus, kappa = 3 - 4 nu in plane
    strain.

    References
    ----------
    N.I. Muskhelishvili, Some Basic Problems of the Mathematical Theory of Elasticity (1953), 32
    and 39: sigma_xx + sigma_yy = 4 Re phi', sigma_yy - sigma_xx + 2 i sigma_xy =
    2 (conj(z) phi'' + psi'), 2 mu (u + i v) = kappa phi - z conj(phi') - conj(psi).
    """
    kappa, one = compliances
    a, b = np.array([1, 1j, 0, 0]), np.array([0, 0, 1, 1j])
    inner, outer = np.exp(1j * (s - 1) * theta), np.exp(1j * (s + 1) * theta)
    stress = 2 * (s * a * inner).real + s * (s - 1) * a * inner + s * b * outer
    shift = kappa * a * inner - one * (s * (a * inner).conj() + (b * outer).conj())
    return np.array([stress.real, stress.imag, shift.real / 2, shift.imag / 2])


def dundurs(punch: tuple[float, float], half_plane: tuple[float, float]) -> tuple[float, float]:
    """Return alpha and beta of two materials in plane strain, each E [MPa] and nu.

    alpha is 1 where the punch is rigid. J. Dundurs, J. Appl. Mech. 36 (1969) 650-652.
    """
    (A_1, B_1), (A_2, B_2) = (
        ((4 - 4 * nu) * 2 * (1 + nu) / E, (2 - 4 * nu) * 2 * (1 + nu) / E)
        for E, nu in (punch, half_plane)
    )
    return (A_2 - A_1) / (A_2 + A_1), (B_2 - B_1) / (A_2 + A_1)


def corner_conditions(
    s: float, friction: float, slip: Slip, angle: float, alpha: float, beta: float
) -> Array:
    """Return the homogeneous conditions (8, 8) on the potentials of punch and half-plane.

    Free faces; equal tractions and equal normal displacement at the contact; there the law of
    Coulomb, or equal tangential displacement. Only alpha and beta of the materials count: any
    compliances that have them will do.
    """
    punch = ((1 - alpha - beta) / 2, (1 - alpha + beta) / 2)
    half_plane = ((1 + alpha + beta) / 2, (1 + alpha - beta) / 2)
    M = np.zeros((8, 8))
    M[0:2, :4] = wedge_fields(s, pi - angle, punch)[:2]
    M[2:4, 4:] = wedge_fields(s, 0.0, half_plane)[:2]
    above, below = wedge_fields(s, pi, punch), wedge_fields(s, -pi, half_plane)
    for row, field in ((4, 0), (5, 1), (6, 3)):
        M[row, :4], M[row, 4:] = above[field], -below[field]
    if slip == "stuck":
        M[7, :4], M[7, 4:] = above[2], -below[2]
    else:
        drag = friction if slip == "outward" else -friction
        M[7, 4:] = below[1] + drag * below[0]
    return M


def singular_power(
    friction: float = 0.0,
    *,
    slip: Slip = "outward",
    angle: float = pi / 2,
    alpha: float = 0.0,
    beta: float = 0.0,
) -> float:
    """Return p of stress ~ r^(p-1) at the corner; 1 where stress stays bounded.

    Parameters
    ----------
    friction
        Coulomb's coefficient, not negative. It does not count where the corner is stuck.
    slip
        ``outward``: the punch's material moves over the half-plane towards the corner and
        beyond, away from the middle of the contact; the shear traction on the half-plane points
        outward. This is what happens while an elastic punch is pressed down. ``inward``: the
        opposite. ``stuck``: no slip. Between equal materials outward slip lowers p as friction
        grows, and inward slip raises it. Under a rigid punch it is the other way round.
    angle
        Angle of the punch's material at the corner; pi/2 for a square punch.
    alpha, beta
        Dundurs' parameters, ``alpha`` 1 for a rigid punch; 0 and 0 for equal materials.

    Raises
    ------
    ValueError
        A stuck corner of different materials may have complex powers only. With much friction
        (above 2.05 between equal materials) outward slip has no field of finite energy.

    References
    ----------
    J. Dundurs, M.S. Lee, J. Elasticity 2 (1972) 109-112, without friction; M. Comninou, J. Appl.
    Math. Phys. (ZAMP) 27 (1976) 493-499, with friction; M.L. Williams, J. Appl. Mech. 19 (1952)
    526-528, the stuck corner of equal materials, a notch.
    """

    def determinant(s: float, friction: float = friction) -> float:
        # s = 1 is always a root: a rotation of both bodies
        conditions = corner_conditions(s, friction, slip, angle, alpha, beta)
        return float(np.linalg.det(conditions)) / (1 - s)

    values = [determinant(s) for s in SEARCHED]
    signs = np.sign(values)
    changes = np.flatnonzero(signs[1:] != signs[:-1])
    if len(changes) > 0:
        low, high = SEARCHED[changes[0]], SEARCHED[changes[0] + 1]
        return float(brentq(determinant, low, high, xtol=1e-13))
    if slip == "stuck" and (alpha, beta) != (0.0, 0.0):
        raise ValueError(f"no real power at alpha {alpha}, beta {beta}: it is complex")
    if determinant(SEARCHED[0], 0.0) * values[0] < 0:  # a root has left through s = 0
        raise ValueError(f"friction {friction} is too high: no field has finite energy")
    return 1.0


def sticking_friction(*, angle: float = pi / 2) -> float:
    """Return the friction from which the corner of equal materials sticks under a growing load.

    It is the share of shear stress in the pressure at the contact in the leading field of the
    stuck corner. At this friction the power of outward slip is the power of the stuck corner, and
    above it outward slip does not occur.
    """
    p = singular_power(slip="stuck", angle=angle)
    conditions = corner_conditions(p, 0.0, "stuck", angle, 0.0, 0.0)
    field = np.linalg.svd(conditions)[2][-1]
    hoop, shear, *_ = wedge_fields(p, -pi, (0.5, 0.5)) @ field[4:]
    return float(-shear / hoop)
