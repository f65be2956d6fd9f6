"""Back stresses: rules by which the centre of a yield surface moves, used by `Chaboche`.

To add a rule, subclass `BackStress` and define ``modulus``, ``limit``, `in_tension` and `evolve`.
The return mapping and the tangent need no more (`solver.materials.back_stress_return`).
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from solver.materials.law import attribute
from solver.parameters import Checked, NotNegative
from solver.typing import Array

_STEP = 1e-5
"""Relative step of the central differences, whose error is of the order of its square; |normal| is
1.2."""
_STRAIN = 1e-4
"""Plastic strain added to dp where the step is taken relative to dp: about the strain at first
yield."""


class BackStress(ABC):
    """A part X of the centre of the yield surface: dX = 2/3 C d(plastic strain) - recall.

    Stresses are deviators (n_components, n_points), Mandel [MPa].
    """

    __slots__ = ()

    @attribute
    def modulus(self) -> float:
        """C [MPa]: initial slope in tension."""
        raise NotImplementedError(f"{type(self).__name__} must give its modulus")

    @attribute
    def limit(self) -> float:
        """Limit of the back stress in tension [MPa]; inf if it grows without bound."""
        raise NotImplementedError(f"{type(self).__name__} must give its limit")

    @attribute
    def symmetric(self) -> bool:
        """Whether the derivative of `evolve` by plastic strain is symmetric."""
        return False

    @abstractmethod
    def in_tension(self, accumulated: Array) -> Array:
        """Return its share (n_points,) of the stress of a tension test [MPa]."""

    @abstractmethod
    def evolve(self, old: Array, growth: Array, normal: Array) -> Array:
        """Return the back stress at the end of an increment of flow along N.

        One step of backward Euler suffices: `moved` takes many and extrapolates them.

        Parameters
        ----------
        old : back stress at its beginning; after heating it may exceed the limit
        growth : (n_points,) dp, increment of the accumulated plastic strain
        normal : (n_components, n_points) N; the plastic strain grows by dp N, and N : N = 3/2

        Returns
        -------
        (n_components, n_points), Mandel [MPa]
        """

    def moved(self, old: Array, growth: Array, normal: Array) -> Array:
        """Return `evolve` in 4, 8 and 16 parts, extrapolated (n_components, n_points) [MPa].

        By Romberg's scheme: the error of backward Euler, of first order in dp, becomes one of third
        order, or of second order where the rate has a kink. A rule that is exact may return
        `evolve`.
        """
        found: list[Array] = []
        for parts in (4, 8, 16):
            X = old
            for _ in range(parts):
                X = self.evolve(X, growth / parts, normal)
            found.append(X)
        coarse, middle, fine = found
        return np.asarray((8 * fine - 6 * middle + coarse) / 3)

    def slopes(self, old: Array, growth: Array, normal: Array) -> tuple[Array, Array]:
        """Return the derivatives of `moved` by dp and by N, for Newton's method and the tangent.

        They are central differences.

        Returns
        -------
        by_growth, by_normal
            (n_components, n_points) and (n_components, n_components, n_points) [MPa]
        """
        n, count = normal.shape
        h = _STEP * (growth + _STRAIN)
        turns = _STEP * np.concatenate([np.eye(n), -np.eye(n)])[:, :, None]
        # In one call: for some hundred points the calls cost more than the numbers.
        growths = np.concatenate([growth + h, growth - h, np.tile(growth, 2 * n)])
        normals = np.concatenate([normal, normal, *(normal + turn for turn in turns)], axis=1)
        moved = self.moved(np.tile(old, 2 + 2 * n), growths, normals).reshape(n, -1, count)
        turned = (moved[:, 2 : 2 + n] - moved[:, 2 + n :]) / (2 * _STEP)
        return (moved[:, 0] - moved[:, 1]) / (2 * h), turned

    def heat(self, old: Array, new: Array, growth: Array, flow: Array) -> Array:
        """Return the stored work that recall turns into heat (n_points,) [N mm/mm3].

        The stored work is 3/4 X:X / C; ``flow`` is the increment of plastic strain.
        """
        if not self.modulus:
            return np.zeros(old.shape[1])
        recalled = old + 2 / 3 * self.modulus * flow - new
        return np.asarray(1.5 / self.modulus * (new * recalled).sum(axis=0))

    def misfit(self, old: Array, new: Array, growth: Array, flow: Array) -> Array:
        """Return the error (n_components, n_points) of an increment with this rule [MPa]."""
        off = new - old
        at = np.flatnonzero((growth > 0) & flow.any(axis=0))  # elsewhere flow has no direction
        dp = growth[at]
        off[:, at] = new[:, at] - self.moved(old[:, at], dp, flow[:, at] / dp)
        return off


@dataclass(frozen=True, slots=True)
class ArmstrongFrederick(Checked, BackStress):
    """Armstrong and Frederick's rule: dX = 2/3 C d(plastic strain) - gamma X dp.

    Attributes
    ----------
    modulus : C [MPa], initial slope in tension
    recall : gamma, rate at which it fades; 0 is Prager's rule. In tension it tends to C / gamma
    """

    modulus: NotNegative
    recall: NotNegative = 0.0

    @property
    def limit(self) -> float:
        """C / gamma [MPa]."""
        if not self.modulus:
            return 0.0
        return self.modulus / self.recall if self.recall else math.inf

    @property
    def symmetric(self) -> bool:
        """True if it does not fade (gamma = 0)."""
        return not self.recall

    def in_tension(self, accumulated: Array) -> Array:
        """Return C / gamma (1 - exp(-gamma p)) (n_points,) [MPa]."""
        C, gamma, p = self.modulus, self.recall, accumulated
        return C * (-np.expm1(-gamma * p) / gamma if gamma else p)

    def evolve(self, old: Array, growth: Array, normal: Array) -> Array:
        """Return the exact X exp(-gamma dp) + 2/3 C / gamma (1 - exp(-gamma dp)) N [MPa].

        Shape (n_components, n_points). Only the turn of N in the increment is left out.
        """
        faded = np.exp(-self.recall * growth)
        return old * faded + 2 / 3 * self.in_tension(growth) * normal

    def heat(self, old: Array, new: Array, growth: Array, flow: Array) -> Array:
        """Return 3 gamma / (2 C) times the integral of X:X dp (n_points,) [N mm/mm3].

        By Simpson's rule: it is positive, and exact to the fifth order of gamma dp.
        """
        if not (self.modulus and self.recall):
            return np.zeros(old.shape[1])
        # half of the way: X exp(-gamma dp) + ... with dp / 2 twice gives the end
        half = np.exp(-self.recall * growth / 2)
        middle = (new + half * old) / (1 + half)
        squares = sum(
            weight * (X**2).sum(axis=0) for weight, X in ((1, old), (4, middle), (1, new))
        )
        return np.asarray(1.5 * self.recall / self.modulus * squares * growth / 6)
