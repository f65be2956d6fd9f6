"""Seeded steady passes: every load, law and traffic over a coarse track without ends."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from solver import NotConverged, Status
from solver.rolling.scenes.rolling import ROLLING, RollingParameters
from tests.stability.kinds import rolling, track
from tests.stability.kinds.bearing import bears, flows_ahead
from tests.stability.kinds.draws import POISSON, RATIOS, RULES, changed
from tests.stability.kinds.endless_oracle import Passed, judge
from tests.stability.kinds.looked_at import looked_at
from tests.stability.trial import Figure, Scene, tells

SHORT = (0, 1, 3, 4, 5, 7)
"""Scenes of the test suite: every rule, under a wheel and under a given pressure."""
SEED = 1926
LOADS = ((0.01, 1.0), (1.0, 2.0), (2.0, 3.0), (3.0, 4.5))
TRACTIONS = (-0.95, -0.5, 0.0, 0.3, 0.75, 0.95)
PASSES = (1, 1, 1, 2, 2, 3, 5, 10, 50)
RADIUS = 33.492
SLOPE = 0.2
"""Largest half-width / radius: a softer wheel is no wheel any more."""
MIRRORED, SCALED = 6, 5
"""One scene in so many is also run the other way, and in other units."""
LENGTHS, STRESSES = 10.0, 7.0

given_up = tells(
    "increment between|no steady pass|window is too small|contact forces|rim|surface|^audit"
)


def parameters_of(number: int, rng: np.random.Generator) -> RollingParameters:
    """Return passes on elements of a fifth of the half-width; rules and loads take turns."""
    load = ("contact", "hertz")[number % 2]
    rule = RULES[number // 2 % 4]
    low, high = LOADS[rng.choice(4, p=[0.15, 0.25, 0.35, 0.25])]
    friction = float(rng.choice([0.0, 0.05, 0.1, 0.3, 0.5, 1.0]))
    given: dict[str, Any] = {
        "load": load,
        "hardening": rule,
        "hardening_ratio": 0.0 if rule == "none" else float(rng.choice(RATIOS)),
        "isotropic_fraction": float(rng.random()),
        "load_ratio": float(np.exp(rng.uniform(np.log(low), np.log(high)))),
        "friction": friction,
        "traction": float(rng.choice(TRACTIONS)) if friction else 0.0,
        "poisson_ratio": float(rng.choice(POISSON)),
        "passes": int(rng.choice(PASSES)),
        "direction": str(rng.choice(["same", "same", "back_and_forth"])),
        "heading": str(rng.choice(["forward", "forward", "backward"])),
        "until": str(rng.choice(["passes", "passes", "decided"])),
    }
    if load == "contact":
        given |= _wheel(rng, friction)
    if given["passes"] > 1 and rng.random() < 0.25:
        given["sequence"] = _traffic(rng, given)
    return _meshed(given, float(rng.choice([1.3, 1.5, 1.8])))


def _wheel(rng: np.random.Generator, friction: float) -> dict[str, Any]:
    """Return what only a wheel has."""
    stiffness, shear_limit, kind = rng.uniform(-3, 3), rng.uniform(0.3, 1.2), rng.random()
    given: dict[str, Any] = {}
    if kind < 0.3:
        given["wheel_stiffness"] = float(10**stiffness)
    if 0.3 < kind < 0.45:
        given["shear_limit"] = float(shear_limit)
    if kind > 0.8 and friction:
        creepage = rng.choice([-1, 1]) * 10 ** rng.uniform(-5, -1.5)
        given |= {"control": "creepage", "given_creepage": float(creepage), "traction": 0.0}
    elif kind > 0.75 and friction:
        given["traction"] = 1.0
    return given


def _traffic(rng: np.random.Generator, given: dict[str, Any]) -> tuple[dict[str, Any], ...]:
    """Return two or three loads that take turns."""
    block = []
    for _ in range(int(rng.choice([2, 3]))):
        own: dict[str, Any] = {
            "load_ratio": given["load_ratio"] * float(rng.uniform(0.6, 1.0)),
            "heading": str(rng.choice(["forward", "backward"])),
            "times": int(rng.choice([1, 2])),
        }
        if given["traction"]:
            own["traction"] = float(rng.choice(TRACTIONS))
        block.append(own)
    return tuple(block)


def _meshed(given: dict[str, Any], growth: float) -> RollingParameters:
    """Return the parameters with elements of a fifth of the half-width 2 R p0 / E*."""
    usual = RollingParameters()
    modulus = usual.youngs_modulus / (1 - given["poisson_ratio"] ** 2)
    peak = given["load_ratio"] * usual.yield_stress
    if "wheel_stiffness" in given:
        softest = 1 / max(SLOPE * modulus / (2 * peak) - 1, 1e-3)
        given["wheel_stiffness"] = max(given["wheel_stiffness"], softest)
    modulus /= 1 + 1 / given.get("wheel_stiffness", 1.0)
    a = 2 * RADIUS * peak / modulus
    return RollingParameters(**given, radius=RADIUS, growth=growth, element_size=a / 5)


def mirror_of(parameters: RollingParameters) -> RollingParameters:
    """Return the same passes, all going the other way."""

    def turned(heading: str) -> str:
        return "backward" if heading == "forward" else "forward"

    usual = parameters.heading
    block = [dict(own) for own in parameters.sequence]
    for own in block:
        own["heading"] = turned(str(own.get("heading", usual)))
    return replace(parameters, heading=turned(usual), sequence=tuple(block))


def in_units(parameters: RollingParameters) -> RollingParameters:
    """Return the same passes in other units of length and stress."""
    p = parameters
    return replace(
        p,
        radius=p.radius * LENGTHS,
        element_size=p.element_size * LENGTHS,
        yield_stress=p.yield_stress * STRESSES,
        youngs_modulus=p.youngs_modulus * STRESSES,
    )


def roll(parameters: RollingParameters, *, mirror: bool = False, scale: bool = False) -> Passed:
    """Run the passes, or raise what ended them.

    Those rolled by increments on a short track take minutes, and are not compared with others.
    """
    run, record = looked_at(ROLLING, parameters)
    if run.outcome.error is not None:
        raise run.outcome.error
    if record.status is Status.AUDIT_FAILED and not bears(parameters):
        raise NotConverged(f"audit: {record.message}")
    steady = run.parameters.endless
    return Passed(
        parameters=parameters,
        record=record,
        run=run,
        mirrored=looked_at(ROLLING, mirror_of(parameters))[1] if mirror and steady else None,
        scaled=looked_at(ROLLING, in_units(parameters))[1] if scale and steady else None,
        stresses=STRESSES,
    )


def judged(passed: Passed) -> dict[str, Figure]:
    """Return the figures; where no steady pass was found, those of a stepped track."""
    run = passed.run
    given = {"parameters": run.parameters, "record": passed.record}
    if run.parameters.endless:
        return judge(passed)
    if run.parameters.load == "hertz":
        return track.judge(track.Stepped(**given, run=run))
    rolled = rolling.Rolled(**given, system=run.system, loaded=run.loaded, unloaded=run.unloaded)
    beyond = "small-strain" in passed.record.message  # the wheel leans on what it has pushed up
    return rolling.judge_known(rolled) if beyond else rolling.judge(rolled)


def _honest(p: RollingParameters) -> Callable[[str], bool] | None:
    """Return how passes may end without an answer."""
    return None if bears(p) and not flows_ahead(p) else given_up


def scenes(count: int) -> list[Scene]:
    """Return the passes."""
    rng = np.random.default_rng(SEED)
    made = [parameters_of(number, rng) for number in range(count)]
    return [
        Scene(
            what=changed(p),
            run=partial(roll, p, mirror=k % MIRRORED == 0, scale=k % SCALED == 0),
            judge=judged,
            safe=math.inf if bears(p) else 0.0,
            honest=_honest(p),
            in_loads=False,
        )
        for k, p in enumerate(made)
    ]
