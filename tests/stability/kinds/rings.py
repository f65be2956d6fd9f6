"""Rings fitted into each other: Lame's solution."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np


@dataclass(frozen=True, kw_only=True)
class Ring:
    """An elastic ring [N, mm, MPa]; ``free`` is the strain that its heat would give it."""

    inner: float
    outer: float
    E: float
    nu: float
    plane_strain: bool
    free: float = 0.0

    @property
    def _plane(self) -> tuple[float, float, float]:
        """Young's modulus, Poisson's ratio and free strain of the same ring in plane stress."""
        if not self.plane_strain:
            return self.E, self.nu, self.free
        return self.E / (1 - self.nu**2), self.nu / (1 - self.nu), (1 + self.nu) * self.free

    def _polar(self, r: float, inside: float, outside: float) -> tuple[float, float]:
        """Return radial and hoop stress under pressures inside and outside."""
        a, b = self.inner**2, self.outer**2
        even = (inside * a - outside * b) / (b - a)
        odd = (inside - outside) * a * b / (b - a) / r**2
        return even - odd, even + odd

    def grows(self, r: float, inside: float, outside: float) -> float:
        """Return the radial displacement [mm]."""
        E, nu, free = self._plane
        radial, hoop = self._polar(r, inside, outside)
        return r * ((hoop - nu * radial) / E + free)

    def stress(
        self, r: float, angle: float, inside: float, outside: float, warm: float
    ) -> np.ndarray:
        """Return the stress xx, yy, zz, xy at a radius and an angle [rad]."""
        radial, hoop = self._polar(r, inside, outside)
        c, s = np.cos(angle), np.sin(angle)
        out = self.nu * (radial + hoop) - self.E * self.free * warm if self.plane_strain else 0.0
        xx, yy = radial * c**2 + hoop * s**2, radial * s**2 + hoop * c**2
        return np.array([xx, yy, out, (radial - hoop) * s * c])


def fitted(rings: Sequence[Ring], overlap: Sequence[float], inside: float) -> np.ndarray:
    """Return pressures in the bore, between rings and outside (n + 1,).

    Of all ways in which pairs may be open or closed there is one without pull and overlap.
    """
    n = len(rings)
    for closed in product((True, False), repeat=n - 1):

        def misses(p: np.ndarray) -> np.ndarray:
            every = [inside, *p, 0.0]
            return np.array([
                rings[k + 1].grows(rings[k + 1].inner, every[k + 1], every[k + 2])
                - rings[k].grows(rings[k].outer, every[k], every[k + 1])
                - overlap[k]
                for k in range(n - 1)
            ])  # fmt: skip

        p = np.zeros(n - 1)
        shut = np.flatnonzero(closed)
        base = misses(p)
        if len(shut):
            unit = np.eye(n - 1)
            J = np.stack([misses(unit[k]) - base for k in shut], axis=1)
            p[shut] = np.linalg.solve(J[shut], -base[shut])
        gaps = misses(p)
        opened = np.setdiff1d(np.arange(n - 1), shut)
        if (p >= 0).all() and (gaps[opened] >= 0).all():
            return np.array([inside, *p, 0.0])
    raise ValueError("no state of contact")
