"""The field at the tip of a straight crack with free faces, in its own axes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from solver.typing import Array


class PlaneElasticity(NamedTuple):
    """Elastic constants in the plane.

    Attributes
    ----------
    shear : shear modulus G [MPa]
    kappa : 3 - 4 nu in plane strain, (3 - nu) / (1 + nu) in plane stress
    across : zz over xx + yy of stress: nu in plane strain, 0 in plane stress
    """

    shear: float
    kappa: float
    across: float

    @classmethod
    def of(cls, youngs_modulus: float, nu: float, *, plane_stress: bool) -> PlaneElasticity:
        """Return the constants of an isotropic material."""
        kappa = (3 - nu) / (1 + nu) if plane_stress else 3 - 4 * nu
        return cls(youngs_modulus / (2 + 2 * nu), kappa, 0.0 if plane_stress else nu)

    @property
    def modulus(self) -> float:
        """E / (1 - nu^2) in plane strain, E in plane stress: K^2 over it is the energy released."""
        return 8 * self.shear / (1 + self.kappa)


class NearTip(NamedTuple):
    """The field at n places for a stress intensity of one; x is ahead of the tip.

    Attributes
    ----------
    stress : (4, n) components xx, yy, zz, xy
    stress_x : (4, n) its derivative along x
    moved_x : (2, n) derivative of the displacement along x
    """

    stress: Array
    stress_x: Array
    moved_x: Array


def near_tip(r: Array, angle: Array, mode: int, elastic: PlaneElasticity) -> NearTip:
    """Return the field of mode I (0) or II (1) at polar coordinates from -pi to pi.

    With z = r exp(i angle) and f = K / (2 sqrt(2 pi z)), K = 1 or -i, complex potentials are
    phi' = f and psi' = conj(f)(z) - f - z f', where conj(f)(z) is -f of mode II:

    xx + yy = 4 Re f,  yy - xx + 2 i xy = 2 (conj(z) f' + psi')
    2 G d(u + i v)/dx = kappa f - conj(f) - z conj(f') - conj(psi')

    References
    ----------
    N.I. Muskhelishvili, Some Basic Problems of the Mathematical Theory of Elasticity, Noordhoff
    (1953); M.L. Williams, J. Appl. Mech. 24 (1957) 109-114.
    """
    shear, kappa, across = elastic
    sign, K = ((1.0, 1.0), (-1.0, -1j))[mode]
    z = r * np.exp(1j * angle)
    f = K / (2 * np.sqrt(2 * np.pi * r) * np.exp(0.5j * angle))
    f1, f2 = -f / (2 * z), 3 * f / (4 * z**2)
    psi, psi1 = sign * f - f - z * f1, sign * f1 - 2 * f1 - z * f2
    moved = (kappa * f - f.conj() - z * f1.conj() - psi.conj()) / (2 * shear)
    stress, stress_x = (
        _components(4 * s.real, 2 * d, across)
        for s, d in ((f, z.conj() * f1 + psi), (f1, f1 + z.conj() * f2 + psi1))
    )
    return NearTip(stress, stress_x, np.stack([moved.real, moved.imag]))


def _components(total: Array, apart: Array, across: float) -> Array:
    """Return xx, yy, zz, xy from xx + yy and yy - xx + 2 i xy."""
    xx, yy = (total - apart.real) / 2, (total + apart.real) / 2
    return np.stack([xx, yy, across * total, apart.imag / 2])
