"""Which stress makes a material flow, and where to: the shape of the yield surface."""

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
    """The shape of a yield surface, of any size and centred at zero."""

    def shear(self, tension: Tension) -> Tension:
        """Return the shear stress that is as near to yield as a tension [MPa]."""

    def equivalent(self, stress: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the tension (n_points,) that is as near to yield as a stress [MPa]."""

    def normal(self, stress: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivative (n_components, n_points) of `equivalent` by Mandel stress."""


@dataclass(frozen=True, slots=True)
class VonMises:
    """The surface of von Mises: yield depends on the size of the deviator alone."""

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
