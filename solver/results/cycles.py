"""Repeated stages: plastic strain and work of each cycle, and the shakedown state."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from solver.loading.outcome import Cycle
from solver.materials.law import Law
from solver.results.quantities import declare
from solver.results.run import Values
from solver.results.shakedown import Shakedown, ShakedownState, classify
from solver.typing import Array, Ints

_EACH = ("cycle",)

CYCLE = declare("cycle", "number of the cycle", dims=_EACH, count=True)
CYCLE_PLASTIC_INCREMENT = declare(
    "cycle_plastic_increment",
    "largest equivalent plastic strain accumulated in a cycle", dims=_EACH,
)  # fmt: skip
CYCLE_NET_INCREMENT = declare(
    "cycle_net_increment",
    "largest equivalent of the signed plastic strain a cycle leaves", dims=_EACH,
)  # fmt: skip
CYCLE_DISSIPATION = declare(
    "cycle_dissipation",
    "plastic work and work of friction in a cycle: the area of its loops of force over "
    "displacement", "N mm", dims=_EACH,
)  # fmt: skip
SHAKEDOWN_STATE = declare(
    "shakedown_state", "shakedown state that the passes or cycles tend to", flags=ShakedownState
)
STEADY_PLASTIC_INCREMENT = declare(
    "steady_plastic_increment", "limit of the plastic strain accumulated in a cycle"
)
STEADY_NET_INCREMENT = declare(
    "steady_net_increment", "limit of the signed plastic strain that a cycle leaves"
)

LEAST = 2
"""Least number of cycles: the last is compared with the one before."""


def over_cycles(cycles: Sequence[Cycle], laws: Sequence[Law]) -> Values:
    """Return the variables over cycles, and the shakedown state; empty without cycles."""
    if not cycles:
        return {}
    return {
        CYCLE: np.arange(1, len(cycles) + 1),
        CYCLE_PLASTIC_INCREMENT: np.array([c.accumulated.max(initial=0.0) for c in cycles]),
        CYCLE_NET_INCREMENT: np.array([c.net.max(initial=0.0) for c in cycles]),
        CYCLE_DISSIPATION: np.array([c.dissipated for c in cycles]),
        **shakedown(shakedown_of(cycles, laws)),
    }


def shakedown(found: Shakedown) -> Values:
    """Return the variables of a shakedown state."""
    return {
        SHAKEDOWN_STATE: found.state,
        STEADY_PLASTIC_INCREMENT: found.accumulated,
        STEADY_NET_INCREMENT: found.net,
    }


def shakedown_of(cycles: Sequence[Cycle], laws: Sequence[Law]) -> Shakedown:
    """Return the shakedown state to which cycles of bodies with these material laws tend."""
    yielding = [law for law in laws if not law.elastic]
    if not any(len(cycle.points) for cycle in cycles):
        elastic = not cycles[0].before
        state = ShakedownState.ELASTIC if elastic else ShakedownState.ELASTIC_SHAKEDOWN
        return Shakedown(state, 0.0, 0.0)
    points = np.unique(np.concatenate([cycle.points for cycle in cycles]))
    return classify(
        _table(points, [(cycle.points, cycle.accumulated) for cycle in cycles]),
        _table(points, [(cycle.points, cycle.net) for cycle in cycles]),
        min(law.yield_stress / law.elasticity.youngs_modulus for law in yielding),
        hardens=all(law.hardens for law in yielding),
    )


def decided(cycles: Sequence[Cycle], laws: Sequence[Law]) -> bool:
    """Whether the cycles so far decide the shakedown state and its plastic strain."""
    if len(cycles) < LEAST:
        return False
    found = shakedown_of(cycles, laws)
    rate = found.net if found.state is ShakedownState.RATCHETTING else found.accumulated
    return found.state is not ShakedownState.UNDECIDED and bool(np.isfinite(rate))


def _table(points: Ints, each: Sequence[tuple[Ints, Array]]) -> Array:
    """Return the values (n_cycles, n_points) at ``points``, zero where a cycle has none."""
    table = np.zeros((len(each), len(points)))
    for row, (own, values) in zip(table, each, strict=True):
        row[np.searchsorted(points, own)] = values
    return table
