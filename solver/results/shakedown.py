"""The shakedown state of a body that the same load passes again and again.

============================  ===============================================================
elastic                       it never yields
elastic shakedown             it yields at first; residual stress then keeps it elastic
plastic shakedown             every cycle yields, and plastic strain comes back to where it was
ratchetting                   every cycle leaves plastic strain behind
undecided                     the cycles have not become steady
============================  ===============================================================

The *signed* plastic strain tells a closed cycle from an open one; the accumulated strain tells
whether there is flow at all. For each the bounds of its limit over many cycles are found, and a
state is decided only if it is the same for all values within the bounds.

K.L. Johnson, Contact Mechanics (1985), section 9.2.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

QUIET = 1e-3
"""Accumulated plastic strain of a cycle, over the yield strain, below which nothing flows."""
CLOSED = 0.05
"""Ratio of the plastic strain left by a cycle to the strain accumulated in it, up to which the
cycle is closed. Also the share of the largest accumulated strain, up to which that at a depth may
be an interpolation error, and is left out."""
STEADY = 0.02
"""Relative change from cycle to cycle, up to which a sequence has reached its limit. Over the
second half of the sequence twice this change is allowed."""
AT_REST = 2e-3
"""Relative change from cycle to cycle, below which earlier values do not matter."""
KEPT = 0.8
"""Ratio of the last value of a sequence to its value half-way, below which its limit may be zero. A
decay as 1 / n^p has the ratio 1 / 2^p, however long it has lasted."""
SLOWEST = 0.95
"""Ratio of successive changes, above which no limit can be extrapolated."""
KNOWN = 0.1
"""Ratio of the distance between the bounds of a limit to the upper one, up to which their mean is
the limit."""


class ShakedownState(IntEnum):
    """The shakedown state, with the value it is stored as."""

    ELASTIC = 0
    ELASTIC_SHAKEDOWN = 1
    PLASTIC_SHAKEDOWN = 2
    RATCHETTING = 3
    UNDECIDED = 4


@dataclass(frozen=True, slots=True)
class Shakedown:
    """The state, and the limits of the plastic strain a cycle accumulates and leaves (or NaN)."""

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
        """Return the limit of a sequence (n,) from its last four values, or three.

        A steady sequence has reached its limit. Otherwise the last two triples of values give
        bounds each, and the limit may be anywhere between all of these: a geometric change is
        extrapolated (Aitken's process), values that go up and down stay within their range, any
        others may grow without bound or fall to zero. A sequence that has fallen too far since
        half-way may also fall to zero.
        """
        if len(sequence) < 3:
            return cls(0.0, np.inf)
        last, halfway = float(sequence[-1]), float(sequence[len(sequence) // 2 - 1])
        change = max(abs(last - sequence[-2]), abs(last - halfway) / 2)
        if change <= STEADY * abs(last):
            return cls(last, last)
        triples = [sequence[i - 3 : i] for i in (len(sequence) - 1, len(sequence)) if i > 2]
        low, high = np.transpose([_tends(*triple) for triple in triples])
        kept = last >= KEPT * halfway
        return cls(float(low.min()) if kept else 0.0, float(high.max()))

    @property
    def value(self) -> float:
        """The limit where it is known, else NaN."""
        known = self.high - self.low <= KNOWN * self.high < np.inf
        return (self.low + self.high) / 2 if known else np.nan


def _tends(first: float, second: float, third: float) -> tuple[float, float]:
    """Return the bounds of the limit that follow from three successive values."""
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
    net : (n_cycles, n_depths) equivalent of the signed plastic strain a cycle leaves
    yield_strain : yield stress / Young's modulus
    hardens : whether linear hardening bounds plastic strain: ratchetting then must end some time,
        and cycles that still leave plastic strain are undecided, however little they leave
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
    left = Limit.of(net)
    opening = Limit.of(np.divide(net, turnover, out=np.zeros_like(net), where=turnover > 0))
    state = ShakedownState.UNDECIDED
    if flow.low > quiet and opening.high <= CLOSED:
        state = ShakedownState.PLASTIC_SHAKEDOWN
    elif left.low > quiet and opening.low > CLOSED and not hardens:
        state = ShakedownState.RATCHETTING
    return Shakedown(state, flow.value, left.value)
