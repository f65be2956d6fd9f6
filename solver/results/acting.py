"""What acts on the lower body of a run: pressure and shear, from contact or prescribed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from solver.contact.state import Converged
from solver.contact.system import System
from solver.fem.frame import RigidMotion
from solver.fem.wheel import Wheel
from solver.model.loads import TravellingPressure
from solver.results.contact_result import ContactResult, contact_result
from solver.results.fields import Remembered, Solved
from solver.results.view import ALONG_X, Axis
from solver.typing import Array


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
