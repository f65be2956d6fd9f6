"""What acts on a track while an elastic wheel stands on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.steady.load import AppliedLoad

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class RollingContact(AppliedLoad):
    """A wheel on a track.

    Attributes
    ----------
    x : (n,) positions of the vertices of the track [mm]
    normal, tangential : (n,) contact forces on the track, tangential ones along the surface
        against the way of the load [N]
    area : (n,) of the hats of the vertices [mm2]
    gap : (n,) between track and rim, NaN where none faces the other [mm]
    status : (n,) of the contact points
    bound : (n,) of the tangential forces [N]
    creepage : 1 + R d(rotation) / d(advance)
    height : displacement of the axle [mm]
    moment : on the axle / radius, positive when braking [N]
    """

    x: Array
    normal: Array
    tangential: Array
    area: Array
    gap: Array
    status: NDArray[np.int64]
    bound: Array
    creepage: float
    height: float
    moment: float

    @property
    def pressure(self) -> Array:
        """Contact pressure at the vertices (n,), zero where none faces the rim [MPa]."""
        return self._over_area(self.normal)

    @property
    def most_shear(self) -> Array:
        """Shear that friction allows at the vertices (n,) [MPa]."""
        return self._over_area(np.nan_to_num(self.bound))

    @property
    def shear(self) -> Array:
        """Shear on the track at the vertices (n,), against the way of the load [MPa]."""
        return self._over_area(self.tangential)

    def _over_area(self, force: Array) -> Array:
        return np.divide(force, self.area, out=np.zeros_like(force), where=self.area > 0)
