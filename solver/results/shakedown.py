"""The shakedown state of a body under repeated passes of the same load.

============================  ===============================================================
elastic                       it never yields
elastic shakedown             it yields at first; residual stress then keeps it elastic
plastic shakedown             every cycle yields, and plastic strain returns to its value
ratchetting                   every cycle adds plastic strain
undecided                     the cycles have not become steady
============================  ===============================================================

The *signed* plastic strain distinguishes a closed cycle from an open one; the accumulated strain
shows whether there is flow. Both have bounds for their limits over many cycles. A state is decided
only if it is the same for all values within the bounds.

K.L. Johnson, Contact Mechanics (1985), section 9.2.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from solver.typing import Array

QUIET = 1e-3
"""Plastic strain accumulated in a cycle over the yield strain: up to this ratio nothing flows."""
CLOSED = 0.05
"""Change of signed plastic strain in a cycle over the strain accumulated in it: the cycle is closed
up to this ratio. Also the strain accumulated at a depth over the largest one: up to this ratio the
depth is left out, because its strain may be an interpolation error."""
STEADY = 0.02
"""Relative change from cycle to cycle, up to which a sequence has reached its limit. Twice this
change is permitted over the second half of the sequence."""
AT_REST = 2e-3
"""Relative change from cycle to cycle, up to which earlier values do not matter."""
KEPT = 0.8
"""Last value of a sequence over its value half-way: the limit may be zero below this ratio. A decay
as 1 / n^p has the ratio 1 / 2^p, however long it has lasted."""
SLOWEST = 0.95
"""Ratio of successive changes: no limit can be extrapolated above it."""
KNOWN = 0.1
"""Distance between the bounds of a limit over the upper bound: up to this ratio their mean is the
limit."""


class ShakedownState(IntEnum):
    """The shakedown state, with its stored value."""

    ELASTIC = 0
    ELASTIC_SHAKEDOWN = 1
    PLASTIC_SHAKEDOWN = 2
    RATCHETTING = 3
    UNDECIDED = 4


@dataclass(frozen=True, slots=True)
class Shakedown:
    """The state, and the limits of accumulated and net plastic strain in a cycle (or NaN)."""

    state: ShakedownState
    accumulated: float
    net: float


@dataclass(frozen=True, slots=True)
class Limit:
    """Bounds of the limit of a sequence of non-negative numbers."""

    low: float
    high: float

    @classmethod
    def of(cls, sequence: Array) -> Limit:
        """Return the bounds of the limit of a sequence (n,) from its last four or three values.

        A steady sequence has reached its limit. Otherwise the bounds are the outermost ones of the
        last two triples of values: a geometric change is extrapolated (Aitken's process),
        alternating values stay within their range, others may grow without bound or fall to zero. A
        sequence that has fallen much since half-way may also fall to zero.
        """
        if len(sequence) < 3:
            return cls(0.0, np.inf)
        last, halfway = float(sequence[-1]), float(sequence[len(sequence) // 2 - 1])
        change = max(abs(last - sequence[-2]), abs(last - halfway) / 2)
        if change <= STEADY * abs(last):
            return cls(last, last)
        triples = [sequence[i - 3 : i] for i in (len(sequence) - 1, len(sequence)) if i > 2]
        low, high = np.transpose([_bounds(*triple) for triple in triples])
        kept = last >= KEPT * halfway
        return cls(float(low.min()) if kept else 0.0, float(high.max()))

    @property
    def value(self) -> float:
        """The limit if its bounds are close, else NaN."""
        known = self.high - self.low <= KNOWN * self.high < np.inf
        return (self.low + self.high) / 2 if known else np.nan


def _bounds(first: float, second: float, third: float) -> tuple[float, float]:
    """Return the bounds of the limit from three successive values."""
    before, last = second - first, third - second
    if abs(last) <= AT_REST * abs(third):
        return third, third
    if last * before < 0:
        return min(first, second, third), max(first, second, third)
    if abs(last) < SLOWEST * abs(before):
        limit = max(third + last**2 / (before - last), 0.0)
        return limit, limit
    return (third, np.inf) if last > 0 else (0.0, third)


def classify(
    accumulated: Array, net: Array, yield_strain: float, *, hardens: bool = False
) -> Shakedown:
    """Return the shakedown state from the plastic strain of each cycle.

    Parameters
    ----------
    accumulated : (n_cycles, n_depths) equivalent plastic strain accumulated in a cycle
    net : (n_cycles, n_depths) equivalent of the change of signed plastic strain in a cycle
    yield_strain : yield stress over Young's modulus
    hardens : whether linear hardening bounds plastic strain: ratchetting must then end, and cycles
        that still add plastic strain are undecided
    """
    if not accumulated.any():
        return Shakedown(ShakedownState.ELASTIC, 0.0, 0.0)
    quiet = QUIET * yield_strain
    flow = Limit.of(accumulated.max(axis=1))
    if accumulated[-1].max() <= quiet or flow.high <= quiet:
        return Shakedown(ShakedownState.ELASTIC_SHAKEDOWN, 0.0, 0.0)
    flows = accumulated[-1] > CLOSED * accumulated[-1].max()
    depth = np.where(flows, net[-1] - CLOSED * accumulated[-1], -np.inf).argmax()
    net, turnover = net[:, depth], accumulated[:, depth]
    change = Limit.of(net)
    opening = Limit.of(np.divide(net, turnover, out=np.zeros_like(net), where=turnover > 0))
    state = ShakedownState.UNDECIDED
    if flow.low > quiet and opening.high <= CLOSED:
        state = ShakedownState.PLASTIC_SHAKEDOWN
    elif change.low > quiet and opening.low > CLOSED and not hardens:
        state = ShakedownState.RATCHETTING
    return Shakedown(state, flow.value, change.value)
