"""An elastic wheel that rolls over a prism by increments, over material that stands still.

The slip of a point of the surface is the change of its motion over the wheel since the last
increment, in which it was s stations further upstream under the wheel that advances by s:

    slip[c] = r[c] - r_before[c - s] + s rigid slip,    r = u_t of surface minus wheel

In a steady state r_before is r, which with s = 1 is the slip of `RollingPatch`. Where moment or
lateral force is given, the motion of the wheel in the increment is unknown, as its height is.
"""

from __future__ import annotations

from copy import copy
from typing import TYPE_CHECKING

import numpy as np

from solver.prism.friction_cone import NORMAL, TANGENTS
from solver.prism.patch import RollingPatch

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.prism.patch_contact import PatchContact

    Array = NDArray[np.float64]


class SteppedPatch(RollingPatch):
    """A wheel that rolls by increments, for `SteppedPrism`; parameters are those of `RollingPatch`.

    The wheel of an increment is what `following` returns. The creepages of its contact are motions
    in the increment over the distance of two stations, which is creepage if it advances by one.
    """

    def following(self, u: Array, contact: PatchContact | None, stations: int) -> SteppedPatch:
        """See `SteppedLoad`; of a wheel that is set down, slip counts from the surface as it is."""
        motion = self._offset(u)[..., TANGENTS]
        if contact:
            motion += self._influence.of(self._known(contact)[0])[..., TANGENTS]
        other, n = copy(self), len(motion)
        other._given = stations * self._given
        other._rest = self._rest.copy()
        other._rest[..., TANGENTS] *= stations
        first, last = max(0, stations), min(n, n + stations)
        if first < last:
            other._rest[first:last, :, TANGENTS] -= motion[first - stations : last - stations]
        return other

    @staticmethod
    def _kernel(apart: Array) -> Array:
        """Return motion and gap by tractions."""
        return apart

    def _offset(self, u: Array) -> Array:
        """Return motion and gap (n, m, 3) from displacements (n, m, 3) of the surface."""
        local = np.einsum("jab,cjb->cja", self._axes, u)
        local[..., NORMAL] *= -1.0
        return np.asarray(local)
