"""A half-plane whose state is a function of depth alone, as steady passes leave it.

With plastic strain ep and no load the strains along x and z are zero, and no stress acts on planes
y = const. In two dimensions, with 4 Mandel components:

    eps_yy = ep_yy + lambda / (lambda + 2 G) (ep_xx + ep_zz),   eps_xy = ep_xy
    sigma_xx = -E / (1 - nu^2) (ep_xx + nu ep_zz),   sigma_zz likewise

K. Dang Van, M.H. Maitournam, J. Mech. Phys. Solids 41 (1993) 1691-1710.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver.materials.elasticity import Elasticity
from solver.rolling.load import LeftState
from solver.typing import Array


@dataclass(frozen=True, slots=True)
class Layers(LeftState):
    """The state by depth.

    Attributes
    ----------
    depth : (n,) depths of the rows of integration points, increasing [mm]
    thickness : (n,) thickness of the layer of each row [mm]
    surface : the layer at depth zero, without thickness; None in that layer itself
    """

    depth: Array
    thickness: Array
    surface: Layers | None = None

    @property
    def top(self) -> Layers:
        """The layer at depth zero."""
        assert self.surface is not None
        return self.surface

    @property
    def whole(self) -> Layers:
        """All layers together, the layer at depth zero first."""
        both = self.top, self
        depth, thickness = (
            np.concatenate([getattr(each, name) for each in both])
            for name in ("depth", "thickness")
        )
        packed = np.concatenate([each.state.packed for each in both], axis=1)
        return Layers(self.state.unpacked(packed), depth, thickness)

    def strain(self, elasticity: Elasticity) -> Array:
        """Return total strain (n, 4), Mandel."""
        nu = elasticity.poisson_ratio
        total = np.zeros_like(self.plastic_strain)
        ep = self.plastic_strain
        total[:, 1] = ep[:, 1] + nu / (1 - nu) * (ep[:, 0] + ep[:, 2])
        total[:, 3] = ep[:, 3]
        return total

    def stress(self, elasticity: Elasticity) -> Array:
        """Return residual stress (n, 4), Mandel [MPa]."""
        stress = np.zeros_like(self.plastic_strain)
        stress[:, [0, 2]] = -elasticity.biaxial_stress(self.plastic_strain[:, [0, 2]].T).T
        return stress

    def displacement(self, elasticity: Elasticity) -> Array:
        """Return the displacement (2,) of the surface relative to depth [mm]."""
        return np.array([self.advance, self.strain(elasticity)[:, 1] @ self.thickness])

    @property
    def advance(self) -> float:
        """Displacement of the surface along x relative to depth [mm]."""
        return float(np.sqrt(2.0) * self.plastic_strain[:, 3] @ self.thickness)

    @property
    def mirrored(self) -> Layers:
        """The same layers, seen along -x."""
        surface = self.surface.mirrored if self.surface else None
        return replace(self, state=self.state.mirrored, surface=surface)
