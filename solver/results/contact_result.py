"""What acts between the surfaces of a contact pair, and where the contact ends."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from solver.contact.pressure import contact_pressure
from solver.contact.problem import STICK

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.contact.state import Converged
    from solver.contact.system import System
    from solver.results.view import Axis

    Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactResult:
    """What acts at the n vertices of the slave of a contact pair.

    Attributes
    ----------
    s : (n,) distance along the slave from its start [mm]
    X : (2, n) positions before loading [mm]
    pressure : (n,) over the area before loading, to which the stress of the body refers [MPa]
    shear : (n,) that the slave exerts on the master along s, over the same area [MPa]. Between a
        lower and an upper body it is that on the lower one along x, whichever is the slave
    pressure_deformed : (n,) over the deformed area, which both surfaces share: it does not depend
        on which of them is the slave. Under small sliding it is ``pressure`` [MPa]
    gap : (n,) NaN where no master faces the slave [mm]
    slip : (n,) of the slave on the master along s [mm]
    closed : (n,) whether the bodies touch
    sticking : (n,) whether they touch without slip; nowhere without friction
    """

    s: Array
    X: Array
    pressure: Array
    shear: Array
    pressure_deformed: Array
    gap: Array
    slip: Array
    closed: NDArray[np.bool_]
    sticking: NDArray[np.bool_]

    @property
    def patches(self) -> list[tuple[float, float]]:
        """From where to where along s the bodies touch [mm]."""
        return contact_patches(self.s, self.gap, self.closed)

    @property
    def length(self) -> float:
        """Length along which the bodies touch [mm]."""
        return sum(end - start for start, end in self.patches)

    def along(self, axis: Axis) -> ContactResult:
        """Return the same in the order of a straight axis, ``s`` from its middle [mm].

        Shear is that on the lower body along the axis.
        """
        s = axis.reached(self.X)
        order = np.argsort(s)
        own = {each.name: getattr(self, each.name)[..., order] for each in fields(self)}
        return ContactResult(**own | {"s": s[order]})


def contact_result(system: System, at: Converged, pair: int = 0) -> ContactResult:
    """Return what acts at the vertices of the slave of a pair."""
    interface, state, contact = system.interfaces[pair], at.state, at.state.contacts[pair]
    chain = interface.slave_surface
    X = chain.X[:, chain.vertices]
    pressure, shear = contact_pressure(system, state, pair)
    pairing = system.pairing(state, pair)
    known = pairing.deformed > 0
    shrunk = np.divide(pairing.area, pairing.deformed, out=np.ones_like(pressure), where=known)
    gap = np.where(np.isfinite(pairing.gap), pairing.gap, np.nan)
    closed = contact.normal > 0
    return ContactResult(
        s=np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(X), axis=0))]),
        X=X,
        pressure=pressure,
        shear=-shear,
        pressure_deformed=shrunk * pressure,
        gap=gap,
        slip=np.where(np.isfinite(gap), interface.slip(pairing, state.u), np.nan),
        closed=closed,
        sticking=closed & (contact.status == STICK) & interface.rough,
    )


def contact_patches(s: Array, gap: Array, closed: NDArray[np.bool_]) -> list[tuple[float, float]]:
    """Return from where to where bodies touch, by the gaps beside each patch of closed points.

    Beyond a smooth edge of a contact the gap opens as the distance to the power 3/2. Its power 2/3
    at two points beyond lies on a line that ends at the edge, whatever yields inside. Where the
    surface ends, or nothing faces it, the edge is the last point that touches.

    Parameters
    ----------
    s : (n,) positions along the surface, growing [mm]
    gap : (n,) NaN where it is not known [mm]
    closed : (n,) whether the bodies touch
    """
    ends = np.flatnonzero(np.diff(np.pad(closed.astype(int), 1)))
    return [
        (_edge(s, gap, closed, first, -1), _edge(s, gap, closed, last, 1))
        for first, last in zip(ends[::2], ends[1::2] - 1, strict=True)
    ]


def _edge(s: Array, gap: Array, closed: NDArray[np.bool_], last: int, way: int) -> float:
    """Return where contact ends beyond its last point in one direction, within an element."""
    beyond, near, far = last + way * np.array([1, 2, 3])  # the hat of the first is partly closed
    if not 0 <= far < len(s) or closed[[beyond, near, far]].any():
        return float(s[last])
    if not 0 < gap[near] < gap[far]:  # NaN too
        return float(s[last])
    low, high = gap[[near, far]] ** (2 / 3)
    edge = s[near] - low * (s[far] - s[near]) / (high - low)
    inner = s[last - way] if 0 <= last - way < len(s) else s[last]
    return float(np.clip(edge, *sorted((inner, s[beyond]))))
