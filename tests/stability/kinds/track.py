"""Seeded Hertz pressures that are stepped over short tracks: every law, load and direction."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from solver.rolling.scenes.rolling import ROLLING, RollingParameters
from tests.stability.kinds.bearing import bears
from tests.stability.kinds.draws import POISSON, RATIOS, RULES, changed
from tests.stability.kinds.endless_oracle import STEEP, never_yields
from tests.stability.kinds.looked_at import looked_at
from tests.stability.kinds.punch_oracle import law
from tests.stability.trial import Figure, Scene, tells

if TYPE_CHECKING:
    from solver import Record
    from solver.contact.state import Converged
    from solver.results.run import FinishedRun

SHORT = (0, 2)
"""Scenes of the test suite: each takes a way through the solver that the other does not."""
SEED = 1968
LONG = 6.0
"""Ratio of the length of the longest tracks to the Hertz half-width."""


@dataclass(frozen=True, kw_only=True)
class Stepped:
    """The record of a run, and what it was taken from."""

    parameters: RollingParameters
    record: Record
    run: FinishedRun


def parameters_of(number: int, rng: np.random.Generator) -> RollingParameters:
    """Return a pressure about twelve elements wide; rules take turns."""
    rule = RULES[number % 4]
    load = float(np.exp(rng.choice([rng.uniform(-4.6, 0.0), *rng.uniform(0.0, 1.2, 2)])))
    friction = float(rng.choice([0.0, 0.1, 0.3, 1.0]))
    shear = min(0.9 / math.sqrt(3) / load, friction)
    long = bool(rng.random() < 0.25)
    radius, poisson_ratio = 334.92 / load, float(rng.choice(POISSON))
    a = RollingParameters(radius=radius, load_ratio=load, poisson_ratio=poisson_ratio).half_width
    length = LONG if long else float(rng.choice([1.0, 2.5, 4.0]))
    # increments of any length up to the whole half-width
    advance = a / float(rng.choice([1, 2, 4]))
    return RollingParameters(
        load="hertz",
        hardening=rule,
        hardening_ratio=0.0 if rule == "none" else float(rng.choice(RATIOS)),
        isotropic_fraction=float(rng.random()),
        load_ratio=load,
        friction=friction,
        traction=float(rng.uniform(-1, 1)) * shear / friction * 0.99 if friction else 0.0,
        poisson_ratio=poisson_ratio,
        passes=int(rng.choice([1, 1, 2, 3])),
        direction=str(rng.choice(["same", "back_and_forth"])),
        heading=str(rng.choice(["forward", "backward"])),
        radius=radius,
        track=length * a,
        element_size=a / 6,
        growth=1.6,
        advance_step=min(advance, length * a / 2),
        press_steps=int(rng.choice([1, 2, 4])),
        unload_steps=int(rng.choice([1, 2])),
    )


def roll(parameters: RollingParameters) -> Stepped:
    """Run the scene, or raise what ended it."""
    run, record = looked_at(ROLLING, parameters)
    if run.outcome.error is not None:
        raise run.outcome.error
    return Stepped(parameters=parameters, record=record, run=run)


def judge(stepped: Stepped) -> dict[str, Figure]:
    """Return the figures: forces and laws from the states under load and after it."""
    p, record, run = stepped.parameters, stepped.record, stepped.run
    if not record.status.solved:
        return {"audit": Figure(1.0, 0.0)}
    loaded, left = run.loaded, run.unloaded
    way = p.directions[-1] * p.friction * p.traction
    pressed, free = _forces(stepped, loaded)
    at_rest, residual = _forces(stepped, left)
    laws = [law(run.system, "half_space", c) for c in (loaded, left)]
    totals = [run.system.state("half_space", c).plastic.accumulated for c in (loaded, left)]
    yielded = float(totals[1].max())
    return {
        "audit": Figure(0.0, 0.0),
        **{name: Figure(max(each[name] for each in laws), 1e-7) for name in laws[0]},
        "vertical force": Figure(abs(pressed[1] / p.force + 1), STEEP),
        "shear force": Figure(abs(pressed[0] / p.force - way), STEEP),
        "free nodes": Figure(free / p.force, 1e-6),
        "residual": Figure(max(residual, *np.abs(at_rest)) / p.force, 1e-6),
        "plastic strain shrinks": Figure(float((totals[0] - totals[1]).max()), 0.0),
        "elastic": Figure(yielded if never_yields(p) else 0.0, 0.0),
    }


def _forces(stepped: Stepped, converged: Converged) -> tuple[np.ndarray, float]:
    """Return the force (2,) that stress leaves at the surface, and the largest below it [N]."""
    part = stepped.run.system.full("half_space")
    stress = stepped.run.system.state("half_space", converged).stress
    force = part.undeformed.internal_force(stress).reshape(-1, 2)
    x, y = part.X
    edge = 1e-9 * float(np.ptp(x))
    held = np.ones(part.n, dtype=bool)
    held[part.free] = False
    force = np.where(held.reshape(-1, 2), 0.0, force)
    top = y > -edge
    inside = (x > x.min() + edge) & (x < x.max() - edge) & (y > y.min() + edge) & ~top
    return force[top].sum(axis=0), float(np.abs(force[inside]).max())


def scenes(count: int) -> list[Scene]:
    """Return the pressures."""
    rng = np.random.default_rng(SEED)
    made = [parameters_of(number, rng) for number in range(count)]
    return [
        Scene(
            what=changed(p),
            run=partial(roll, p),
            judge=judge,
            safe=math.inf if bears(p) else 0.0,
            honest=None if bears(p) else tells("increment between"),
            in_loads=False,
        )
        for p in made
    ]
