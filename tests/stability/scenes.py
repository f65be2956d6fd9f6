"""Seeded extreme punches: every parameter is drawn from its ends as well as from between them."""

from __future__ import annotations

from functools import partial

import numpy as np

from solver.scenes.punch import PunchParameters
from tests.stability.collapse import BLOCK_SIZE, PUNCH_HEIGHT, collapse

COUNT = 120
SEED = 1995
STATES = ("plane_stress", "plane_strain", "axisymmetric")
HARDENING = ("none", "isotropic", "kinematic", "mixed")
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


def extreme_scenes(count: int = COUNT, seed: int = SEED) -> list[PunchParameters]:
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
