"""What becomes of a body that the same load passes again and again.

============================  ===============================================================
elastic                       it never yields
elastic shakedown             it yields at first; residual stress then keeps it elastic
plastic shakedown             every cycle yields, and plastic strain comes back to where it was
ratchetting                   every cycle leaves plastic strain behind
undecided                     the cycles have not become steady
============================  ===============================================================

The *signed* plastic strain tells a closed cycle from an open one; the accumulated strain tells
whether there is flow at all. Both are judged by the bounds between which they tend, and decided
only where the whole of these bounds agrees.

K.L. Johnson, Contact Mechanics (1985), section 9.2.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import minimize, minimize_scalar

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

QUIET = 1e-3
"""Accumulated plastic strain of a cycle, over the yield strain, below which nothing flows."""
CLOSED = 0.05
"""Plastic strain left by a cycle over that accumulated in it, up to which the cycle is closed; also
the part of the largest accumulation up to which that of a depth is not told from interpolation."""
STEADY = 0.02
"""Relative change from cycle to cycle, with twice that over the second half of a sequence, up to
which it has come to its limit."""
AT_REST = 2e-3
"""Relative change from cycle to cycle below which what came before does not matter."""
KEPT = 0.8
"""Part of its value half-way that a sequence must keep to tend to anything but zero. A decay as
1 / n^p keeps 1 / 2^p of it, however long it has lasted."""
SLOWEST = 0.95
"""Ratio of successive changes above which a sequence tends nowhere yet."""
KNOWN = 0.1
"""Distance of the bounds of a limit, over the upper one, up to which their mean is the limit."""

_X = np.linspace(-4.0, 4.0, 1601)


class State(IntEnum):
    """The shakedown state, with the value it is stored as."""

    ELASTIC = 0
    ELASTIC_SHAKEDOWN = 1
    PLASTIC_SHAKEDOWN = 2
    RATCHETTING = 3
    UNDECIDED = 4


@dataclass(frozen=True, slots=True)
class Shakedown:
    """The state, and the plastic strain a cycle accumulates and leaves in the end (NaN unknown)."""

    state: State
    accumulated: float
    net: float


@dataclass(frozen=True, slots=True)
class Limit:
    """Bounds of what a sequence of numbers that are not negative tends to."""

    low: float
    high: float

    @classmethod
    def of(cls, sequence: Array) -> Limit:
        """Return the limit of a sequence (n,) from its last four values, or three.

        A steady sequence has come to its limit, one that changes geometrically is extrapolated
        (Aitken's process), one that goes up and down keeps within what it showed, any other one
        goes on as it does. Two triples of values have each their say. What has fallen too far
        since half-way may go on to zero.
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
    """Return the bounds of the limit that three successive values show."""
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
    """Return the shakedown state from what each cycle did.

    Parameters
    ----------
    accumulated : (n_cycles, n_depths) equivalent plastic strain accumulated in a cycle
    net : (n_cycles, n_depths) equivalent of the signed plastic strain a cycle leaves
    yield_strain : yield stress / Young's modulus
    hardens : whether linear hardening bounds plastic strain, so that no cycle can go on leaving
        some: ratchetting then has not come to its end, however slow it is
    """
    if not accumulated.any():
        return Shakedown(State.ELASTIC, 0.0, 0.0)
    quiet = QUIET * yield_strain
    flow = Limit.of(accumulated.max(axis=1))
    if accumulated[-1].max() <= quiet or flow.high <= quiet:
        return Shakedown(State.ELASTIC_SHAKEDOWN, 0.0, 0.0)
    flows = accumulated[-1] > CLOSED * accumulated[-1].max()
    depth = np.where(flows, net[-1] - CLOSED * accumulated[-1], -np.inf).argmax()
    net, turnover = net[:, depth], accumulated[:, depth]
    left = Limit.of(net)
    opening = Limit.of(np.divide(net, turnover, out=np.zeros_like(net), where=turnover > 0))
    state = State.UNDECIDED
    if flow.low > quiet and opening.high <= CLOSED:
        state = State.PLASTIC_SHAKEDOWN
    elif left.low > quiet and opening.low > CLOSED and not hardens:
        state = State.RATCHETTING
    return Shakedown(state, flow.value, left.value)


def sliding_contact(x: Array, depth: float, friction: float) -> tuple[Array, Array, Array]:
    """Return sigma_x, sigma_y and tau over p0 under a Hertz pressure that slides along +x.

    ``x`` (n,) and ``depth`` are over the half-width; tension is positive, and the shear traction
    on the half-space is ``friction`` times the pressure along +x (y and depth point down).
    E. McEwen, Phil. Mag. 40 (1949) 454-459; Johnson, eqs. (4.49), (7.8).
    """
    s = 1 - x**2 + depth**2
    root = np.sqrt(s**2 + 4 * x**2 * depth**2)
    m = np.sqrt((root + s) / 2)
    n = np.sign(x) * np.sqrt(np.maximum(root - s, 0.0) / 2)
    both = np.maximum(m**2 + n**2, np.finfo(float).tiny)
    along = 2 * depth - m * (1 + (depth**2 + n**2) / both)
    across = -m * (1 - (depth**2 + n**2) / both)
    shear = -n * (m**2 - depth**2) / both
    dragged = n * (2 + (m**2 - depth**2) / both) - 2 * x
    return along + friction * dragged, across + friction * shear, shear + friction * along


def largest_shear(friction: float) -> tuple[float, float]:
    """Return the largest shear / p0 below a sliding Hertz contact, and its depth / half-width."""

    def least(depth: float) -> float:
        return -float(np.abs(sliding_contact(_X, depth, friction)[2]).max())

    found = minimize_scalar(least, bounds=(0.05, 1.5), method="bounded")
    return -float(found.fun), float(found.x)


def johnson_limit(friction: float) -> float:
    """Return p0 / k up to which a sliding Hertz line contact shakes down elastically.

    Residual stress can take away the difference of normal stresses where the shear is largest,
    but not the shear, which therefore decides: below the surface, or, from a friction of about
    0.37 on, at it. Johnson, section 9.2 (maximum shear stress criterion).
    """
    return 1 / max(largest_shear(friction)[0], friction)


def melan_limit(friction: float, poisson_ratio: float) -> float:
    """Return `johnson_limit` for von Mises' criterion in plane strain.

    At each depth one residual stress (sigma_x, sigma_z) must bring all stresses met there inside
    the yield surface (Melan). Below the surface both criteria agree; at the surface the stress
    out of plane, which follows the two others, makes von Mises' limit the lower one.
    """

    def least(depth: float) -> float:
        along, across, shear = sliding_contact(_X, depth, friction)
        out = poisson_ratio * (along + across)

        def largest(residual: Array) -> float:
            a, b, c = along + residual[0], across, out + residual[1]
            return float((((a - b) ** 2 + (b - c) ** 2 + (c - a) ** 2) / 6 + shear**2).max())

        starts = ((0.1, 0.1), (0.5, 0.2))
        options = {"xatol": 1e-6, "fatol": 1e-9, "maxiter": 4000}
        return min(float(minimize(largest, start, method="Nelder-Mead", options=options).fun)
                   for start in starts)  # fmt: skip

    return float(1 / np.sqrt(max(least(0.0), least(largest_shear(friction)[1]))))
