"""Exact solutions that the solver is measured against (N, mm, MPa)."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, sin, sqrt
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

Array = NDArray[np.float64]


def plane_strain_modulus(youngs_modulus: float, poisson_ratio: float) -> float:
    """Return E / (1 - nu^2)."""
    return youngs_modulus / (1 - poisson_ratio**2)


def carter_creepage(friction: float, half_width: float, radius: float, share: float) -> float:
    """Return mu a / R (1 - sqrt(1 - T / mu P)) of equal rollers, ``share`` T / mu P.

    F.W. Carter, Proc. R. Soc. A 112 (1926) 151; K.L. Johnson, Contact Mechanics (1985), 8.3.
    """
    return friction * half_width / radius * (1 - sqrt(1 - share))


@dataclass(frozen=True, slots=True, kw_only=True)
class HertzLine:
    """A parabolic cylinder on a half-plane, frictionless.

    ``force`` per unit thickness [N/mm], relative ``radius`` [mm], ``modulus`` E* with
    1/E* the sum of (1 - nu^2)/E of both bodies. K.L. Johnson, Contact Mechanics (1985), 4.43-45.
    """

    force: float
    radius: float
    modulus: float

    @property
    def half_width(self) -> float:
        """a [mm]."""
        return sqrt(4 * self.force * self.radius / (pi * self.modulus))

    @property
    def peak_pressure(self) -> float:
        """p0 [MPa]."""
        return 2 * self.force / (pi * self.half_width)

    def pressure(self, x: Array) -> Array:
        """Return the contact pressure at ``x`` from the centre."""
        return self.peak_pressure * np.sqrt(np.maximum(0.0, 1 - (x / self.half_width) ** 2))

    def stress(self, x: Array, depth: Array) -> Array:
        """Return the stresses xx, yy and xy (3, n) in the half-plane below, y upwards.

        E. McEwen, Phil. Mag. 40 (1949) 454-459, in Johnson's form (4.49).
        """
        a, z = self.half_width, depth
        level = a**2 - x**2 + z**2
        root = np.hypot(level, 2 * x * z)
        m2, n2 = (root + level) / 2, (root - level) / 2
        m, n = np.sqrt(np.maximum(m2, 0.0)), np.sign(x) * np.sqrt(np.maximum(n2, 0.0))
        share = (z**2 + n2) / (m2 + n2)
        xx, yy = m * (1 + share) - 2 * z, m * (1 - share)
        xy = -n * (m2 - z**2) / (m2 + n2)
        return -self.peak_pressure / a * np.stack([xx, yy, xy])


@dataclass(frozen=True, slots=True, kw_only=True)
class HertzEllipse:
    """A frictionless contact with semi-axes ``a`` along x and ``b`` along z [mm]; y is up.

    ``modulus`` is E* with 1/E* the sum of (1 - nu^2)/E of both bodies; pressure and stress do not
    depend on it. K.L. Johnson, Contact Mechanics (1985), 4.26: written for the longer axis along x.
    """

    a: float
    b: float
    peak_pressure: float
    modulus: float = np.nan

    @property
    def _terms(self) -> tuple[float, float, float]:
        """Approach, and curvatures 1/(2 R) along the longer and the shorter axis."""
        long, short = max(self.a, self.b), min(self.a, self.b)
        e2 = 1 - (short / long) ** 2
        K, E = ellipk(e2), ellipe(e2)
        level = self.peak_pressure * short / self.modulus
        if e2 == 0:
            return level * K, np.pi / 4 * level / long**2, np.pi / 4 * level / long**2
        over = level / (e2 * long**2)
        return level * K, over * (K - E), over * ((long / short) ** 2 * E - K)

    @property
    def approach(self) -> float:
        """Approach of the bodies [mm]."""
        return self._terms[0]

    @property
    def radii(self) -> tuple[float, float]:
        """Relative radii in the planes of x and z [mm]."""
        _, long, short = self._terms
        along, across = (long, short) if self.a >= self.b else (short, long)
        return 1 / (2 * along), 1 / (2 * across)

    @property
    def force(self) -> float:
        """Force [N]."""
        return 2 / 3 * np.pi * self.a * self.b * self.peak_pressure

    def pressure(self, x: Array, z: Array) -> Array:
        """Return the pressure at positions of the surface."""
        inside = 1 - (x / self.a) ** 2 - (z / self.b) ** 2
        return self.peak_pressure * np.sqrt(np.maximum(0.0, inside))

    def stress(self, x: Array, depth: Array, z: Array, poisson_ratio: float) -> Array:
        """Return the Mandel stress xx, yy, zz, xy, yz, zx (6, n) below the surface [MPa].

        Boussinesq's point force, integrated in polar coordinates in which the integrand is smooth.
        K.L. Johnson, Contact Mechanics (1985), (3.18); (3.18d) lacks a factor 2 of ``1 - z / rho``,
        which follows from (3.18a) and (3.18b) by a turn about the axis.
        """
        xi, weight = np.polynomial.legendre.leggauss(120)
        angle, turn = (xi + 1) * pi / 4, np.arange(240) * pi / 120
        r, level = np.sin(angle)[:, None], np.cos(angle)[:, None]
        share = pi / 4 * weight[:, None] * r * level**2 * (pi / 120) * np.ones(len(turn))
        force = (self.peak_pressure * self.a * self.b * share).ravel()
        at = np.stack([self.a * r * np.cos(turn), self.b * r * np.sin(turn)])
        return np.stack([
            _point_force(x0 - at[0].ravel(), d, z0 - at[1].ravel(), poisson_ratio) @ force
            for x0, d, z0 in zip(x, depth, z, strict=True)
        ], axis=1)  # fmt: skip


def _point_force(x: Array, depth: float, z: Array, nu: float) -> Array:
    """Return the Mandel stress (6, n) of unit forces at distances (x, z), pressing downwards."""
    s2 = x**2 + z**2
    rho = np.sqrt(s2 + depth**2)
    lateral, near = (1 - 2 * nu) / s2, 1 - depth / rho
    xx = lateral * (near * (x**2 - z**2) / s2 + depth * z**2 / rho**3) - 3 * depth * x**2 / rho**5
    zz = lateral * (near * (z**2 - x**2) / s2 + depth * x**2 / rho**3) - 3 * depth * z**2 / rho**5
    zx = x * z * (lateral * (2 * near / s2 - depth / rho**3) - 3 * depth / rho**5)
    down = 3 * depth**2 / rho**5
    root = sqrt(2.0)
    return np.stack([xx, -down * depth, zz, root * down * x, root * down * z, root * zx]) / (2 * pi)


def flat_punch_pressure(x: Array, half_width: float) -> Array:
    """Return pressure / mean pressure under a rigid frictionless flat punch (Johnson, 2.64)."""
    return 2 / (pi * np.sqrt(1 - (x / half_width) ** 2))


@dataclass(frozen=True, slots=True, kw_only=True)
class ThickSphere:
    """A thick-walled elastic, perfectly plastic sphere under internal pressure.

    Exact at any Poisson ratio. R. Hill, The Mathematical Theory of Plasticity (1950), V.2.
    ``front`` is the radius to which the wall yields.
    """

    inner: float
    outer: float
    yield_stress: float
    front: float

    @property
    def pressure(self) -> float:
        """Internal pressure that brings the plastic front to where it is [MPa]."""
        return -float(self.loaded(np.array(self.inner))[0])

    @property
    def reverse_yield_pressure(self) -> float:
        """Pressure above which releasing it yields the bore again [MPa]."""
        return 4 / 3 * self.yield_stress * (1 - (self.inner / self.outer) ** 3)

    def elastic(self, r: Array, pressure: float) -> tuple[Array, Array]:
        """Return radial and hoop stress of the elastic sphere."""
        share = pressure / ((self.outer / self.inner) ** 3 - 1)
        ratio = (self.outer / r) ** 3
        return share * (1 - ratio), share * (1 + ratio / 2)

    def loaded(self, r: Array) -> tuple[Array, Array]:
        """Return radial and hoop stress under pressure."""
        Y, b, c = self.yield_stress, self.outer, self.front
        plastic = -2 * Y * (np.log(c / r) + (1 - (c / b) ** 3) / 3)
        outside = 2 / 3 * Y * (c / b) ** 3
        radial = np.where(r < c, plastic, outside * (1 - (b / r) ** 3))
        return radial, np.where(r < c, plastic + Y, outside * (1 + (b / r) ** 3 / 2))

    def residual(self, r: Array) -> tuple[Array, Array]:
        """Return radial and hoop stress after release, which is elastic."""
        elastic = self.elastic(r, self.pressure)
        radial, hoop = (a - b for a, b in zip(self.loaded(r), elastic, strict=True))
        return radial, hoop


@dataclass(frozen=True, slots=True, kw_only=True)
class ThickCylinder:
    """A thick-walled perfectly plastic cylinder in plane strain, incompressible, von Mises.

    R. Hill, The Mathematical Theory of Plasticity (1950), V.3; exact for Poisson ratio 1/2 only.
    """

    inner: float
    outer: float
    yield_stress: float
    front: float

    @property
    def pressure(self) -> float:
        """Internal pressure that brings the plastic front to where it is [MPa]."""
        return -float(self.loaded(np.array(self.inner))[0])

    def elastic(self, r: Array, pressure: float) -> tuple[Array, Array]:
        """Return radial and hoop stress of the elastic cylinder (Lamé)."""
        share = pressure / ((self.outer / self.inner) ** 2 - 1)
        ratio = (self.outer / r) ** 2
        return share * (1 - ratio), share * (1 + ratio)

    def loaded(self, r: Array) -> tuple[Array, Array]:
        """Return radial and hoop stress under pressure."""
        k, b, c = self.yield_stress / sqrt(3), self.outer, self.front
        plastic = -k * (2 * np.log(c / r) + 1 - (c / b) ** 2)
        outside = k * (c / b) ** 2
        radial = np.where(r < c, plastic, outside * (1 - (b / r) ** 2))
        return radial, np.where(r < c, plastic + 2 * k, outside * (1 + (b / r) ** 2))

    def residual(self, r: Array) -> tuple[Array, Array]:
        """Return radial and hoop stress after release, which is elastic."""
        elastic = self.elastic(r, self.pressure)
        radial, hoop = (a - b for a, b in zip(self.loaded(r), elastic, strict=True))
        return radial, hoop


def prandtl_pressure(yield_stress: float) -> float:
    """Return the limit pressure of a strip on a half-plane, (2 + pi) k for von Mises."""
    return (2 + pi) * yield_stress / sqrt(3)


def dundurs_lee_power() -> float:
    """Return s of stress ~ r^(s-1) at the edge of a square punch, equal materials, no friction.

    J. Dundurs, M.S. Lee, J. Elasticity 2 (1972) 109-112.
    """
    return float(
        brentq(
            lambda s: cos(pi * s) * (sin(s * pi / 2) ** 2 - s**2) + sin(pi * s) ** 2 / 2, 0.55, 0.95
        )
    )


@dataclass(frozen=True, slots=True)
class _Wedge:
    """Williams' stress function ``r^(s+1) F(angle)`` of a wedge, four coefficients.

    Rows of coefficients give the angular parts of the stresses and of 2 G u.
    """

    s: float
    kappa: float

    @classmethod
    def plane_strain(cls, s: float, poisson_ratio: float) -> Self:
        """Return the wedge in plane strain."""
        return cls(s, 3 - 4 * poisson_ratio)

    def rows(self, angle: float) -> tuple[Array, Array, Array]:
        """Return rows of hoop stress, shear stress and hoop displacement at ``angle``."""
        s = self.s
        p, m = (s + 1) * angle, (s - 1) * angle
        F = np.array([cos(p), sin(p), cos(m), sin(m)])
        dF = np.array([-(s + 1) * sin(p), (s + 1) * cos(p), -(s - 1) * sin(m), (s - 1) * cos(m)])
        hoop = s * (s + 1) * F
        shear = -s * dF
        biharmonic = np.array([0.0, 0.0, sin(m), -cos(m)])  # conjugate of the harmonic part
        displacement = -dF - (self.kappa + 1) * biharmonic
        return hoop, shear, displacement


def corner_power(friction: float, poisson_ratio: float = 0.3) -> float:
    """Return s of stress ~ r^(s-1) at the edge of a square punch that slides outwards.

    Equal materials, plane strain, slip of the punch away from its centre everywhere. M.
    Comninou, J. Appl. Math. Phys. (ZAMP) 27 (1976) 493-499; here the zero of the determinant of
    Williams' eigenproblem. The edge is the origin, the contact along angle pi, the half-plane
    below (angle -pi..0, its free surface at 0) and the punch above the contact (pi/2..pi, its
    free side at pi/2).
    """

    def determinant(s: float) -> float:
        wedge = _Wedge.plane_strain(s, poisson_ratio)
        A = np.zeros((8, 8))
        for row, angle, half in ((0, 0.0, slice(0, 4)), (2, pi / 2, slice(4, 8))):
            A[row, half], A[row + 1, half], _ = wedge.rows(angle)
        below, above = wedge.rows(-pi), wedge.rows(pi)
        for row in range(3):
            A[4 + row, :4], A[4 + row, 4:] = below[row], -above[row]
        # at the face sigma_rt = sigma_xy, which draws the half-plane along with the punch, to +x:
        # sigma_xy = friction * pressure = -friction * sigma_tt
        A[7, :4] = below[1] + friction * below[0]
        return float(np.linalg.det(A))

    return float(brentq(determinant, 0.52, 0.95))


def log_slope(x: Array, y: Array) -> float:
    """Return the least-squares slope of log y over log x."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])
