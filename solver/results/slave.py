"""What acts on the slave of a contact pair, and how long the contact is."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from solver.contact.pressure import contact_pressure

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.contact.state import Converged
    from solver.contact.system import System

    Array = NDArray[np.float64]


_LEVEL = 1e-6
"""Ratio of the fall of the squared pressure over an edge to its largest, below which it does not
fall."""


class Slave(NamedTuple):
    """What acts on the slave of a pair, at its vertices (n,): s from its start, X (2, n).

    ``pressure`` and ``shear`` are over the area before loading, to which the stress of the body
    refers, ``pressure_deformed`` is over the deformed area, which both surfaces share. ``closed``
    tells where the bodies touch.
    """

    s: Array
    X: Array
    pressure: Array
    shear: Array
    pressure_deformed: Array
    gap: Array
    slip: Array
    closed: NDArray[np.bool_]

    @property
    def length(self) -> float:
        """Length along which the bodies touch [mm].

        At a smooth edge the square of the pressure falls linearly to zero: the edge is sought
        there, within an element of the last vertex that touches. Where pressure does not fall, as
        at a corner, the edge is that vertex.
        """
        ends = np.flatnonzero(np.diff(np.pad(self.closed.astype(int), 1)))
        runs = zip(ends[::2], ends[1::2] - 1, strict=True)
        return sum(self._edge(last, 1) - self._edge(first, -1) for first, last in runs)

    def _edge(self, last: int, way: int) -> float:
        """Return where contact ends beyond a vertex, the last that touches in one direction."""
        inner = last - way * np.arange(2, 5)  # pressure is a mean: nearer it is that of the edge
        known = (inner >= 0) & (inner < len(self.s))
        beyond = last + way
        if not known.all() or not self.closed[inner].all() or not 0 <= beyond < len(self.s):
            return float(self.s[last])
        square, edge = self.pressure[inner] ** 2, abs(float(self.s[beyond] - self.s[last]))
        slope, start = np.polyfit(self.s[inner] - self.s[last], square, 1)
        if slope * way * edge >= -_LEVEL * square.max():  # as around the middle of few vertices
            return float(self.s[last])
        return float(self.s[last] + np.clip(-start / slope, -edge, edge))


def on_slave(system: System, at: Converged, pair: int) -> Slave:
    """Return what acts on the slave of a pair; the gap is NaN where no master faces it."""
    interface, state = system.interfaces[pair], at.state
    chain = interface.slave_surface
    X = chain.X[:, chain.vertices]
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(X), axis=0))])
    pressure, shear = contact_pressure(system, state, pair)
    shared, _ = contact_pressure(system, state, pair, deformed=True)
    pairing = system.pairing(state, pair)
    gap = np.where(np.isfinite(pairing.gap), pairing.gap, np.nan)
    slip = np.where(np.isfinite(gap), interface.slip(pairing, state.u), np.nan)
    return Slave(s, X, pressure, shear, shared, gap, slip, state.contacts[pair].normal > 0)
