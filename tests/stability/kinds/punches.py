"""Seeded extreme punches: every parameter is drawn from its ends as well as from between them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from solver import Outcome, Record, System
from solver.scenes.punch import PUNCH, PunchParameters
from tests.stability.kinds.collapse import BLOCK_SIZE, PUNCH_HEIGHT, collapse
from tests.stability.kinds.draws import changed
from tests.stability.kinds.looked_at import looked_at
from tests.stability.kinds.punch_oracle import LIMITS, judge
from tests.stability.trial import Figure, Scene, tells

SHORT = (5, 7, 10, 14, 15, 18, 21, 23, 24, 25, 28, 32, 33, 38)
"""Scenes of the test suite: every state with every rule, and every extreme."""
SEED = 1995
STATES = ("plane_stress", "plane_strain", "axisymmetric")
HARDENING = ("none", "isotropic", "kinematic", "mixed")
MESH_ALLOWANCE = 1.01
"""Coarse meshes were seen to carry up to 0.6 % more than the exact collapse load."""
LOCKING = ("tri3",)
"""Linear triangles lock in isochoric flow: how much they carry has no bound."""
ELEMENTS = ("quad8", "quad8", "quad8", "quad9", "quad8", "quad4", "quad8", "tri6", "quad8", "tri3")


def _from_ends_or_between(rng: np.random.Generator, low: float, high: float) -> float:
    """Return either end, each one time in four, or a number between them."""
    return float(rng.choice([low, high, *rng.uniform(low, high, 2)]))


def _load_ratio(rng: np.random.Generator, limit: float, hardens: bool) -> float:
    """Return a load far below, below, next to or beyond what carries it without hardening."""
    draws = (
        partial(rng.uniform, np.log(0.01), np.log(0.3)),
        partial(rng.uniform, np.log(0.3), np.log(0.97 * limit)),
        partial(rng.uniform, np.log(0.97 * limit), np.log(1.03 * limit)),
        partial(rng.uniform, np.log(1.03 * limit), np.log(max(1.3 * limit, 2.0 * hardens))),
    )
    return float(np.exp(draws[rng.choice(4, p=[0.15, 0.4, 0.2, 0.25])]()))


def extreme_scenes(count: int, seed: int = SEED) -> list[PunchParameters]:
    """Return ``count`` punches on coarse meshes; states, rules and elements take turns."""
    rng = np.random.default_rng(seed)
    scenes = []
    for number in range(count):
        state, hardening = STATES[number % 3], HARDENING[number // 3 % 4]
        hardening_ratio = _from_ends_or_between(rng, 0.0, 0.5)
        elastic_punch = bool(rng.random() < 0.2)
        hardens = hardening != "none" and hardening_ratio > 0
        limit = collapse(state, elastic_punch=elastic_punch).certain
        scenes.append(
            PunchParameters(
                state=state,
                hardening=hardening,
                hardening_ratio=hardening_ratio,
                isotropic_fraction=float(rng.random()),
                friction=_from_ends_or_between(rng, 0.0, 1.0),
                poisson_ratio=_from_ends_or_between(rng, 0.0, 0.499),
                punch_stiffness=float(10 ** rng.choice([-3, 3, 0, *rng.uniform(-3, 3, 3)])),
                elastic_punch=elastic_punch,
                load_ratio=_load_ratio(rng, limit, hardens),
                load_step=float(rng.choice([0.05, 0.1, 0.25])),
                unload_steps=int(rng.choice([1, 1, 2, 5])),
                element=ELEMENTS[number // 12 % 10 if number % 2 else rng.integers(10)],
                smallest_element=float(rng.choice([0.02, 0.03, 0.05])),
                growth=float(rng.uniform(1.8, 2.5)),
                punch_height=PUNCH_HEIGHT,
                half_plane_size=BLOCK_SIZE,
            )
        )
    return scenes


@dataclass(frozen=True, slots=True, kw_only=True)
class Pressed:
    """A punch as the studies walk it: its record, and what the record was taken from."""

    parameters: PunchParameters
    record: Record
    system: System
    outcome: Outcome


def hardens(parameters: PunchParameters) -> bool:
    """Whether a higher load always finds an equilibrium."""
    return parameters.hardening != "none" and parameters.hardening_ratio > 0


def press(parameters: PunchParameters) -> Pressed:
    """Run the scene, or raise what ended it."""
    look, record = looked_at(PUNCH, parameters)
    if look.outcome.error is not None:
        raise look.outcome.error
    return Pressed(parameters=parameters, record=record, system=look.system, outcome=look.outcome)


def _figures(pressed: Pressed) -> dict[str, Figure]:
    found = judge(pressed.parameters, pressed.system, pressed.outcome)
    audit = Figure(float(not pressed.record.status.solved), 0.0)
    return {"audit": audit} | {name: Figure(found[name], LIMITS[name]) for name in LIMITS}


def _scene(p: PunchParameters) -> Scene:
    bounds = collapse(p.state, elastic_punch=p.elastic_punch)
    endless = hardens(p)
    certain = float("inf") if endless or p.element in LOCKING else bounds.certain * MESH_ALLOWANCE
    # beyond collapse, a path may end without having seen the mechanism
    beyond = not endless and p.load_ratio > bounds.certain
    return Scene(
        what=changed(p),
        run=partial(press, p),
        judge=_figures,
        load=p.load_ratio,
        certain=certain,
        safe=float("inf") if endless else bounds.safe,
        honest=tells("increment between") if beyond else None,
    )


def scenes(count: int) -> list[Scene]:
    """Return the extreme punches."""
    return [_scene(p) for p in extreme_scenes(count)]
