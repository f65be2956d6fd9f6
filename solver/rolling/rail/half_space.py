"""Displacements on the surface of an elastic half-space from tractions on its surface.

With r = (X, Z) from a force f to a point of the surface, G shear modulus, nu Poisson's ratio, and y
the outward normal, the displacements are

    2 pi G u_x = ((1 - nu) / r + nu X^2 / r^3) f_x + nu X Z / r^3 f_z + (1/2 - nu) X / r^2 f_y
    2 pi G u_y = (1 - nu) / r f_y - (1/2 - nu) (X f_x + Z f_z) / r^2

and u_z as u_x. Tractions are uniform along x over the distance of two stations, and linear across
between vertices. Their integrals over rectangles have closed forms; each is a double difference,
over the corners, of a function F(X, Z) whose mixed derivative is the kernel. The influence between
two stations depends on their distance alone.

K.L. Johnson, Contact Mechanics (1985), sections 3.2 (J. Boussinesq) and 3.6 (V. Cerruti); uniform
pressure on a rectangle: section 3.3 (A.E.H. Love, 1929).
"""

from __future__ import annotations

import numpy as np

from solver.materials import Elasticity
from solver.rolling.rail.patch_grid import Hats
from solver.typing import Array


def half_space(s: Array, spacing: float, stations: int, elasticity: Elasticity) -> Array:
    """Return the displacements of the surface of a half-space under unit tractions.

    Parameters
    ----------
    s : (m,) positions of the vertices across, increasing [mm]
    spacing : distance h of two stations [mm]
    stations : number n of stations
    elasticity : elastic constants; with an infinite modulus nothing moves

    Returns
    -------
    (2n, m, 3, m, 3) [mm/MPa]. Entry ``[d, i, a, j, b]`` is the mean under hat i of the
    displacement along axis a (x, y outward, z), d stations downstream of a traction along axis b
    which is uniform over h along x, and hat j across. Negative d are at the end, as in an FFT.
    """
    m, nu = len(s), elasticity.poisson_ratio
    if np.isinf(elasticity.youngs_modulus):
        return np.zeros((2 * stations, m, 3, m, 3))
    hats = Hats(s)
    edges = spacing * np.arange(stations + 0.5, -stations, -1.0)
    point, xx, zz, xz, x, z = (
        hats.mean @ _under_hats(s, hats.points, *pair)
        for pair in _integrals(edges[:, None, None], hats.points[:, None] - s)
    )
    out = np.empty((2 * stations, m, 3, m, 3))
    out[:, :, 0, :, 0] = (1 - nu) * point + nu * xx
    out[:, :, 2, :, 2] = (1 - nu) * point + nu * zz
    out[:, :, 0, :, 2] = out[:, :, 2, :, 0] = nu * xz
    out[:, :, 1, :, 1] = (1 - nu) * point
    for axis, integral in ((0, x), (2, z)):
        out[:, :, axis, :, 1] = (0.5 - nu) * integral
        out[:, :, 1, :, axis] = (nu - 0.5) * integral
    out /= 2 * np.pi * elasticity.shear_modulus
    return np.fft.ifftshift(out, axes=0)


def _under_hats(s: Array, points: Array, uniform: Array, linear: Array) -> Array:
    """Return integrals (n_x - 1, n_points, m) of a kernel over rectangles, times hats.

    ``uniform`` and ``linear`` (n_x, n_points, m) are values at the corners for the kernel and for
    the kernel times Z.
    """
    constant, first = (np.diff(np.diff(F, axis=0), axis=2) for F in (uniform, linear))
    rising = ((points[:, None] - s[:-1]) * constant - first) / np.diff(s)
    out = np.zeros_like(uniform[1:])
    out[..., 1:] = rising
    out[..., :-1] += constant - rising
    return out


def _integrals(X: Array, Z: Array) -> tuple[tuple[Array, Array], ...]:
    """Return F(X, Z) of six kernels, each for the kernel and for the kernel times Z.

    Kernels are 1/r, X^2/r^3, Z^2/r^3, X Z/r^3, X/r^2, Z/r^2.
    """
    X, Z = np.broadcast_arrays(X, Z)
    r = np.hypot(X, Z)
    log_x, log_z = np.arcsinh(_over(X, np.abs(Z))), np.arcsinh(_over(Z, np.abs(X)))
    angle_x, angle_z = np.arctan(_over(X, Z)), np.arctan(_over(Z, X))
    log_r = np.log(r, out=np.zeros_like(r), where=r > 0)
    first, second, product = Z**2 * log_x, X**2 * log_z, X * r
    return (
        (X * log_z + Z * log_x, (product + first) / 2),
        (Z * log_x, (first - product) / 2),
        (X * log_z, product),
        (-r, (second - Z * r) / 2),
        (Z * log_r + X * angle_z, r**2 * log_r / 2),
        (X * log_r + Z * angle_x, (X * Z - X**2 * angle_z + Z**2 * angle_x) / 2),
    )


def _over(a: Array, b: Array) -> Array:
    """Return a / b, and 0 where b = 0; the result is later multiplied by b."""
    return np.divide(a, b, out=np.zeros_like(a), where=b != 0)
