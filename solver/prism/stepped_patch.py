"""An elastic wheel that rolls over a prism by increments, over material that stands still.

The slip of a point of the surface is the change of its motion over the wheel since the last
increment, in which it was one station further upstream under the wheel:

    slip[c] = r[c] - r_before[c - 1] + rigid slip,    r = u_t of surface minus wheel

In a steady state r_before is r, which is the slip of `RollingPatch`.
"""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from solver.prism.friction_cone import NORMAL, TANGENTS
from solver.prism.patch import RollingPatch

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.prism.friction_cone import ConeProblem
    from solver.prism.patch_contact import PatchContact

    Array = NDArray[np.float64]


class SteppedPatch(RollingPatch):
    """A wheel that rolls by increments of one station, for `SteppedPrism.rolled`.

    Parameters are those of `RollingPatch`. Before the first increment nothing has moved. A wheel
    that is driven or braked needs a given ``creepage``: with a ``drive`` other than 0 the first
    increment may find no contact.
    """

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        self._before = np.zeros_like(self._rest)

    def advanced(self, u: Array, contact: PatchContact) -> SteppedPatch:
        """Return the wheel one station on, after a contact and its displacements (n, m, 3)."""
        values, _ = self._known(contact)
        motion = (self._offset(u) + self._influence.of(values))[..., TANGENTS]
        other = copy(self)
        other._before = np.zeros_like(self._rest)
        other._before[1:, :, TANGENTS] = motion[:-1]
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

    def _problem(self, u: Array) -> ConeProblem:
        """Return the frictional problem of a surface with these displacements (n, m, 3)."""
        problem = super()._problem(u)
        return replace(problem, offset=problem.offset - self._before)
