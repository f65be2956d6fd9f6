"""Back-stress rules that the package does not have, and the rates that they stand for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.materials import BackStress
from solver.tensors import von_mises


@dataclass(frozen=True)
class Plain(BackStress):
    """Armstrong and Frederick's rule written out."""

    modulus: float
    recall: float

    @property
    def limit(self) -> float:
        return self.modulus / self.recall

    def in_tension(self, p):
        return self.limit * -np.expm1(-self.recall * p)

    def evolve(self, old, growth, normal):
        fade = np.exp(-self.recall * growth)
        return old * fade + 2 / 3 * self.limit * (1 - fade) * normal

    def moved(self, old, growth, normal):
        return self.evolve(old, growth, normal)

    def recalled(self, X, N):
        """What the rate loses over dp."""
        return self.recall * X


@dataclass(frozen=True)
class BurletCailletaud(Plain):
    """It forgets along the flow what is not the share that it forgets along itself.

    H. Burlet, G. Cailletaud, Proc. 2nd Int. Conf. Constitutive Laws for Engineering Materials
    (1987) 1157-1164.
    """

    share: float

    def evolve(self, old, growth, normal):
        n = normal / np.sqrt((normal**2).sum(axis=0))
        along = (old * n).sum(axis=0) * n
        aside = (old - along) * np.exp(-self.share * self.recall * growth)
        return aside + super().evolve(along, growth, normal)

    def recalled(self, X, N):
        along = 2 / 3 * (X * N).sum(axis=0) * N
        return self.recall * (self.share * X + (1 - self.share) * along)


@dataclass(frozen=True)
class Threshold(BackStress):
    """It fades with what is above a threshold: that of `examples/own_back_stress.py`."""

    modulus: float
    recall: float
    threshold: float

    @property
    def limit(self) -> float:
        return self.threshold + self.modulus / self.recall

    def in_tension(self, p):
        later = np.maximum(p - self.threshold / self.modulus, 0.0)
        return self.modulus * (p - later - np.expm1(-self.recall * later) / self.recall)

    def evolve(self, old, growth, normal):
        grown, fade = old + 2 / 3 * self.modulus * growth * normal, self.recall * growth
        size = np.maximum(von_mises(grown), self.threshold)
        return grown * (1 + fade * self.threshold / size) / (1 + fade)

    def recalled(self, X, N):
        size = np.maximum(von_mises(X), self.threshold)
        return self.recall * (1 - self.threshold / size) * X


@dataclass(frozen=True)
class OhnoWang(BackStress):
    """It forgets the more, the nearer it is to its limit L, and while it grows alone.

    N. Ohno, J.-D. Wang, Int. J. Plasticity 9 (1993) 375-390, with the third power. The size a of
    the new back stress solves ``a (1 + k (a / L)^3) = size of what has grown`` by Newton's method.
    """

    modulus: float
    limit: float

    def in_tension(self, p):
        x = np.linspace(0.0, 1.0, 4001)[:-1]
        over = 0.5 * (np.arctanh(x) + np.arctan(x)) * self.limit / self.modulus
        return self.limit * np.interp(p, over, x)

    def evolve(self, old, growth, normal):
        grown = old + 2 / 3 * self.modulus * growth * normal
        size = np.maximum(von_mises(grown), 1e-12 * self.limit)
        turned = np.maximum((grown * normal).sum(axis=0) / size, 0.0)
        k = self.modulus / self.limit * turned * growth
        a = np.minimum(size, self.limit)
        for _ in range(30):
            power = (a / self.limit) ** 3
            step = (a * (1 + k * power) - size) / (1 + 4 * k * power)
            a = a - step
            if (np.abs(step) <= 1e-12 * size).all():
                break
        return grown * a / size

    def recalled(self, X, N):
        size = np.maximum(von_mises(X), 1e-12 * self.limit)
        turned = np.maximum((X * N).sum(axis=0) / size, 0.0)
        return self.modulus / self.limit * (size / self.limit) ** 3 * turned * X
