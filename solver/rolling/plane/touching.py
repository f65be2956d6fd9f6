"""The contact of an elastic wheel with a track: forces, pressure, shear, gap, slip."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.rolling.load import AppliedLoad
from solver.typing import Array, Ints


@dataclass(frozen=True, slots=True)
class RollingContact(AppliedLoad):
    """The contact of a wheel with a track.

    Attributes
    ----------
    x : (n,) positions of the vertices of the track [mm]
    normal, tangential : (n,) contact forces on the track; tangential forces are positive against
        the motion of the load [N]
    area : (n,) areas of the vertices' hats [mm2]
    gap : (n,) gap between track and rim, NaN if they do not face each other [mm]
    status : (n,) status of the contact points, as in `solver.contact.problem`
    bound : (n,) friction bound of the tangential forces [N]
    creepage : 1 + R d(rotation) / d(advance)
    height : displacement of the axle along y [mm]
    moment : moment on the axle over radius, positive when braking [N]
    """

    x: Array
    normal: Array
    tangential: Array
    area: Array
    gap: Array
    status: Ints
    bound: Array
    creepage: float
    height: float
    moment: float

    @property
    def pressure(self) -> Array:
        """Contact pressure at the vertices (n,) [MPa], zero at those that do not face the rim."""
        return self._over_area(self.normal)

    @property
    def most_shear(self) -> Array:
        """Largest shear that friction permits at the vertices (n,) [MPa]."""
        return self._over_area(np.nan_to_num(self.bound))

    @property
    def shear(self) -> Array:
        """Shear on the track at the vertices (n,), positive against the load's motion [MPa]."""
        return self._over_area(self.tangential)

    def _over_area(self, force: Array) -> Array:
        return np.divide(force, self.area, out=np.zeros_like(force), where=self.area > 0)
