"""Yield surfaces that the package does not have."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from solver.materials import Profile, SmoothSurface


@dataclass(frozen=True)
class Hosford(SmoothSurface):
    """The mean of the differences of principal stresses, each to the power a.

    W.F. Hosford, J. Appl. Mech. 39 (1972) 607-609. With a = 2 and a = 4 it is von Mises', with
    a = 1 or without bound Tresca's.
    """

    a: float

    @property
    def over_shear(self) -> float:
        """Tensile stress over shear stress: the differences in shear are k, k and 2 k."""
        return ((2**self.a + 2) / 2) ** (1 / self.a)

    def tension(self, s: Any) -> Any:
        a, most = self.a, s[0] - s[2]
        return most * (
            (1 + ((s[0] - s[1]) / most) ** a + ((s[1] - s[2]) / most) ** a) / 2
        ) ** (1 / a)  # fmt: skip


@dataclass(frozen=True)
class Quick(Hosford):
    """The same with a profile in closed form."""

    def profile(self, angle: Any) -> Profile:
        # with D the differences sqrt(2) sin, f^a = sum of D^a / 2; D'' = -D
        at = np.stack([np.pi / 3 - angle, angle, 2 * np.pi / 3 - angle])
        sign = np.array([-1.0, 1.0, -1.0])[:, None]
        D, d, a = np.sqrt(2) * np.sin(at), np.sqrt(2) * sign * np.cos(at), self.a
        f = ((D**a).sum(axis=0) / 2) ** (1 / a)
        slope = (D ** (a - 1) * d).sum(axis=0) / 2 * f ** (1 - a)
        change = ((a - 1) * D ** (a - 2) * d**2 - D**a).sum(axis=0) / 2 * f ** (1 - a)
        return Profile(f, slope, change + (1 - a) * slope**2 / f)


@dataclass(frozen=True)
class Odd(SmoothSurface):
    """Less strong in compression: sqrt(3 J2) with a part of the third invariant.

    As the angle goes from tension to compression it is ``1 - c cos(3 x)`` times that of von Mises,
    over its value in tension; it is convex where c is not above 1/8.
    """

    c: float = 0.08

    @property
    def over_shear(self) -> float:
        """Tensile stress over shear stress, where the third invariant is zero."""
        return float(np.sqrt(3)) / (1 - self.c)

    def tension(self, s: Any) -> Any:
        d = s - s.mean(axis=0)
        mises = np.sqrt(1.5 * (d**2).sum(axis=0))
        cos3 = 13.5 * d[0] * d[1] * d[2] / mises**3
        return mises * (1 - self.c * cos3) / (1 - self.c)
