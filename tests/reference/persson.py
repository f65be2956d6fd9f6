"""A disc in a hole of nearly its radius: the conforming contact of Persson.

Equal elastic materials, no friction. The disc is pressed by a force in its centre, and the body
around the hole is infinite and held far away. Forces are those per unit thickness [N/mm].

References
----------
A. Persson, On the stress distribution of cylindrical elastic bodies in contact, dissertation,
Chalmers University, Goteborg (1964).
M. Ciavarella, P. Decuzzi, The state of stress induced by the plane frictionless cylindrical
contact. I. The case of elastic similarity, Int. J. Solids Structures 38 (2001) 4507-4523.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import atan, log, pi, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class DiscInHole:
    """``force`` P [N/mm]; ``radius`` of the hole and ``clearance``, by how much the disc's is less.

    ``modulus`` is E / (1 - nu^2) of either body in plane strain [MPa].
    """

    force: float
    radius: float
    clearance: float
    modulus: float

    @property
    def _b(self) -> float:
        """Tangent of half the angle from the middle of the contact to its end."""
        wanted = self.modulus * self.clearance / self.force

        def beyond(b: float) -> float:
            found = (2 - log(b**2 + 1) - 2 * b**4) / (pi * b**2 * (b**2 + 1))
            return found - wanted

        return float(brentq(beyond, 1e-6, 2.0))

    @property
    def angle(self) -> float:
        """Angle from the middle of the contact to its end [rad]."""
        return 2 * atan(self._b)

    def pressure(self, angle: Array) -> Array:
        """Return the contact pressure at angles from the middle [MPa], 0 outside."""
        b, y = self._b, np.tan(np.asarray(angle) / 2)
        s, r = sqrt(b**2 + 1), np.sqrt(np.maximum(b**2 - y**2, 0.0))
        share = 2 / pi * r / (s * (1 + y**2))
        share += np.log((s + r) / (s - r)) / (2 * pi * b**2 * (b**2 + 1))
        return self.force / self.radius * share
