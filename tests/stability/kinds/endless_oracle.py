"""What steady passes must satisfy, computed again from what is recorded of them.

From the solver come the record, and at the points of the half-plane stress, plastic strain and
accumulated plastic strain, under the load of the last pass and after it. After a pass the state
depends on depth alone: strains along x and z vanish, so Hooke's law alone gives the stress that
plastic strain leaves. Every figure is 0 for a perfect answer.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tests.stability.trial import Figure

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver import Record
    from solver.results.run import FinishedRun
    from solver.rolling.scenes.rolling import RollingParameters

    Array = NDArray[np.float64]

AHEAD, BEHIND, DEEP = 2.9, 4.9, 3.9
"""Where material flows / half-width: beyond, the plastic strain is held as it is."""

LIMITS = {
    "audit": 0.0,  # whether the run broke a limit of its own
    "free layers": 1e-9,  # residual sigma_y and tau_xy over the yield stress
    "uniform": 1e-9,  # difference of residual stress along the track, over the yield stress
    "left stress": 1e-9,  # residual stress against that of the plastic strain
    "profile": 0.0,  # plastic strain falls in a pass, or is negative
    "yield loaded": 5e-4,  # von Mises beyond the strength; a pass is found within 1.3e-4
    "yield left": 1e-9,
    "volume": 1e-10,  # plastic change of volume over the largest plastic strain
    "path": 1e-9,  # plastic strain that is larger than its path was long
    "free nodes": 1e-6,  # force at nodes that nothing holds or presses, over the force
    "vertical": 1e-6,  # what stress leaves at the surface against the force
    "across": 1e-6,  # the same along x against the shear that is recorded
    "pressure": 0.02,  # integral of the recorded pressure over the force
    "shear": 0.02,
    "cone": 1e-6,
    "tension": 1e-9,
    "elastic": 0.0,  # plastic strain far below the load that makes any
}
STEEP = 5e-3
"""Of the force: what the elements lack of the steep ends of a given pressure."""


@dataclass(frozen=True, kw_only=True)
class Passed:
    """A run of steady passes, and what it must be equal to: its mirror image, itself scaled."""

    parameters: RollingParameters
    record: Record
    run: FinishedRun
    mirrored: Record | None = None
    scaled: Record | None = None
    stresses: float = 1.0


def judge(passed: Passed) -> dict[str, Figure]:
    """Return the figures."""
    record = passed.record
    if not record.status.solved:
        return {"audit": Figure(1.0, 0.0)}
    own = passed.parameters.of_pass(len(record.coordinates["pass"]) - 1)
    found = {
        "audit": 0.0,
        **_left(passed),
        **_law(passed, own),
        **_balance(passed, own),
        **_surface(record, own),
        "elastic": record.scalars["max_plastic_strain"] if never_yields(passed.parameters) else 0.0,
    }
    if own.load == "hertz":
        more = dict.fromkeys(("vertical", "across"), STEEP)
    else:  # pressure on a surface that is tilted has a part along x
        more = {"across": record.scalars["contact_half_width"] / own.radius}
    figures = {name: Figure(found[name], LIMITS[name] + more.get(name, 0.0)) for name in LIMITS}
    return figures | _others(passed)


def never_yields(parameters: RollingParameters) -> bool:
    """Whether the load is far below any that yields.

    Under a Hertz pressure alone von Mises stress is at most p0 (at the surface, where Poisson's
    ratio is 0); shear mu p0 adds at most 2 mu p0 along the surface and mu p0 across it, and an
    elastic contact has no more pressure than p0.
    """

    def most(p: RollingParameters) -> float:
        sheared = p.friction * (abs(p.traction) if p.load == "hertz" else 1.0)
        return p.load_ratio * (1 + (2 + np.sqrt(3)) * sheared)

    return max(most(p) for p in parameters.block) < 0.8


def _left(passed: Passed) -> dict[str, float]:
    """Return how far the state after the passes is from one of free layers."""
    p, run = passed.parameters, passed.run
    left = run.unloaded.state
    stress, ep = left.stress / p.yield_stress, left.plastic.plastic_strain
    nu, E = p.poisson_ratio, p.youngs_modulus / p.yield_stress
    wanted = np.zeros_like(stress)
    wanted[0] = -E / (1 - nu**2) * (ep[0] + nu * ep[2])
    wanted[2] = -E / (1 - nu**2) * (ep[2] + nu * ep[0])
    size = max(1.0, E * float(np.abs(ep).max()))
    depth = np.round(_positions(passed)[1] / p.mesh_width, 9)
    order = np.argsort(depth, kind="stable")
    first = np.append(0, np.flatnonzero(np.diff(depth[order])) + 1)
    spread = np.maximum.reduceat(stress[:, order], first, axis=1)
    spread -= np.minimum.reduceat(stress[:, order], first, axis=1)
    profile = passed.record.fields["residual_profile"][1] / p.yield_stress
    grown = passed.record.fields["pass_plastic_increment"][1]
    return {
        "free layers": float(np.abs(profile[..., [1, 3], :]).max()) / size,
        "uniform": float(spread.max()) / size,
        "left stress": float(np.abs(stress - wanted).max()) / size,
        "profile": max(0.0, -float(np.nanmin(grown, initial=0.0))),
    }


def _positions(passed: Passed) -> np.ndarray:
    """Return where the points are, and those at the surface above the first row (2, n)."""
    points = passed.run.system.full("half_space").points.reshape(2, -1)
    first = points[1] > points[1].max() * (1 + 1e-6)
    return np.concatenate([points, points[:, first] * [[1.0], [0.0]]], axis=1)


def _law(passed: Passed, own: RollingParameters) -> dict[str, float]:
    """Return how far stress and plastic strain are from the law, where material flows."""
    p, run = passed.parameters, passed.run
    a, linear = p.mesh_width, p.material().linear_hardening
    assert linear is not None
    x, y = _positions(passed)
    x = x * passed.parameters.directions[len(passed.record.coordinates["pass"]) - 1]
    inside = (x < AHEAD * a) & (x > -BEHIND * a) & (y > -DEEP * a)
    found = {}
    for name, state in (("yield loaded", run.loaded), ("yield left", run.unloaded)):
        stress, plastic = state.state.stress, state.state.plastic
        ep, total = plastic.plastic_strain, plastic.accumulated
        relative = stress - 2 / 3 * linear.kinematic_modulus * ep
        relative[:3] -= relative[:3].mean(axis=0)
        strength = linear.yield_stress + linear.isotropic_modulus * total
        beyond = np.sqrt(1.5 * (relative**2).sum(axis=0)) - strength
        size = max(1.0, p.youngs_modulus * float(np.abs(ep).max()) / p.yield_stress)
        at = inside if name == "yield loaded" else slice(None)
        found[name] = max(0.0, float(beyond[at].max())) / p.yield_stress
        if name == "yield left":
            found[name] /= size
        largest = max(float(np.abs(ep).max()), 1e-300)
        length = np.sqrt(2 / 3 * (ep**2).sum(axis=0))
        for key, value in (
            ("volume", np.abs(ep[:3].sum(axis=0)).max()),
            ("path", max(0.0, (length - total).max())),
        ):
            found[key] = max(found.get(key, 0.0), float(value) / largest)
    del own
    return found


def _balance(passed: Passed, own: RollingParameters) -> dict[str, float]:
    """Return how far the stress under load is from what presses on the surface."""
    run = passed.run
    part = run.system.full("half_space")
    stress = run.loaded.state.stress[:, : part.weights.size]
    left = part.undeformed.internal_force(stress).reshape(-1, 2)
    held = np.ones(part.n, dtype=bool)
    held[part.free] = False
    top = np.zeros(len(left), dtype=bool)
    top[part.boundary_nodes("top")] = True
    free = np.where(held.reshape(-1, 2) | top[:, None], 0.0, left)
    top &= ~held.reshape(-1, 2)[:, 0]
    sheared = passed.record.scalars["longitudinal_force"]
    return {
        "free nodes": float(np.abs(free).max()) / own.force,
        "vertical": abs(float(left[top, 1].sum()) / own.force + 1),
        "across": abs(float(left[top, 0].sum()) - sheared) / own.force,
    }


def _surface(record: Record, own: RollingParameters) -> dict[str, float]:
    """Return how far what is recorded of pressure and shear is from the load."""
    at = list(record.coordinates["stage"]).index("loaded")
    s = record.coordinates["s"]
    pressure, shear = (record.fields[f"contact_{name}"][1][at] for name in ("pressure", "shear"))
    sheared = record.scalars["longitudinal_force"]
    bound = own.friction * pressure
    return {
        "pressure": abs(float(np.trapezoid(pressure, s)) / own.force - 1),
        "shear": abs(float(np.trapezoid(shear, s)) - sheared) / own.force,
        "cone": float((np.abs(shear) - bound).max() / pressure.max()),
        "tension": -float(pressure.min()) / float(pressure.max()),
    }


SAME = 1e-6
"""Of a mirror image, and of a run in other units: they are computed from other numbers, and what
ends Newton's method need not be the same."""


def _others(passed: Passed) -> dict[str, Figure]:
    """Return how far mirror image and scaled run are from this one."""
    figures = {}
    if passed.mirrored is not None:
        figures["mirrored"] = Figure(_apart(passed, passed.mirrored, 1.0, mirrored=True), SAME)
    if passed.scaled is not None:
        apart = _apart(passed, passed.scaled, passed.stresses, mirrored=False)
        figures["scaled"] = Figure(apart, SAME)
    return figures


def _apart(passed: Passed, other: Record, stress: float, *, mirrored: bool) -> float:
    """Return the largest difference of residual stress and contact pressure / yield stress."""
    if not other.status.solved:
        return float("inf")
    one = passed.record
    sign = np.array([1.0, 1.0, 1.0, -1.0 if mirrored else 1.0])[:, None]
    profiles = [r.fields["residual_profile"][1] for r in (one, other)]
    pressures = [r.fields["contact_pressure"][1] for r in (one, other)]
    flip = slice(None, None, -1 if mirrored else 1)
    miss = max(
        float(np.abs(profiles[0] - profiles[1] * sign / stress).max()),
        float(np.abs(pressures[0] - pressures[1][:, flip] / stress).max()),
    )
    return miss / passed.parameters.yield_stress
