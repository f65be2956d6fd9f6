"""Loads on the surface of a prism in a patch of contact: tractions, and how they change."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from solver.errors import WindowTooSmall
from solver.parameters import Length, check
from solver.rolling.load import AppliedLoad, PassingLoad
from solver.rolling.rail.flow import PrismState
from solver.rolling.rail.friction_cone import NORMAL, OPEN, SLIP, TANGENTS
from solver.rolling.rail.patch_grid import PatchGrid
from solver.rolling.rail.track import PrismField
from solver.typing import Array, Ints


@dataclass(frozen=True, slots=True)
class PatchStart:
    """The tractions (n, m, 3) [MPa] and motions of a contact, with which another pass begins."""

    traction: Array
    height: float
    creepage: float
    lateral_creepage: float


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
        order; None for a given load
    height : displacement of the wheel along y [mm]
    creepage, lateral_creepage, spin : as in `ProfiledWheel.rolling` [1, 1, 1/mm]
    moment : moment on the axle over the radius of the wheel, positive when braking [N]
    steps : Newton steps, with and without friction
    """

    grid: PatchGrid
    traction: Array
    gap: Array
    slip: Array
    status: Ints
    along: Callable[[Array], Array]
    near: Callable[[Array], PatchStart] | None = None
    height: float = 0.0
    creepage: float = 0.0
    lateral_creepage: float = 0.0
    spin: float = 0.0
    moment: float = 0.0
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


@dataclass(frozen=True, slots=True, kw_only=True)
class AppliedPatch(AppliedLoad):
    """A load on a prism.

    Attributes
    ----------
    contact : tractions, gap and slip
    load : the load whose contact it is
    """

    contact: PatchContact
    load: PatchLoad

    @property
    def start(self) -> PatchStart:
        """See `AppliedLoad`; without the functions of the contact, which hold much memory."""
        own = self.contact
        return PatchStart(own.traction, own.height, own.creepage, own.lateral_creepage)

    def near(self, moved: Array) -> PatchStart:
        """Return the contact with another displacement of the surface, to first order if known."""
        return self.contact.near(moved) if self.contact.near else self.start


@dataclass(frozen=True, kw_only=True, eq=False)
class PatchLoad(PassingLoad):
    """A load that passes over the surface of a prism along +x."""

    @abstractmethod
    def solve(self, u: Array, start: PatchStart | None = None) -> PatchContact:
        """Return the contact.

        Parameters
        ----------
        u : (n, m, 3) displacements of the surface without tractions, means under the hats [mm]
        start : what to begin with, of the same grid
        """

    def on(
        self, u: PrismField, before: PrismState, start: AppliedPatch | PatchStart | None = None
    ) -> AppliedPatch:
        """See `PassingLoad`."""
        moved = u.displacement + before.displacement
        if isinstance(start, AppliedPatch):
            start = start.near(moved)
        found = self.solve(moved, start)

        def along(change: PrismField) -> PrismField:
            return change.loaded(found.along(change.displacement))

        return AppliedPatch(
            force=found.force,
            u=u.loaded(found.traction),
            along=along,
            moment=found.moment,
            contact=found,
            load=self,
        )


_POINTS = 8
"""Number of points of an edge across for the integral of the pressure, which falls to 0 as a
root."""


@dataclass(frozen=True, kw_only=True, eq=False)
class EllipticPatch(PatchLoad):
    """Pressure p0 sqrt(1 - (x/a)^2 - ((z - centre)/b)^2) and shear in proportion; see `PatchLoad`.

    Across tractions are the nearest hats. Waves along take those of a station for a sample: that of
    a smooth pressure is its mean over the distance of stations, less a 24th of the second
    difference of means. Their sum is exact. At the edge, a vertex outside the ellipse may have a
    tension of p0 / 16. Stress from half an element down is that of the ellipse within 1 % of p0;
    under its edge, with elements of b / 6, within 1.2 %.

    Attributes
    ----------
    grid : stations and vertices of the surface
    load : its force is the sum of pressure times area, 2 pi a b p0 / 3 [N]
    a, b : semi-axes along x and z [mm]
    centre : z of the centre, which is at x = 0 [mm]
    shear : shear on the surface along x and across, over pressure
    """

    grid: PatchGrid
    a: Length
    b: Length
    centre: float = 0.0
    shear: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        """Raise `ModelError` for axes that are not positive, `WindowTooSmall` for a small grid."""
        check(self)
        x, z = self.grid.x, self.grid.z
        beside = max(z[1] - self.centre + self.b, self.centre + self.b - z[-2])
        if self.a > min(x[0], -x[-1]) - self.grid.spacing / 2 or beside > 0:
            raise WindowTooSmall("the ellipse reaches the outermost stations or vertices")

    def solve(self, u: Array, start: PatchStart | None = None) -> PatchContact:
        """See `PatchLoad`; the tractions depend on neither ``u`` nor ``start``."""
        grid = self.grid
        ends = grid.ahead + grid.spacing * (0.5 - np.arange(grid.stations + 1))
        shares, weights = np.polynomial.legendre.leggauss(_POINTS)
        shares, weights = (1 + shares) / 2, weights / 2
        z = (grid.z[:-1, None] + np.diff(grid.z)[:, None] * shares).ravel()
        half = self.a * np.sqrt(np.maximum(0.0, 1 - ((z - self.centre) / self.b) ** 2))
        x = np.clip(ends[:, None], -half, half)
        share = np.divide(x, half, out=np.zeros_like(x), where=half > 0)
        sums = (x * np.sqrt(half**2 - x**2) + half**2 * np.arcsin(share)) / 2
        means = -np.diff(sums, axis=0) @ grid.hats.nearest(shares, weights).T
        pressure = means - np.diff(np.pad(means, ((1, 1), (0, 0))), 2, axis=0) / 24
        pressure *= self.load.force / (pressure @ grid.area).sum()
        along, across = self.shear
        local = np.array([along, -1.0, across])
        none = np.full(pressure.shape, np.nan)
        return PatchContact(
            grid=grid,
            traction=pressure[..., None] * (local @ grid.axes),
            gap=none,
            slip=np.stack([none, none], axis=-1),
            status=np.where(pressure > 0, SLIP, OPEN),
            along=np.zeros_like,
        )
