"""Wheels on coarse short tracks: light to heavy loads, coasting to nearly locked or spinning."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np

from solver import LimitLoad, NotConverged, Record, System
from solver.contact.state import Converged, State
from solver.rolling.scenes.rolling import ROLLING, RollingParameters
from tests.stability.kinds.bearing import BORNE, NEAR
from tests.stability.kinds.draws import changed
from tests.stability.kinds.looked_at import looked_at
from tests.stability.kinds.punch_oracle import law
from tests.stability.trial import Figure, Scene, tells

SHORT = (0, 9, 11, 12, 13)
"""Scenes of the test suite: every traction, every rule, three loads."""
SEED = 1882
LOADS = (0.5, 1.0, 2.0, 4.0, 10.0)
TRACTIONS = (-0.99, -0.75, 0.0, 0.75, 0.99)
FRICTION = (0.1, 0.3, 0.5)
RULES = ("none", "isotropic", "kinematic")
WIDTHS = 2.5
"""Length of the track over the Hertz half-width."""

HEAVY = 4.0
"""Loads from which the contact may spread beyond the fine rim, which must then be told."""

SOFTEST = 6.0
"""Largest load without hardening: beyond it strains pass 100 %, and a wheel on eight points of
contact digs a furrow that no figure here can judge."""


KNOWN = (61, 64)
"""Wheels near or beyond the traction that an ideal surface bears, on a mesh too coarse to tell:
plastic strain is 14 and 260 %, half the element side makes 47 % of the one and a limit load of the
other. The moment that pressure has on such a furrow is not that of small strains."""


@dataclass(frozen=True, kw_only=True)
class Rolled:
    """The record of a run, and what it was taken from."""

    parameters: RollingParameters
    record: Record
    system: System
    loaded: Converged
    unloaded: Converged


def parameters_of(number: int, rng: np.random.Generator) -> RollingParameters:
    """Return a wheel whose contact is about eight elements wide."""
    cases = list(product(LOADS, TRACTIONS))
    load, traction = cases[number % len(cases)]
    friction = float(rng.choice(FRICTION)) if traction else float(rng.choice([0.0, *FRICTION]))
    rule = RULES[(number + number // len(cases)) % 3]
    load = min(load, SOFTEST) if rule == "none" else load
    given = {
        "load_ratio": load,
        "traction": traction,
        "friction": friction,
        "hardening": rule,
        "hardening_ratio": 0.0 if rule == "none" else float(rng.choice([0.01, 0.1])),
    }
    # the half-width grows with load and radius: one track for all
    radius = 334.92 / load
    a = RollingParameters(radius=radius, load_ratio=load).half_width
    return RollingParameters(
        radius=radius,
        track=WIDTHS * a,
        element_size=a / 4,
        growth=1.5,
        advance_step=WIDTHS * a / 10,
        press_steps=4,
        unload_steps=2,
        **given,
    )


def roll(parameters: RollingParameters) -> Rolled:
    """Run the scene, or raise what ended it."""
    look, record = looked_at(ROLLING, parameters)
    outcome = look.outcome
    if outcome.error is not None:
        raise _judged(parameters, look.system, outcome.error, outcome.last.state)
    return Rolled(
        parameters=parameters,
        record=record,
        system=look.system,
        loaded=look.loaded,
        unloaded=look.unloaded,
    )


def _judged(
    parameters: RollingParameters, system: System, error: NotConverged, last: State
) -> NotConverged:
    """Return the error, told as a `LimitLoad` only where no equilibrium is proven to exist.

    The mechanism of a driven wheel is a thin layer under the contact, as wide as it is, that
    shears: without hardening it bears k times that width (upper bound theorem), and no more
    traction. Pressed alone, a wheel sinks until the contact is wide enough. A limit of a body
    that hardens is false, and left as it is.
    """
    p = parameters
    if not isinstance(error, LimitLoad) or p.hardening != "none":
        return error
    surface = system.interfaces[0].slave_surface
    x = surface.X[0, surface.vertices][last.contacts[0].normal > 0]
    width = float(np.ptp(x)) + p.element_size if len(x) else 0.0
    driven = min(max(error.attempted - 1.0, 0.0), 1.0)
    shear = abs(p.traction) * p.friction * p.force * driven
    borne = p.yield_stress / math.sqrt(3) * width
    if shear > borne:
        return error
    text = f"{error} [traction {shear:.4g} N, a contact {width:.3g} mm wide bears {borne:.4g} N]"
    return NotConverged(text, error.reached, error.attempted)


def judge(rolled: Rolled) -> dict[str, Figure]:
    """Return the figures: resultants from the record, laws from what it was taken from.

    The record samples a piecewise linear pressure at eight points a millimetre: its integral
    lacks what the kinks at the vertices make, about (spacing / element)^2 of it. Pressure acts
    along normals that lean by up to the half-width of the contact over the wheel's radius: it is
    larger than the force by up to half the square of that.
    """
    p, record = rolled.parameters, rolled.record
    force = p.force
    way = p.directions[-1] * p.traction * p.friction * force
    figures = {"audit": Figure(float(not record.status.solved), 0.0)}
    if not record.status.solved:
        return figures
    stages = list(record.coordinates["stage"])
    s = record.coordinates["s"]
    near = 0.02 + (s[1] - s[0]) ** 2 / p.element_size**2
    for stage in ("loaded", "mid_track"):
        at = stages.index(stage)
        pressure, shear = (
            np.nan_to_num(record.fields[name][1][at])
            for name in ("contact_pressure", "contact_shear")
        )
        figures |= {
            f"pressure {stage}": Figure(
                abs(np.trapezoid(pressure, s) / force - 1), near + _leaning(s[pressure > 0], p)
            ),
            f"cone {stage}": Figure(
                float((np.abs(shear) - p.friction * pressure).max() / pressure.max()), 1e-6
            ),
            f"tension {stage}": Figure(-float(pressure.min()) / pressure.max(), 1e-9),
        }
        if p.control == "moment":  # with the creepage given, the force follows
            off = abs(np.trapezoid(shear, s) - way) / force
            figures[f"shear {stage}"] = Figure(off, near)
        touching = s[pressure > 0]
        if stage == "loaded":  # at the end of the way, and the fine rim ends a margin beyond it
            beyond = float(np.abs(touching).max()) - p.margin
            figures["beyond the rim loaded"] = Figure(beyond, 0.0)
    if p.control == "moment":
        # pressure off the middle turns the wheel as well: P e in R F, and e is within the contact
        longitudinal = abs(record.scalars["longitudinal_force"] - way)
        figures["longitudinal force"] = Figure(longitudinal / force, p.half_width / p.radius)
    return figures | _laws(rolled) | _wheel(rolled)


def _leaning(touching: np.ndarray, p: RollingParameters) -> float:
    """Return how much more than the force the normal forces of a sunk wheel may be, as a share."""
    return float(np.ptp(touching) / 2 / p.radius) ** 2 / 2


def judge_known(rolled: Rolled) -> dict[str, Figure]:
    """Return the figures but that of the moment, which small strains do not tell."""
    return {name: figure for name, figure in judge(rolled).items() if name != "moment"}


def _wheel(rolled: Rolled) -> dict[str, Figure]:
    """Return figures of the wheel's balance, from the stress in the track.

    What the stress leaves at the nodes of the surface is the contact force on them. Friction alone
    turns the wheel in the solver, on the arm of its rim; here pressure has its moment too. The two
    are one in the continuum; on about eight points of contact the middle of the pressure is known
    to some hundredths of the half-width.
    """
    p, loaded = rolled.parameters, rolled.loaded
    system = rolled.system
    track = system.full("half_space")
    nodes = track.boundary_nodes("top")
    left = track.undeformed.internal_force(system.state("half_space", loaded).stress)
    force = left.reshape(-1, 2)[nodes].T
    u = system.displacement("half_space", loaded.state).reshape(-1, 2)[nodes].T
    hub = np.array([0.0, p.radius]) + loaded.state.u[0][-3:-1]
    arm = track.X[:, nodes] + u - hub[:, None]
    turning = -float((arm[0] * force[1] - arm[1] * force[0]).sum())
    figures = {"vertical force": Figure(abs(float(force[1].sum()) / p.force + 1), 1e-7)}
    if p.friction and p.traction and not p.guided:
        wanted = p.directions[-1] * p.radius * p.traction * p.friction * p.force
        miss = abs(turning + wanted) / (p.radius * p.force)
        figures["moment"] = Figure(miss, 0.02 * p.half_width / p.radius)
    return figures


def _laws(rolled: Rolled) -> dict[str, Figure]:
    loaded, unloaded, system = rolled.loaded, rolled.unloaded, rolled.system
    (contact,) = loaded.state.contacts
    N, T = contact.normal, contact.tangential
    surface, p = system.interfaces[0].slave_surface, rolled.parameters
    touching = np.abs(surface.X[0, surface.vertices])[N > 0]
    laws = [law(system, "half_space", c) for c in (loaded, unloaded)]
    first, last = (system.state("half_space", c).plastic.accumulated for c in (loaded, unloaded))
    largest = max(float(last.max()), 1e-12)
    return {
        **{k: Figure(max(found[k] for found in laws), 1e-7) for k in laws[0]},
        # the last vertex of the fine track must be open
        "beyond the rim mid_track": Figure(
            float(touching.max()) + p.element_size / 2 - p.track / 2 - p.margin, 0.0
        ),
        "force cone": Figure(float((np.abs(T) - p.friction * N).max() / N.sum()), 1e-6),
        "force tension": Figure(-float(N.min()) / float(N.sum()), 0.0),
        "plastic strain shrinks": Figure(float((first - last).max()) / largest, 1e-12),
        "left over": Figure(
            float(max(np.abs(c.normal).max() for c in unloaded.state.contacts)), 0.0
        ),
    }


off_the_rim = tells("contact", "rim|fine track|beyond")
given_up = tells("(increment|equilibrium) between")


def _honest(p: RollingParameters) -> Callable[[str], bool] | None:
    """Return how a wheel may end without an answer."""
    ways = [off_the_rim] if p.load_ratio >= HEAVY else []
    if p.hardening == "none" and abs(p.traction) * p.friction > NEAR * BORNE:
        ways.append(given_up)
    return (lambda text: any(way(text) for way in ways)) if ways else None


def scenes(count: int) -> list[Scene]:
    """Return the wheels."""
    rng = np.random.default_rng(SEED)
    made = [parameters_of(number, rng) for number in range(count)]
    return [
        Scene(
            what=changed(p),
            run=partial(roll, p),
            judge=judge_known if number in KNOWN else judge,
            refusal=off_the_rim if p.load_ratio >= HEAVY else None,
            honest=_honest(p),
            safe=math.inf if p.hardening != "none" else 0.0,
            in_loads=False,
        )
        for number, p in enumerate(made)
    ]
