"""A given load on the surface of a prism: the pressure of Hertz's ellipse, and shear along it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver.errors import WindowTooSmall
from solver.kinds import check
from solver.parameters import Length
from solver.rolling.rail.friction_cone import OPEN, SLIP
from solver.rolling.rail.patch_contact import PatchContact
from solver.rolling.rail.patch_grid import PatchGrid
from solver.typing import Array

_POINTS = 8
"""Points of an edge across at which the pressure is integrated: it falls to 0 as a root."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EllipticPatch:
    """Pressure p0 sqrt(1 - (x/a)^2 - ((z - centre)/b)^2) and shear in proportion; see `PatchLoad`.

    Across tractions are the nearest hats. Waves along take those of a station for a sample: that of
    a smooth pressure is its mean over the distance of stations, less a 24th of the second
    difference of means. Their sum is exact. At the edge a vertex outside the ellipse may have a
    tension of p0 / 16. Stress from half an element down is that of the ellipse within 1 % of p0;
    under its edge, with elements of b / 6, within 1.2 %.

    Attributes
    ----------
    grid : stations and vertices of the surface
    force : sum of pressure times area, 2 pi a b p0 / 3 [N]
    a, b : semi-axes along x and z [mm]
    centre : z of the centre, which is at x = 0 [mm]
    shear : shear on the surface along x and across, over pressure
    """

    grid: PatchGrid
    force: float
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

    def solve(self, u: Array, start: PatchContact | None = None) -> PatchContact:
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
        pressure *= self.force / (pressure @ grid.area).sum()
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

    def scaled(self, share: float) -> EllipticPatch:
        """See `PatchLoad`."""
        return replace(self, force=share * self.force)

    def driven(self, share: float) -> EllipticPatch:
        """See `PatchLoad`; a given shear is not changed."""
        return self

    @property
    def moment(self) -> float:
        """See `PatchLoad`."""
        return 0.0

    @property
    def slipping(self) -> EllipticPatch:
        """See `PatchLoad`."""
        return self
