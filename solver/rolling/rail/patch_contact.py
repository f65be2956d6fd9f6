"""Loads on the surface of a prism in a patch of contact: tractions, and how they change."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from solver.rolling.rail.friction_cone import NORMAL, TANGENTS
from solver.rolling.rail.patch_grid import PatchGrid
from solver.typing import Array, Ints


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PatchContact:
    """Tractions on a surface, at n stations and m vertices.

    Attributes
    ----------
    grid : stations and vertices
    traction : (n, m, 3) tractions on the surface in x, y, z [MPa]
    gap : (n, m) gap under the load, NaN for a given load [mm]
    slip : (n, m, 2) slip of the surface over the load, along x and across, while the load advances
        by the distance of two stations, NaN for a given load [mm]
    status : (n, m) OPEN, STICK or SLIP of `solver.rolling.rail.friction_cone`
    along : (change (n, m, 3) of the surface's displacement without tractions) -> change of
        ``traction``
    near : (displacement (n, m, 3) of the surface without tractions) -> the contact with it to first
        order: tractions and motions; None for a given load
    height : displacement of the wheel along y [mm]
    creepage, lateral_creepage, spin : as in `ProfiledWheel.rolling` [1, 1, 1/mm]
    steps : Newton steps, with and without friction
    """

    grid: PatchGrid
    traction: Array
    gap: Array
    slip: Array
    status: Ints
    along: Callable[[Array], Array]
    near: Callable[[Array], PatchContact] | None = None
    height: float = 0.0
    creepage: float = 0.0
    lateral_creepage: float = 0.0
    spin: float = 0.0
    steps: int = 0

    @property
    def pressure(self) -> Array:
        """Contact pressure (n, m) [MPa]."""
        return np.asarray(-self._local[..., NORMAL])

    @property
    def shear(self) -> Array:
        """Shear (n, m, 2) on the surface, along x and across [MPa]."""
        return np.asarray(self._local[..., TANGENTS])

    @property
    def force(self) -> Array:
        """Resultant (3,) on the surface in x, y, z [N]."""
        return np.asarray((self.traction * self.grid.area[:, None]).sum(axis=(0, 1)))

    @property
    def spin_moment(self) -> float:
        """Moment of the tractions on the surface about -y through x = z = 0 [N mm]."""
        x, z = self.grid.x[:, None], self.grid.z
        twist = x * self.traction[..., 2] - z * self.traction[..., 0]
        return float((twist * self.grid.area).sum())

    @property
    def _local(self) -> Array:
        return np.asarray(np.einsum("jab,cjb->cja", self.grid.axes, self.traction))


class PatchLoad(Protocol):
    """A load that passes over the surface of a prism along +x."""

    def solve(self, u: Array, start: PatchContact | None = None) -> PatchContact:
        """Return the contact.

        Parameters
        ----------
        u : (n, m, 3) displacements of the surface without tractions, means under the hats [mm]
        start : contact to begin with, of the same grid
        """

    def scaled(self, share: float) -> PatchLoad:
        """Return the same load with its forces times ``share``."""

    def driven(self, share: float) -> PatchLoad:
        """Return the same load with its driving or braking moment times ``share``."""

    @property
    def moment(self) -> float:
        """Prescribed moment over radius [N], positive when braking; 0 if none is prescribed."""

    @property
    def slipping(self) -> PatchLoad:
        """The same load with the moment at which all of its contact slips, if it has a moment."""
