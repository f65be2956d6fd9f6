"""Random contacts of a wheel with a surface, and the conditions that a contact must meet."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.materials import Elasticity
from solver.rolling.rail.half_space import half_space
from solver.rolling.rail.patch import RollingPatch
from solver.rolling.rail.patch_contact import PatchContact
from solver.rolling.rail.patch_grid import PatchGrid
from solver.rolling.rail.profiled_wheel import ProfiledWheel
from tests.verification.closed_forms import HertzEllipse
from tests.verification.hertz_ellipse import surface_of, wheel_on

Array = NDArray[np.float64]
MODULI = {"same": 2e5, "softer": 2e4, "stiffer": 2e6, "rigid": np.inf}
"""Young's modulus of the wheel; that of the surface is 2e5 MPa."""


def random_case(seed: int) -> tuple[RollingPatch, Array, ProfiledWheel, dict[str, float]]:
    """Return a patch, the compliance of its surface, its wheel, and what is given.

    Vertices are unevenly apart, the surface is tilted, its curvature is shared with the wheel;
    creepages are a hundredth to ten times those of full slip, or forces are given.
    """
    r = np.random.default_rng(seed)
    b = float(np.exp(r.uniform(-0.9, 0.9)))
    soft = Elasticity(youngs_modulus=2e5, poisson_ratio=float(r.uniform(0, 0.45)))
    E = MODULI[str(r.choice(list(MODULI)))]
    stiff = Elasticity(youngs_modulus=E, poisson_ratio=float(r.uniform(0, 0.49)))
    modulus = 1 / (1 / soft.plane_strain_modulus + 1 / stiff.plane_strain_modulus)
    hertz = HertzEllipse(
        a=1.0, b=b, peak_pressure=10 ** r.uniform(-3.5, -2) * modulus, modulus=modulus
    )
    rolling, crown = hertz.radii
    along, across = r.uniform(4, 10), r.uniform(3, 8)
    z = np.cumsum(r.uniform(0.6, 1.4, 2 * int(np.ceil(1.7 * across)) + 1))
    z = (z - z.mean()) / np.ptp(z) * 3.4 * b
    tilt, share = np.tan(r.uniform(-0.3, 0.3)), r.uniform(-0.5, 0.5)
    half = int(np.ceil(1.7 * along))
    grid = PatchGrid(
        z=z, y=tilt * z - (1 - share) * z**2 / (2 * crown),
        angle=np.arctan(tilt - (1 - share) * z / crown), spacing=1 / along,
        ahead=(half + r.uniform(-0.5, 0.5)) / along, stations=2 * half + 1,
    )  # fmt: skip
    wheel = ProfiledWheel(
        profile=lambda z: tilt * z + share * z**2 / (2 * crown), radius=rolling, elasticity=stiff
    )
    friction = float(r.choice([r.uniform(0, 1), 10 ** r.uniform(-2, 0)]))
    full, mode = friction / rolling, r.choice(["creepages", "drive", "lateral force", "forces"])

    def creepage() -> float:
        return float(r.choice([-1, 1]) * 10 ** r.uniform(-2, 1)) * full

    given = {"friction": friction, "force": hertz.force, "spin": creepage() / np.sqrt(b)}
    if mode in ("creepages", "lateral force"):
        given["creepage"] = creepage()
    else:
        given["drive"] = float(r.uniform(-0.9, 0.9))
    if mode in ("creepages", "drive"):
        given["lateral_creepage"] = creepage()
    else:
        rest = np.sqrt(1 - given.get("drive", 0.0) ** 2)
        given["lateral_force"] = (
            float(r.uniform(-0.8, 0.8)) * rest * friction + tilt
        ) * hertz.force
    if "lateral_force" in given:
        given["spin"] = 0.0
    compliance = surface_of(grid, soft)
    return wheel_on(grid, compliance, wheel, **given), compliance, wheel, given


def moved(contact: PatchContact, compliance: Array, wheel: ProfiledWheel) -> tuple[Array, Array]:
    """Return gap (n, m) and slip (n - 2, m, 2) of a contact, all but the first two stations.

    Displacements are sums over stations; those of the wheel are those of a half-space above.
    """
    grid, t = contact.grid, contact.traction
    n, axes = grid.stations, grid.axes
    up = half_space(grid.hats.s, grid.spacing, n, wheel.elasticity)
    local = np.einsum("jab,cjb->cja", axes, t)
    surface, rim = np.zeros_like(t), np.zeros_like(t)
    for c in range(n):
        for other in range(n):
            d = (c - other) % len(compliance)
            surface[c] += np.tensordot(compliance[d], t[other], 2)
            turned = local[other] * [-1.0, 1.0, -1.0]  # on the wheel, whose outward normal is down
            rim[c] += np.tensordot(up[c - other], turned, 2) * [1.0, -1.0, 1.0]
    apart = np.einsum("jab,cjb->cja", axes, surface) - rim
    motions = [contact.height, contact.creepage, contact.lateral_creepage, contact.spin]
    rest, of_motions = wheel.rolling(grid)
    rigid = rest + np.tensordot(motions, of_motions, 1)
    slip = (3 * apart[2:] - 4 * apart[1:-1] + apart[:-2]) / 2 + rigid[2:]
    return rigid[..., 1] - apart[..., 1], slip[..., [0, 2]]


def worst(contact: PatchContact, friction: float, gap: Array, slip: Array) -> float:
    """Return the largest violation of the conditions of contact, over the largest pressure.

    Lengths become pressures by the approach over the largest pressure.
    """
    p, q = contact.pressure, contact.shear
    stiffness = p.max() / abs(contact.height)
    size = np.linalg.norm(q, axis=-1)
    against = (q[2:] * slip).sum(axis=-1) + friction * p[2:] * np.linalg.norm(slip, axis=-1)
    sticks = size[2:] < friction * p[2:] * (1 - 1e-6)
    found = [
        -p, -gap * stiffness, np.minimum(p, gap * stiffness), size - friction * p,
        against / p.max() * stiffness, np.where(sticks[..., None], slip, 0.0) * stiffness,
    ]  # fmt: skip
    return float(max(part.max() for part in found) / p.max())
