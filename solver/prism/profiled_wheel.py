"""A wheel of revolution that rolls along a surface: its gap, and its rigid slip."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from solver.errors import ModelError

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from solver.materials import Elasticity
    from solver.prism.patch_grid import PatchGrid

    Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ProfiledWheel:
    """A wheel whose axle is along z, above x = 0.

    Attributes
    ----------
    profile : (positions z) -> height of the wheel's lowest line above the height of the wheel [mm]
    radius : R, rolling radius where the profile is zero [mm]
    elasticity : elastic constants of its surface; with an infinite modulus it is rigid
    """

    profile: Callable[[Array], Array]
    radius: float
    elasticity: Elasticity

    def __post_init__(self) -> None:
        """Raise `ModelError` for a radius that is not positive."""
        if not self.radius > 0:
            raise ModelError("radius", self.radius, "must be positive")

    def gap(self, grid: PatchGrid) -> Array:
        """Return the gap (n, m) above the surface along its normals, at height 0 [mm].

        At height d it is larger by d cos(angle). Raises `ModelError` where there is no wheel above.
        """
        z, y, slope = grid.surface
        height = np.asarray(self.profile(z), dtype=float)
        if not np.isfinite(height).all():
            raise ModelError("profile", height, "must be finite at every vertex and between")
        radius = self.radius - height
        below = radius**2 - grid.x[:, None] ** 2
        if not (below > 0).all():
            reach = float(radius.min())
            raise ModelError(
                "ahead", float(grid.ahead), f"stations must lie within {reach:g} of x = 0"
            )
        gap = height - y + radius - np.sqrt(below)
        return np.asarray((gap / np.hypot(1, slope)) @ grid.hats.mean.T)

    def rolling(self, grid: PatchGrid) -> tuple[Array, Array]:
        """Return slip and gap of the rigid wheel: (n, m, 3) at rest, (4, n, m, 3) of its motions.

        Slip is that of the surface over the wheel while the load advances by one station, along x
        and across; the gap lies between, as the normal does among local axes. Motions are height
        [mm], longitudinal creepage, lateral creepage, spin [1/mm]. With a wheel that turns by w and
        advances by V per time, longitudinal creepage is 1 - w R / V, lateral creepage its velocity
        along z over V, spin its rotation about -y over V.
        """
        h, sin, cos = grid.spacing, np.sin(grid.angle), np.cos(grid.angle)
        x = grid.x[:, None]
        arc = 1 - grid.hats.mean @ np.asarray(self.profile(grid.surface[0])) / self.radius
        turned = x * sin / self.radius  # the wheel's rotation has a part along the normal
        rest = np.zeros((grid.stations, len(grid.z), 3))
        rest[..., 0], rest[..., 1], rest[..., 2] = h * (arc - 1), self.gap(grid), h * turned
        motions = np.zeros((4, *rest.shape))
        motions[0, ..., 1] = cos
        motions[1, ..., 0], motions[1, ..., 2] = -h * arc, -h * turned
        motions[2, ..., 2] = -h * cos
        motions[3, ..., 0], motions[3, ..., 2] = h * grid.z, -h * cos * x
        return rest, motions
