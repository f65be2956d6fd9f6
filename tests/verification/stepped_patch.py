"""An elastic wheel that rolls over a prism by increments, over material that stands still.

The slip of a point of the surface is the change of its motion over the wheel in the increment. With
the motion r[c] at station c, u_t of surface minus wheel, that of the last increment, in which
the point was s stations further upstream under the wheel that advances by s, and r" of the one
before it,

    slip[c] = r[c] - r'[c - s] + s rigid slip
    slip[c] = (3 r[c] - 4 r'[c - s] + r"[c - 2 s]) / 2 + s rigid slip

The second difference, of second order, is taken where the last increment advanced by s too. In a
steady state r' and r" are r, which with s = 1 is the slip of `RollingPatch`. Where moment or
lateral force is given, the motion of the wheel in the increment is unknown, as its height is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from solver.rolling.rail.friction_cone import NORMAL, TANGENTS
from solver.rolling.rail.patch import UPSTREAM, RollingPatch
from solver.rolling.rail.patch_contact import PatchContact
from solver.typing import Array
from tests.verification.stepped_prism import SteppedContact


class SteppedPatch(RollingPatch):
    """A wheel that rolls by increments, for `SteppedPrism`; parameters are those of `RollingPatch`.

    The wheel of an increment is what `following` returns. The creepages of its contact are motions
    in the increment over the distance of two stations, which is creepage if it advances by one.
    """

    _weight = 1.0
    """Weight of the motion at a station in the slip there."""

    def following(self, before: Sequence[SteppedContact], stations: int) -> SteppedPatch:
        """See `SteppedLoad`; of a wheel that is set down, slip counts from the surface as it is."""
        load, weights = self.load, UPSTREAM if len(before) > 1 else (1.0, -1.0)
        load = replace(
            load, creepage=stations * load.creepage,
            lateral_creepage=stations * load.lateral_creepage, spin=stations * load.spin,
        )  # fmt: skip
        rest, motions = (each.copy() for each in self._rolling)
        rest[..., TANGENTS] *= stations / weights[0]
        motions[..., TANGENTS] /= weights[0]
        for count, (own, weight) in enumerate(zip(before, weights[1:], strict=True), start=1):
            ago = _upstream(self._motion(own), count * stations)
            rest[..., TANGENTS] += weight / weights[0] * ago
        other = self.changed(load=load)
        vars(other).update(_weight=weights[0], _rolling=(rest, motions), _sums=self._sums)
        return other

    def _motion(self, of: SteppedContact) -> Array:
        """Return the motion (n + 2, m, 2) of the surface over the wheel in an increment.

        It begins one station before the first, where material is that comes to touch.
        """
        left = self._offset(of.displacement)[..., TANGENTS]
        around = np.stack([2 * left[0] - left[1], *left, 2 * left[-1] - left[-2]])
        if of.contact is not None:
            everywhere = self._influence.everywhere(self._known(of.contact)[0])
            around += everywhere[np.arange(-1, len(left) + 1)][..., TANGENTS]
        return around

    def solve(self, u: Array, start: PatchContact | None = None) -> PatchContact:
        """See `PatchLoad`."""
        found = super().solve(u, start)
        return replace(found, slip=self._weight * found.slip)

    @staticmethod
    def _kernel(apart: Array) -> Array:
        """Return motion and gap by tractions."""
        return apart

    def _offset(self, u: Array) -> Array:
        """Return motion and gap (n, m, 3) from displacements (n, m, 3) of the surface."""
        local = np.einsum("jab,cjb->cja", self._axes, u)
        local[..., NORMAL] *= -1.0
        return np.asarray(local)


def _upstream(motion: Array, stations: int) -> Array:
    """Return the motion (n, m, 2) by station a number of stations further upstream.

    Beyond what is known (n + 2, m, 2) it goes on as a straight line.
    """
    at = np.arange(1, len(motion) - 1) - stations
    inside = np.clip(at, 0, len(motion) - 1)
    slope = np.where((at < 0)[:, None, None], motion[1] - motion[0], motion[-1] - motion[-2])
    return np.asarray(motion[inside] + (at - inside)[:, None, None] * slope)
