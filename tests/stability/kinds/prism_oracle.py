"""What passes over a prism must satisfy, computed again from what is recorded of them.

From the solver come the record, the tractions of the contact at its places, and stress, plastic
strain and displacement of the section. After a pass nothing depends on x: the prism keeps its
length and stays straight, so that Hooke's law gives the stress along it; across it, stress does no
work on displacements that are linear in y and z but for what the foundation takes. Every figure is
0 for a perfect answer.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from solver.rolling.scenes.wheel_rail import WheelRailParameters
from solver.rolling.scenes.wheel_rail_contact import wheel_profile
from tests.stability.trial import Figure

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver import Record
    from solver.results.run import FinishedRun

    Array = NDArray[np.float64]

XX, YY, ZZ, XY, YZ, ZX = range(6)
S2 = math.sqrt(2.0)
_FOOT = 150.0
"""Width of the foot of 60E1 [mm]."""

LIMITS = {
    "vertical": 1e-6,  # resultants over the load
    "lateral": 1e-6,
    "drive": 2e-3,  # moment on the axle: it is taken about the undeformed wheel's circles
    "told forces": 1e-9,  # of the record against those of the tractions
    "pressure map": 0.03,  # integrals of the maps, which lie on other places
    "shear map": 0.03,
    "tension": 1e-9,
    "cone": 1e-6,
    "locked": 1e-6,
    "along": 1e-9,  # residual stress against Hooke's law of a straight prism, over the yield stress
    "initial": 0.02,  # the same against the given stress, where the foundation is soft
    "linear work": 1e-8,  # of residual stress over yield stress times area
    "yield loaded": 5e-4,  # a pass is found within 1.3e-4
    "yield left": 1.3e-4,  # 2 G times what is left over of a deviator, 1e-4 of the yield stress
    "volume": 1e-10,
    "path": 1e-9,
    "grows": 0.0,  # whether plastic strain falls from pass to pass
    "elastic": 0.0,  # plastic strain far below the load that makes any
    "hertz": 0.06,  # peak pressure of an elastic contact on four elements
    "symmetric": 1e-5,  # of a raceway, in z
    "other": 1e-5,  # difference of what must be equal, over the yield stress
    "other steps": 1e-4,  # the tolerance of a pass, where one took more steps of Newton's method
}


@dataclass(frozen=True, kw_only=True)
class Rolled:
    """A run, and the record of another that must be equal, mirrored, or in other units."""

    parameters: Any
    record: Record
    run: FinishedRun
    other: Record | None = None
    mirrored: bool = False
    stresses: float = 1.0


def judge(rolled: Rolled) -> dict[str, Figure]:
    """Return the figures that the scene has."""
    if not rolled.record.status.solved:
        return {"audit": Figure(1.0, 0.0)}
    own = rolled.parameters
    if isinstance(own, WheelRailParameters):
        own = own.each_pass()[-1]
    found = {
        "audit": 0.0,
        **_resultants(rolled, own),
        **_maps(rolled),
        **_left(rolled),
        **_law(rolled),
        **_passes(rolled, own),
        **_same(rolled),
    }
    return {name: Figure(value, LIMITS.get(name, 0.0)) for name, value in found.items()}


# -- the contact -----------------------------------------------------------------------------------


def _resultants(rolled: Rolled, own: Any) -> dict[str, float]:
    """Return how far tractions are from the load, and from the friction cone."""
    contact: Any = rolled.run.loaded.touching
    grid, traction, told = contact.grid, contact.traction, rolled.record.scalars
    length = np.hypot(np.diff(grid.z), np.diff(grid.y))
    area = grid.spacing * (np.append(length, 0.0) + np.append(0.0, length)) / 2
    force = np.einsum("cja,j->a", traction, area)
    cos, sin = np.cos(grid.angle), np.sin(grid.angle)
    pressure = -(cos * traction[..., 1] - sin * traction[..., 2])
    across = sin * traction[..., 1] + cos * traction[..., 2]
    shear = np.hypot(traction[..., 0], across)
    peak = float(pressure.max())
    load = _load(own)
    bound = own.friction * pressure
    found = {
        "told forces": max(
            abs(force[0] - told["longitudinal_force"]),
            abs(force[2] - told["lateral_force"]),
            abs(peak - told["peak_patch_pressure"]) * load / peak,
        )
        / load,
        "tension": -float(pressure.min()) / peak,
        "cone": float((shear - bound).max()) / peak,
    }
    if own.load == "hertz":
        # a given pressure is the sum of hats nearest to it, which swings at its edge, in samples
        # along, which are means less a 24th of their second difference: not these samples, but
        # what their means do on each hat, is a push; shear is in proportion
        n = len(pressure)
        means = np.linalg.solve(
            np.eye(n) - np.diff(np.eye(n + 2), 2, axis=0)[:, 1:-1] / 24, pressure
        )
        first = (2 * means[:, :-1] + means[:, 1:]) * length / 6
        second = (means[:, :-1] + 2 * means[:, 1:]) * length / 6
        pushed = np.pad(first, ((0, 0), (0, 1))) + np.pad(second, ((0, 0), (1, 0)))
        found["tension"] = -float(pushed.min()) / (peak * float(length.mean()))
        bound = abs(own.traction) * own.friction * np.abs(pressure)
        found["cone"] = float(np.abs(shear - bound).max()) / peak
        found["vertical"] = abs(float((pressure @ area).sum()) / load - 1)
        wanted = own.traction * own.friction * load
        found["drive"] = abs(float((traction[..., 0] @ area).sum()) - wanted) / load
        return found
    found["vertical"] = abs(float(force[1]) / load + 1)
    if getattr(own, "lateral_control", "") == "force":
        found["lateral"] = abs(float(force[2]) - own.given_lateral_force) / load
    if own.traction == 1.0:  # all of it slips
        closed = contact.status != 0
        found["locked"] = float(np.abs(shear - bound)[closed].max()) / peak
    elif own.control == "moment":
        found["drive"] = _missing_moment(own, grid, traction, area, load)
    return found


def _load(own: Any) -> float:
    """Return the vertical force [N]; of a raceway that of Hertz."""
    return float(own.load if isinstance(own, WheelRailParameters) else own.ellipse.force)


def _missing_moment(own: Any, grid: Any, traction: Array, area: Array, load: float) -> float:
    """Return the part of the moment on the axle that is missing, over load times radius.

    A circle of the wheel at the height h of its profile has the arm R - h; yaw turns the shear.
    """
    if isinstance(own, WheelRailParameters):
        R, height = own.wheel_radius, wheel_profile(own).height(grid.z - own.lateral_position)
        yaw = own.yaw
    else:
        R, yaw = own.radius, 0.0
        height = own.across - np.sqrt(np.clip(own.across**2 - grid.z**2, 0.0, None))
    height = np.where(np.isfinite(height), height, 0.0)
    # the contact of a yawed wheel is ahead of its axle
    along = math.cos(yaw) * traction[..., 0] - math.sin(yaw) * traction[..., 2]
    moment = float((along @ (area * (1 - height / R))).sum())
    missing = abs(moment - own.traction * own.friction * load) / load
    return max(0.0, missing - own.friction * abs(yaw))


def _maps(rolled: Rolled) -> dict[str, float]:
    """Return how far integrals of the recorded maps are from the forces, where they hold all."""
    record, contact = rolled.record, rolled.run.loaded.touching
    assert contact is not None
    grid = contact.grid
    x, z = record.coordinates["x"], record.coordinates["z"]
    closed = contact.status != 0
    inside = abs(grid.x[closed.any(axis=1)]).max() + grid.spacing < x.max()
    inside &= abs(grid.z[closed.any(axis=0)]).max() + np.diff(grid.z).max() < z.max()
    if not inside:
        return {}
    pressure, along, across = (
        record.fields[f"patch_{name}"][1] for name in ("pressure", "shear_x", "shear_z")
    )
    angle = np.interp(z, grid.z, grid.angle)

    def integral(values: Array) -> float:
        return float(np.trapezoid(np.trapezoid(values / np.cos(angle), z, axis=1), x))

    load = _load(rolled.parameters)
    if isinstance(rolled.parameters, WheelRailParameters):
        load = rolled.parameters.each_pass()[-1].load
    vertical = integral(pressure * np.cos(angle) - across * np.sin(angle))
    if rolled.parameters.load == "hertz":
        vertical = integral(pressure)
    told = record.scalars["longitudinal_force"]
    return {
        "pressure map": abs(vertical / load - 1),
        "shear map": abs(integral(along) - told) / load,
    }


# -- the section after the passes ------------------------------------------------------------------


def _left(rolled: Rolled) -> dict[str, float]:
    """Return how far the residual stress is from one of a straight prism in equilibrium."""
    p, run = rolled.parameters, rolled.run
    part = run.system.full(run.view.profile_body)
    stage: Any = run.unloaded
    stress, ep = stage.state.stress, stage.state.plastic.plastic_strain
    w = part.weights.ravel()
    _, y, z = part.points
    E, nu = p.youngs_modulus, p.poisson_ratio
    size = max(p.yield_stress, E * float(np.abs(ep).max()))
    along = stress[XX] - nu * (stress[YY] + stress[ZZ]) + E * ep[XX]
    found = {}
    if isinstance(p, WheelRailParameters):
        along = along + E * p.thermal_strain
        given = _given_stress(p, z, y, w)
        if given is not None:
            plain = np.stack([np.ones_like(y), y, z])
            off = along - given
            if p.foundation <= 100:
                found["initial"] = float(np.abs(off).max() / np.abs(given).max())
            along = off - _fitted(off, plain, w) @ plain
    found["along"] = float(np.abs(along).max()) / size
    initial = isinstance(p, WheelRailParameters) and (
        p.initial_stress != "none" or p.thermal_strain != 0
    )
    if not initial:
        found["linear work"] = _work(rolled, stress, w) / (size * float(w.sum()))
    return found


def _fitted(values: Array, plain: Array, w: Array) -> Array:
    return np.asarray(np.linalg.solve((plain * w) @ plain.T, (plain * w) @ values))


def _given_stress(p: WheelRailParameters, z: Array, y: Array, w: Array) -> Array | None:
    """Return the given stress xx without its force and moments [MPa]."""
    plain = np.stack([np.ones_like(y), y, z])
    if p.initial_stress == "none":
        return None
    if p.initial_stress == "over_height":
        at, values = np.array(p.stress_over_height).T
        given = np.interp(y, at, values)
        return np.asarray(given - _fitted(given, plain, w) @ plain)
    shares = _fitted(y**2, plain, w)
    return np.asarray(p.straightening_stress * (shares @ plain - y**2) / shares[0])


def _work(rolled: Rolled, stress: Array, w: Array) -> float:
    """Return the largest work on displacements 1, y and z along each axis [N/mm mm].

    A raceway is held at its foot, where these must be 0.
    """
    run, p = rolled.run, rolled.parameters
    part = run.system.full(run.view.profile_body)
    foot = part.boundary_nodes("foot")
    _, y, z = part.X[:, foot]
    down, up = {0: XY, 1: YY, 2: YZ}, {0: ZX, 1: YZ, 2: ZZ}
    root = [1.0, 1.0, 1.0, S2, S2, S2]
    by_y = np.array([stress[down[a]] @ w / root[down[a]] for a in range(3)])
    by_z = np.array([stress[up[a]] @ w / root[up[a]] for a in range(3)])
    if not isinstance(p, WheelRailParameters):
        return float(np.abs(by_y).max())
    u = run.unloaded.state.u.reshape(-1, 3)[foot]
    order = np.argsort(z)
    u, y, z = u[order], y[order], z[order]
    length = np.hypot(np.diff(z[::2]), np.diff(y[::2]))
    weight = np.zeros(len(z))  # of Simpson's rule
    for at, share in ((0, 1 / 6), (1, 4 / 6), (2, 1 / 6)):
        np.add.at(weight, np.arange(len(length)) * 2 + at, share * length)
    spring = p.foundation / _FOOT * weight
    worst = 0.0
    for axis in range(3):
        taken = [float(spring * v @ u[:, axis]) for v in (np.ones_like(y), y, z)]
        each = taken[0], taken[1] + by_y[axis], taken[2] + by_z[axis]
        worst = max(worst, *map(abs, each))
    return worst


def _law(rolled: Rolled) -> dict[str, float]:
    """Return how far stress is beyond yielding, and plastic strain from what can flow."""
    p, run = rolled.parameters, rolled.run
    found: dict[str, float] = {}
    stages: tuple[tuple[str, Any], ...] = (
        ("yield loaded", run.loaded),
        ("yield left", run.unloaded),
    )
    for name, stage in stages:
        state = stage.state
        zone = np.isfinite(state.stress).all(axis=0)
        stress, ep = state.stress[:, zone], state.plastic.plastic_strain[:, zone]
        total = state.plastic.accumulated[zone]
        beyond = float(beyond_yield(p, stress, ep, total).max()) / p.yield_stress
        found[name] = max(0.0, beyond)
        largest = max(float(np.abs(ep).max()), 1e-300)
        length = np.sqrt(2 / 3 * (ep**2).sum(axis=0))
        # Tresca's path is that of another work: up to 2/sqrt(3) times as long
        more = 2 / math.sqrt(3) if p.yield_condition == "tresca" else 1.0
        for key, value in (
            ("volume", np.abs(ep[:3].sum(axis=0)).max()),
            ("path", max(0.0, float((length - more * total).max()))),
        ):
            found[key] = max(found.get(key, 0.0), float(value) / largest)
    return found


def beyond_yield(p: Any, stress: Array, ep: Array, total: Array) -> Array:
    """Return by how much stress (6, n) is beyond the largest that the law can have (n,) [MPa]."""
    rule, ratio = p.hardening, getattr(p, "hardening_ratio", 0.0)
    modulus = p.youngs_modulus * ratio / (1 - ratio)
    isotropic = {"isotropic": 1.0, "mixed": p.isotropic_fraction}.get(rule, 0.0)
    kinematic = {"kinematic": 1.0, "mixed": 1 - p.isotropic_fraction}.get(rule, 0.0)
    relative = stress - 2 / 3 * kinematic * modulus * ep
    strength = p.yield_stress + isotropic * modulus * total
    if rule in ("voce", "chaboche"):
        strength = strength + p.saturation * -np.expm1(-p.saturation_rate * total)
    if rule == "chaboche":  # a back stress is below C / gamma, and below C times the path
        for c, recall in p.back_stresses:
            strength = strength + c * (
                total if recall == 0 else -np.expm1(-recall * total) / recall
            )
    if rule == "table":
        strength = np.interp(total, *np.array(p.curve).T)
    if rule == "layered":
        strength = strength * 0 + p.curve[-1][1]
    if p.yield_condition == "tresca":
        full = np.zeros((stress.shape[1], 3, 3))
        for k in range(3):
            full[:, k, k] = relative[k]
        for k, (i, j) in ((XY, (0, 1)), (YZ, (1, 2)), (ZX, (2, 0))):
            full[:, i, j] = full[:, j, i] = relative[k] / S2
        return np.asarray(np.ptp(np.linalg.eigvalsh(full), axis=1) - strength)
    relative[:3] -= relative[:3].mean(axis=0)
    return np.asarray(np.sqrt(1.5 * (relative**2).sum(axis=0)) - strength)


# -- passes, closed forms and other scenes ---------------------------------------------------------


def _passes(rolled: Rolled, own: Any) -> dict[str, float]:
    """Return whether plastic strain falls, and how far an elastic contact is from Hertz's."""
    p, record = rolled.parameters, rolled.record
    largest = record.fields["pass_max_plastic_strain"][1]
    added = record.fields["pass_plastic_increment"][1]
    found = {"grows": max(0.0, -float(added.min()), -float(np.diff(largest).min(initial=0.0)))}
    raceway = not isinstance(p, WheelRailParameters)
    pressed = record.scalars["peak_patch_pressure"]
    # at most p0 without shear, (2 + sqrt(3)) mu p0 more with it; see the oracle of endless passes
    guided = own.load != "hertz"
    sheared = own.friction * (1.0 if guided else abs(own.traction))
    alone = raceway or not (p.sequence or p.scattered or p.initial_stress != "none")
    alone &= raceway or p.thermal_strain == 0.0
    if alone and pressed * (1 + (2 + math.sqrt(3)) * sheared) < 0.8 * p.yield_stress:
        found["elastic"] = record.scalars["max_plastic_strain"]
    if raceway and record.scalars["max_plastic_strain"] == 0.0:
        found["hertz"] = abs(pressed / record.scalars["hertz_pressure"] - 1)
    if raceway and not p.lateral_creepage:
        found["symmetric"] = _apart(p, record, record, mirrored=True)
    return found


def _same(rolled: Rolled) -> dict[str, float]:
    """Return how far the other scene is from this one."""
    if rolled.other is None:
        return {}
    off = _apart(
        rolled.parameters, rolled.record, rolled.other, rolled.stresses, mirrored=rolled.mirrored
    )
    one, other = (each.scalars["iterations"] for each in (rolled.record, rolled.other))
    return {"other" if one == other else "other steps": off}


def _apart(p: Any, one: Record, other: Record, stress: float = 1.0, *, mirrored: bool) -> float:
    """Return the largest difference of residual stress and tractions, over the yield stress."""
    if not other.status.solved:
        return math.inf
    sign = np.array([1.0, 1.0, 1.0, 1.0, -1.0, -1.0] if mirrored else [1.0] * 6)
    flip = slice(None, None, -1 if mirrored else 1)
    surface = [r.fields["running_surface_residual"][1] for r in (one, other)]
    off = [surface[0] - surface[1][:, flip] * sign[:, None] / stress]
    for name, turned in (("pressure", 1.0), ("shear_x", 1.0), ("shear_z", sign[YZ])):
        maps = [r.fields[f"patch_{name}"][1] for r in (one, other)]
        off.append(maps[0] - maps[1][:, flip] * turned / stress)
    return max(float(np.nanmax(np.abs(each))) for each in off) / p.yield_stress
