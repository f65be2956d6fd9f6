"""Pressure, shear, gap and slip of a contact pair, and what acts on the lower body of a run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from functools import partial
from typing import Any

import numpy as np

from solver.contact.problem import STICK
from solver.contact.state import Converged
from solver.contact.system import System
from solver.fem.rigid import RigidMotion
from solver.fem.wheel import Wheel
from solver.model.loads import TravellingPressure
from solver.results.fields import Remembered, Solved
from solver.results.view import ALONG_X, Axis
from solver.typing import Array, Bools


def _nothing(x: Array) -> tuple[Array, Array, Array]:
    nowhere = np.full_like(x, np.nan)
    return nowhere, nowhere, nowhere


@dataclass(frozen=True, slots=True, kw_only=True)
class Acting:
    """What acts, in a state, on the lower body, whose surface runs along x: by default nothing.

    Attributes
    ----------
    along : (positions x (n,) [mm]) -> pressure, shear along +x [MPa] and gap [mm], each (n,). They
        are NaN beyond the surface, and without contact along a line; the gap is also NaN for
        separated bodies and for a prescribed pressure
    half_width, peak : half-width of the contact [mm] and peak pressure [MPa]
    force : tangential force along +x [N]
    centre : position of the load along x [mm]
    axle : motion of the first wheel, None without a wheel
    points : result at the vertices of a contact along x, None without one
    """

    along: Callable[[Array], tuple[Array, Array, Array]] = _nothing
    half_width: float = np.nan
    peak: float = np.nan
    force: float = np.nan
    centre: float = 0.0
    axle: RigidMotion | None = None
    points: ContactResult | None = None


def of_pair(system: System, at: Converged, *, symmetric: bool, axis: Axis = ALONG_X) -> Acting:
    """Return what acts by the first contact pair of a system along ``axis``.

    ``symmetric`` means that only one half of the contact is computed.
    """
    found, chain = contact_result(system, at).along(axis), system.interfaces[0].slave_surface
    gap = found.gap if found.closed.any() else np.full_like(found.gap, np.nan)
    # beyond the pair pressure is zero if the surface of the body continues
    free = np.where(chain.goes_on, 0.0, np.nan)
    first, last = axis.reached(chain.X[:, chain.vertices[[0, -1]]])
    free, nowhere = free if first < last else free[::-1], np.full(2, np.nan)

    def along(x: Array) -> tuple[Array, Array, Array]:
        def sampled(values: Array, beyond: Array) -> Array:
            return np.asarray(np.interp(x, found.s, values, *beyond))

        return sampled(found.pressure, free), sampled(found.shear, free), sampled(gap, nowhere)

    patches, wheel = found.patches or [(0.0, 0.0)], axle_of(system, at)
    start, end = patches[0][0], patches[-1][1]
    return Acting(
        along=along,
        half_width=end if symmetric else (end - start) / 2,
        peak=float(found.pressure.max()),
        force=-float(at.state.contacts[0].tangential.sum()),
        centre=0.0 if wheel is None else wheel[0].frame.centre[0] + wheel[1].x,
        axle=None if wheel is None else wheel[1],
        points=found,
    )


def axle_of(system: System, at: Converged) -> tuple[Wheel, RigidMotion] | None:
    """Return the first wheel and its motion; None without a wheel."""
    both = zip(system.parts, at.state.u, strict=True)
    wheels = ((part, part.motion_of(u)) for part, u in both if isinstance(part, Wheel))
    return next(wheels, None)


def of_pressure(travelling: TravellingPressure, at: Solved) -> Acting:
    """Return what a travelling pressure does."""
    time = at.state.time
    share, centre, ratio = travelling.now(time)
    width, peak = travelling.half_width, share * travelling.peak

    def along(x: Array) -> tuple[Array, Array, Array]:
        pressure, ratio = travelling.at(time, x)
        return pressure, ratio * pressure, np.full_like(x, np.nan)

    force = np.pi / 2 * width * peak * ratio
    return Acting(along=along, half_width=width, peak=peak, force=force, centre=centre)


def _of_all(loads: Sequence[TravellingPressure], at: Solved) -> Acting:
    """Return the sum of what several travelling pressures do; it has no half-width and no peak."""
    each = [of_pressure(load, at) for load in loads]

    def along(x: Array) -> tuple[Array, Array, Array]:
        pressure, shear, gap = np.sum([acting.along(x) for acting in each], axis=0)
        return pressure, shear, gap

    return Acting(along=along, force=sum(acting.force for acting in each), centre=each[0].centre)


def acting_on(system: System, *, symmetric: bool, axis: Axis = ALONG_X) -> Callable[[Any], Acting]:
    """Return the function from states to what acts between the bodies of a system, or on one."""
    if system.interfaces:
        known: Remembered[Acting] = Remembered()
        pair = partial(of_pair, system, symmetric=symmetric, axis=axis)
        return lambda at: known.of(at, "", partial(pair, at))
    for body in system.model.bodies:
        loads = [load for load in body.every_load if isinstance(load, TravellingPressure)]
        if loads:
            return partial(of_pressure, loads[0]) if len(loads) == 1 else partial(_of_all, loads)
    return lambda at: Acting()


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
    pressure, shear = system.pressure(state, pair)
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
