"""Pressure, shear, gap and slip of a contact pair, and the ends of the contact."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from solver.contact.pressure import contact_pressure
from solver.contact.problem import STICK
from solver.contact.state import Converged
from solver.contact.system import System
from solver.results.view import Axis
from solver.typing import Array, Bools


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactResult:
    """Contact at the n vertices of the slave of a contact pair.

    Attributes
    ----------
    s : (n,) distance along the slave from its start [mm]
    X : (2, n) positions before loading [mm]
    pressure : (n,) force per area before loading, as the stress of the body [MPa]
    shear : (n,) shear of the slave on the master along s, per area before loading [MPa]. Between a
        lower and an upper body this is the shear on the lower one along x, whichever is the slave
    pressure_deformed : (n,) force per deformed area, which is the same for both surfaces and does
        not depend on the choice of the slave. With small sliding it equals ``pressure`` [MPa]
    gap : (n,) distance of the surfaces; NaN where no master faces the slave [mm]
    slip : (n,) slip of the slave on the master along s [mm]
    area : (n,) integral of the whole hat of each vertex: the sum of pressure times area is the
        normal force [mm2]
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
    area: Array
    closed: Bools
    sticking: Bools

    @property
    def patches(self) -> list[tuple[float, float]]:
        """Start and end along s of each patch in which the bodies touch [mm]."""
        return contact_patches(self.s, self.gap, self.closed)

    @property
    def length(self) -> float:
        """Length along which the bodies touch [mm]."""
        return sum(end - start for start, end in self.patches)

    def along(self, axis: Axis) -> ContactResult:
        """Return the result along a straight axis, with ``s`` from its middle [mm].

        Shear acts on the lower body along the axis.
        """
        s = axis.reached(self.X)
        order = np.argsort(s)
        own = {each.name: getattr(self, each.name)[..., order] for each in fields(self)}
        return ContactResult(**own | {"s": s[order]})


def contact_result(system: System, at: Converged, pair: int = 0) -> ContactResult:
    """Return pressure, shear, gap and slip at the vertices of the slave of a pair."""
    interface, state, contact = system.interfaces[pair], at.state, at.state.contacts[pair]
    chain = interface.slave_surface
    X = chain.X[:, chain.vertices]
    pressure, shear = contact_pressure(system, state, pair)
    pairing = system.pairing(state, pair)
    gap = np.where(np.isfinite(pairing.gap), pairing.gap, np.nan)
    closed = contact.normal > 0
    return ContactResult(
        s=np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(X), axis=0))]),
        X=X,
        pressure=pressure,
        shear=-shear,
        pressure_deformed=pairing.shrunk * pressure,
        gap=gap,
        slip=np.where(np.isfinite(gap), interface.slip(pairing, state.u), np.nan),
        area=chain.hats,
        closed=closed,
        sticking=closed & (contact.status == STICK) & interface.rough,
    )


def contact_patches(s: Array, gap: Array, closed: Bools) -> list[tuple[float, float]]:
    """Return start and end [mm] of each patch of contact, from the gaps next to its closed points.

    Outside a smooth contact the gap is proportional to the distance from its edge to the power 3/2,
    also if the bodies yield. A straight line through (gap)^(2/3) at two points is thus zero at the
    edge. If the surface ends there, or no master faces it, the edge is the last closed point.

    Parameters
    ----------
    s : (n,) positions along the surface, growing [mm]
    gap : (n,) NaN where unknown [mm]
    closed : (n,) whether the bodies touch
    """
    ends = np.flatnonzero(np.diff(np.pad(closed.astype(int), 1)))
    return [
        (_edge(s, gap, closed, first, -1), _edge(s, gap, closed, last, 1))
        for first, last in zip(ends[::2], ends[1::2] - 1, strict=True)
    ]


def _edge(s: Array, gap: Array, closed: Bools, last: int, way: int) -> float:
    """Return the edge of contact [mm] beyond its ``last`` closed point in the direction ``way``."""
    beyond, near, far = last + way * np.array([1, 2, 3])  # the hat of ``beyond`` is partly closed
    if not 0 <= far < len(s) or closed[[beyond, near, far]].any():
        return float(s[last])
    if not 0 < gap[near] < gap[far]:  # also if NaN
        return float(s[last])
    low, high = gap[[near, far]] ** (2 / 3)
    edge = s[near] - low * (s[far] - s[near]) / (high - low)
    inner = s[last - way] if 0 <= last - way < len(s) else s[last]
    return float(np.clip(edge, *sorted((inner, s[beyond]))))
