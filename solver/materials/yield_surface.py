"""The shape of a yield surface: at which stress a material yields, and in which direction."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, TypeVar

import numpy as np

from solver.tensors import deviator, von_mises

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Tension = TypeVar("Tension", float, NDArray[np.float64])

_NOTHING = 1e-300


class YieldSurface(Protocol):
    """The shape of a yield surface centred at zero; its size comes from the law."""

    def shear(self, tension: Tension) -> Tension:
        """Return the pure shear stress that is equivalent to a tensile stress [MPa]."""

    def equivalent(self, stress: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the equivalent tensile stress (n_points,) of a stress [MPa]."""

    def normal(self, stress: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivative (n_components, n_points) of `equivalent` by Mandel stress."""


@dataclass(frozen=True, slots=True)
class VonMises:
    """The von Mises surface: yield depends on the size of the deviator alone."""

    def shear(self, tension: Tension) -> Tension:
        """Return k = tension / sqrt(3) [MPa]."""
        return tension / math.sqrt(3)

    def equivalent(self, stress: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return q = sqrt(3/2 s:s) (n_points,) of Mandel stress (n_components, n_points) [MPa]."""
        return von_mises(stress)

    def normal(self, stress: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return 3/2 s / q (n_components, n_points); zero where there is no deviator."""
        s = deviator(stress)
        return np.asarray(1.5 * s / np.maximum(np.sqrt(1.5 * (s**2).sum(axis=0)), _NOTHING))
