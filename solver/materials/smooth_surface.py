"""Smooth user-defined yield surfaces, each given by one function of the principal stresses.

The yield surface of an isotropic material that does not depend on mean stress is a cylinder along
the hydrostatic axis. Its section is symmetric about the axes of the principal stresses, so that one
sixth defines it: the equivalent stress of a unit deviator as a function of its Lode angle.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from solver.errors import ModelError
from solver.materials.curves import Curve
from solver.materials.scalar import falling_root
from solver.materials.yield_surface import IsotropicSurface, Returned, Tension, grown
from solver.tensors import dyad, principal
from solver.typing import Array

SIXTH = math.pi / 3
"""Lode angle of uniaxial compression; it is 0 in tension and half of this in pure shear."""
_MARGIN = 0.25
"""Angle by which the bracket extends beyond the sixth, so that no root is at an end of it."""
_IMAGINARY = 1e-30
_STEP = 3e-6
"""Step of the central difference of the exact slopes: rounding and truncation are 1e-10."""
_NOISE = 10.0
"""Rounding error of a slope over that of one operation."""
_STATIONARY = 1e4
"""Tolerance of the angle in `power` over rounding; a loose one suffices, since power is stationary
in this angle."""
_FLAT = 1e-12
"""Curvature assigned to a flat face."""


class Profile(NamedTuple):
    """Equivalent stress of a unit deviator over its Lode angle, and its derivatives, each (n,).

    ``size`` f, ``slope`` f' and ``bend`` f''. The section is convex if f + f'' is not negative.
    """

    size: Array
    slope: Array
    bend: Array


def polar(values: Array) -> tuple[Array, Array]:
    """Return size |s| (n,) and Lode angle (n,) of the deviators of principal stresses (3, n).

    If a stress is not finite, neither is the size, and the angle is 0.
    """
    s1, s2, s3 = values
    x, y = (2 * s1 - s2 - s3) / math.sqrt(6), (s2 - s3) / math.sqrt(2)
    size = np.hypot(x, y)
    return size, np.where(np.isfinite(size), np.arctan2(y, x), 0.0)


def base(angle: Array) -> tuple[Array, Array]:
    """Return the unit deviators (3, n) of Lode angles (n,), and their derivatives (3, n)."""
    turned = angle - 2 * SIXTH * np.arange(3)[:, None]
    return math.sqrt(2 / 3) * np.cos(turned), -math.sqrt(2 / 3) * np.sin(turned)


def falling_angle(
    excess: Callable[[Array], tuple[Array, Array]], start: Array, scale: Array
) -> Array:
    """Return the Lode angles (n,) at the zeros of falling functions of magnitude ``scale``."""
    low, high = np.full_like(start, -_MARGIN), np.full_like(start, SIXTH + _MARGIN)
    return falling_root(excess, low, high, _NOISE * scale, start)


def _folded(angle: Array) -> tuple[Array, Array]:
    """Return angles (n,) mirrored into the sixth, and the sign (n,) of slopes there."""
    inside = np.abs(angle)
    beyond = inside > SIXTH
    sign = np.where((angle < 0) ^ beyond, -1.0, 1.0)
    return np.where(beyond, 2 * SIXTH - inside, inside), sign


def _stresses(angle: Any) -> Any:
    """Return the unit deviators (3, n); rounding does not change the order of their values."""
    first, second = math.sqrt(2) * np.sin(SIXTH - angle), math.sqrt(2) * np.sin(angle)
    s3 = -(first + 2 * second) / 3
    return np.stack([s3 + second + first, s3 + second, s3])


class SmoothSurface(IsotropicSurface):
    """A smooth convex yield surface; subclasses are frozen dataclasses of their parameters."""

    __slots__ = ()

    @abstractmethod
    def tension(self, s: Array) -> Array:
        """Return the equivalent tensile stress (n,) of principal stresses [MPa].

        It must be convex, of degree one (twice the stresses, twice the result) and independent of
        the mean stress, without a corner where two stresses are equal. Its slope is computed with
        complex numbers, so it must not use ``abs``; ordered stresses do not need it.

        Parameters
        ----------
        s : (3, n) principal stresses s[0] >= s[1] >= s[2], real or complex [MPa]
        """

    def profile(self, angle: Array) -> Profile:
        """Return size, slope and bend at Lode angles (n,) from 0, tension, to pi / 3, compression.

        The slope is the imaginary part of `tension` after a step into the complex plane, which is
        exact; the bend is the central difference of slopes. Override it for speed.
        """
        inside, sign = _folded(np.stack([angle - _STEP, angle, angle + _STEP]))
        found = self.tension(_stresses(inside.ravel() + 1j * _IMAGINARY)).reshape(inside.shape)
        below, slope, above = sign * found.imag / _IMAGINARY
        return Profile(found.real[1], slope, (above - below) / (2 * _STEP))

    # -- derived quantities --------------------------------------------------------------------

    @property
    def over_mises(self) -> float:
        """See `IsotropicSurface`.

        A convex section through the points of tension and compression lies outside the hexagon
        with these corners.
        """
        tension, compression = self._size(np.array([0.0, SIXTH]))
        return 2 / math.sqrt(3) * max(1.0, compression / tension)

    def shear(self, tension: Tension) -> Tension:
        """Return the pure shear stress that is equivalent to a tensile stress [MPa]."""
        ratio = math.sqrt(2) * float(self._size(np.array([SIXTH / 2]))[0])
        return tension / ratio

    def of_principal(self, values: Array) -> Array:
        """Return the equivalent stress (n,) of principal stresses [MPa]."""
        size, angle = polar(values)
        return size * self._size(angle)

    def normal(self, stress: Array) -> Array:
        """Return the derivative (n_components, n_points) of `equivalent`; zero without deviator."""
        values, directions = principal(stress)
        size, angle = polar(values)
        flow = np.sign(size) * self.gradient(angle)
        each = (flow[i] * dyad(directions, i, i, len(stress)) for i in range(3))
        return np.asarray(sum(each))

    def power(self, strain: Array) -> Array:
        """Return the largest work (n_points,) on the deviator of Mandel strain; see `YieldSurface`.

        The stress that does it has the angle at which the normal of the section is along strain.
        """
        size, angle = polar(principal(strain)[0])

        def aside(x: Array) -> tuple[Array, Array]:
            f, slope, bend = self.at(x)
            along, across = np.cos(angle - x), np.sin(angle - x)
            return across * f - along * slope, -along * np.maximum(f + bend, _FLAT)

        x = falling_angle(aside, angle, np.full_like(angle, _STATIONARY))
        return np.asarray(size * np.cos(angle - x) / self.at(x).size)

    def at(self, angle: Array) -> Profile:
        """Return the profile at any angles (n,): mirrored about tension and about compression."""
        inside, sign = _folded(angle)
        size, slope, bend = self.profile(inside)
        bend = np.maximum(bend, -size)  # rounding must not make a flat face concave
        return Profile(size, sign * slope, bend)

    def gradient(self, angle: Array) -> Array:
        """Return the derivative (3, n) of the equivalent stress by the principal stresses."""
        size, slope, _ = self.at(angle)
        out, along = base(angle)
        return size * out + slope * along

    def _size(self, angle: Array) -> Array:
        return self.tension(_stresses(angle))

    # -- return mapping ---------------------------------------------------------------------

    def returned(self, trial: Array, before: Array, G: float, curve: Curve) -> Returned:
        """Return to the surface along its normal.

        A deviator has the size r and the Lode angle x; on the surface f(x) r = R(p). The normal has
        the components f along the deviator and f' across it. If the trial stress has size t and
        angle y:

        1. along: t cos(y - x) = r + 2 G dp f, so that 2 G f^2 dp + R(p + dp) = t cos(y - x) f
        2. across: t sin(y - x) = 2 G dp f', solved for x with dp(x) from step 1. There is one root,
           since a convex surface has only one point nearest to the trial stress: the left side is
           larger below the root and smaller above it
        3. derivative: (I + 2 G dp H)^-1 less its part along the normal, where H = (f + f'') / r is
           the curvature across
        """
        size, angle = polar(trial)
        first = curve.flow_stress(before)

        def solved(x: Array) -> tuple[Array, Array, Array, Array, Array, Array]:
            """Return f, f', f + f'', r, dp and the slope of R, each (n,), at angles (n,)."""
            f, slope, bend = self.at(x)
            along = np.maximum(size * np.cos(angle - x) * f, first)
            growth, hardening = grown(2 * G * f**2, along, before, curve)
            return f, slope, f + bend, curve.flow_stress(before + growth) / f, growth, hardening

        def across(x: Array) -> tuple[Array, Array]:
            f, slope, round_, r, growth, hardening = solved(x)
            excess = size * np.sin(angle - x) - 2 * G * growth * slope
            resisted = 2 * G * slope**2 / (2 * G * f**2 + hardening)
            return excess, -(r * (1 + resisted) + 2 * G * growth * round_)  # exact at the root

        x = falling_angle(across, angle, size)
        f, slope, round_, r, growth, hardening = solved(x)
        out, aside = base(x)
        shrunk = 1 / (1 + 2 * G * growth * round_ / r)
        flow = growth * (f * out + slope * aside)
        m = f * out + shrunk * slope * aside
        stiff = 2 * G * (f**2 + shrunk * slope**2) + hardening
        derivative = out[:, None] * out[None] + shrunk * aside[:, None] * aside[None] + 1 / 3
        return Returned(flow, growth, derivative - 2 * G / stiff * m[:, None] * m[None])

    # -- check ---------------------------------------------------------------------------------

    def check(self) -> None:
        """Raise `ModelError` unless `tension` gives a smooth convex surface, as it must."""
        angle, step = np.linspace(0.0, SIXTH, 121), 1e-5
        s, one = _stresses(angle), np.array([[1.0], [0.0], [0.0]])
        with np.errstate(all="ignore"):
            size, pull = self.tension(s), self.tension(one)
            larger, moved = self.tension(8.0 * s), self.tension(s + 0.5)
            f, slope, bend = self.profile(angle)
            below, above = self.at(angle - step), self.at(angle + step)
            steep = np.abs(slope) + np.abs(bend) + f
            conditions = {
                "equal to the stress in tension": (pull - 1.0, 1e-9),
                "proportional to the stress": (larger / size - 8.0, 1e-6),
                "independent of the mean stress": (moved / size - 1.0, 1e-9),
                "without a corner where two stresses are the same": (slope[[0, -1]], 1e-6),
                "equal to that of its profile": (f / size - 1.0, 1e-9),
                "computed with complex numbers, without abs": (
                    ((above.size - below.size) / (2 * step) - slope) / steep, 1e-4),
                "convex": (np.minimum(f + bend, 0.0) / steep, 1e-6),
            }  # fmt: skip
        for name, (off, limit) in conditions.items():
            if not np.abs(off).max() <= limit:
                raise ModelError("surface", self, f"must have a tension that is {name}")
