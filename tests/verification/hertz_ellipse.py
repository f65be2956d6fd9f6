"""Cases of Hertz's elliptic contact for the contact of a prism with a wheel."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from solver.materials import Elasticity
from solver.model.friction import Coulomb, FrictionLaw
from solver.rolling.load import RollingLoad
from solver.rolling.rail.half_space import half_space
from solver.rolling.rail.patch import RollingPatch
from solver.rolling.rail.patch_grid import PatchGrid
from solver.rolling.rail.profiled_wheel import ProfiledWheel
from tests.verification.closed_forms import HertzEllipse

Array = NDArray[np.float64]

STEEL = Elasticity(youngs_modulus=2e5, poisson_ratio=0.25)


Patch = TypeVar("Patch", bound=RollingPatch)


def wheel_on(
    grid: PatchGrid, compliance: Array, wheel: ProfiledWheel, *, friction: float | FrictionLaw,
    strength: float = np.inf, drive: float | None = None, kind: type[Patch] = RollingPatch,
    force: float, **rolls: float,
) -> Patch:  # fmt: skip
    """Return a wheel on a surface; ``drive`` is its moment over that of Coulomb's full slip."""
    moment = drive if not drive else drive * getattr(friction, "friction", friction) * force
    load = RollingLoad(force=force, drive=moment, **rolls)
    law = friction if isinstance(friction, FrictionLaw) else Coulomb(friction=friction)
    return kind(
        grid=grid, compliance=compliance, wheel=wheel, friction=law, strength=strength, load=load
    )


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
    shift: float = 0.0, **given: Any,
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
    return wheel_on(grid, surface_of(grid), wheel, force=hertz.force, **{"friction": 0.0, **given})


def flat(patch: RollingPatch) -> Array:
    """Return displacements of a surface that is not deformed, for a patch."""
    grid = patch.grid
    return np.zeros((grid.stations, len(grid.z), 3))
