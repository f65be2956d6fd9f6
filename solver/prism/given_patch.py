"""A given load on the surface of a prism: the pressure of Hertz's ellipse, and shear along it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from solver.errors import ModelError, WindowTooSmall
from solver.prism.friction_cone import OPEN, SLIP
from solver.prism.patch_contact import PatchContact

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.prism.patch_grid import PatchGrid

    Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EllipticPatch:
    """Pressure p0 sqrt(1 - (x/a)^2 - ((z - centre)/b)^2) and shear in proportion; see `PatchLoad`.

    Tractions are means over the distance of stations and under the hats; their sum is exact.

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
    a: float
    b: float
    centre: float = 0.0
    shear: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        """Raise `ModelError` for axes that are not positive, `WindowTooSmall` for a small grid."""
        for name in ("a", "b"):
            if not getattr(self, name) > 0:
                raise ModelError(name, getattr(self, name), "must be positive")
        x, z = self.grid.x, self.grid.z
        beside = max(z[1] - self.centre + self.b, self.centre + self.b - z[-2])
        if self.a > min(x[0], -x[-1]) - self.grid.spacing / 2 or beside > 0:
            raise WindowTooSmall("the ellipse reaches the outermost stations or vertices")

    def solve(self, u: Array, start: PatchContact | None = None) -> PatchContact:
        """See `PatchLoad`; the tractions depend on neither ``u`` nor ``start``."""
        grid = self.grid
        ends = grid.ahead + grid.spacing * (0.5 - np.arange(grid.stations + 1))
        z, _, _ = grid.surface
        half = self.a * np.sqrt(np.maximum(0.0, 1 - ((z - self.centre) / self.b) ** 2))
        x = np.clip(ends[:, None], -half, half)
        share = np.divide(x, half, out=np.zeros_like(x), where=half > 0)
        sums = (x * np.sqrt(half**2 - x**2) + half**2 * np.arcsin(share)) / 2
        pressure = -np.diff(sums, axis=0) @ grid.hats.mean.T
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

    def following(self, u: Array, contact: PatchContact | None, stations: int) -> EllipticPatch:
        """See `SteppedLoad`; the tractions do not change."""
        return self

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
