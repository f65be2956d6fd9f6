"""Hertz's elliptic contact, and cases of it for the contact of a prism with a wheel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import linalg
from scipy.special import ellipe, ellipk

from solver.materials import Elasticity
from solver.prism.half_space import half_space
from solver.prism.patch import RollingPatch
from solver.prism.patch_grid import PatchGrid
from solver.prism.profiled_wheel import ProfiledWheel

Array = NDArray[np.float64]

STEEL = Elasticity(youngs_modulus=2e5, poisson_ratio=0.25)


@dataclass(frozen=True, slots=True, kw_only=True)
class HertzEllipse:
    """A contact with semi-axes ``a`` along x and ``b`` along z [mm], and largest pressure [MPa].

    ``modulus`` is E* with 1/E* the sum of (1 - nu^2)/E of both bodies.
    K.L. Johnson, Contact Mechanics (1985), 4.26: written for the longer axis along x.
    """

    a: float
    b: float
    peak_pressure: float
    modulus: float

    @property
    def _terms(self) -> tuple[float, float, float]:
        """Approach, and curvatures 1/(2 R) along the longer and the shorter axis."""
        long, short = max(self.a, self.b), min(self.a, self.b)
        e2 = 1 - (short / long) ** 2
        K, E = ellipk(e2), ellipe(e2)
        level = self.peak_pressure * short / self.modulus
        if e2 == 0:
            return level * K, np.pi / 4 * level / long**2, np.pi / 4 * level / long**2
        over = level / (e2 * long**2)
        return level * K, over * (K - E), over * ((long / short) ** 2 * E - K)

    @property
    def approach(self) -> float:
        """Approach of the bodies [mm]."""
        return self._terms[0]

    @property
    def radii(self) -> tuple[float, float]:
        """Relative radii in the planes of x and z [mm]."""
        _, long, short = self._terms
        along, across = (long, short) if self.a >= self.b else (short, long)
        return 1 / (2 * along), 1 / (2 * across)

    @property
    def force(self) -> float:
        """Force [N]."""
        return 2 / 3 * np.pi * self.a * self.b * self.peak_pressure

    def pressure(self, x: Array, z: Array) -> Array:
        """Return the pressure at positions of the surface."""
        inside = 1 - (x / self.a) ** 2 - (z / self.b) ** 2
        return self.peak_pressure * np.sqrt(np.maximum(0.0, inside))


def ellipse(a: float, b: float, peak: float = 1e-3) -> HertzEllipse:
    """Return a contact of two equal bodies; ``peak`` is the largest pressure over E*."""
    modulus = STEEL.plane_strain_modulus / 2
    return HertzEllipse(a=a, b=b, peak_pressure=peak * modulus, modulus=modulus)


def surface_of(grid: PatchGrid, elasticity: Elasticity = STEEL) -> Array:
    """Return the compliance of a half-space in x, y, z, whose surface follows that of a grid."""
    local = half_space(grid.hats.s, grid.spacing, grid.stations, elasticity)
    turn = linalg.block_diag(*grid.axes)
    return (turn.T @ local.reshape(-1, *turn.shape) @ turn).reshape(local.shape)


def pressed(
    hertz: HertzEllipse, along: float, across: float, *, margin: float = 1.25,
    shift: float = 0.0, **given: float,
) -> RollingPatch:  # fmt: skip
    """Return a cylinder on a crowned rail whose contact has this ellipse.

    ``along`` and ``across`` are the distances of stations and vertices, ``given`` friction, drive,
    creepages and so on.
    Stations and vertices are symmetric about the middle but for a ``shift``, over their distance.
    """
    rolling, crown = hertz.radii
    half = np.ceil(margin * hertz.b / across) * across
    z = np.linspace(-half, half, 2 * round(half / across) + 1) + shift * across
    ahead = np.ceil(margin * hertz.a / along) * along
    grid = PatchGrid(
        z=z, y=-(z**2) / (2 * crown), angle=-np.arctan(z / crown), spacing=along,
        ahead=ahead + shift * along,
        stations=2 * round(ahead / along) + 1,
    )  # fmt: skip
    wheel = ProfiledWheel(profile=np.zeros_like, radius=rolling, elasticity=STEEL)
    return RollingPatch(
        grid, surface_of(grid), wheel, force=hertz.force, **{"friction": 0.0, **given}
    )


def flat(patch: RollingPatch) -> Array:
    """Return displacements of a surface that is not deformed, for a patch."""
    grid = patch.grid
    return np.zeros((grid.stations, len(grid.z), 3))
