"""Neighbouring runs: the same run with one parameter slightly different, followed linearly.

A neighbour follows the increments of the run. Each of its increments is one Newton step from near
the end of the run's increment, with the run's consistent tangent; more where that is not exact (see
`Increment.linearised`). With a difference of 1e-6 of the parameter its error, of second order, is
negligible, so that

    (result of the neighbour - result of the run) / difference

is the derivative of any result. The law of a material is evaluated at the neighbour's strain,
internal variables and parameters: it needs no derivative of its own, nor do friction, loads and
shapes of rigid bodies. Contact has one more solution of its own small problem, from the run's
active sets, so that a neighbour changes them only if the run lies at their change.

A switch is a change of what yields, touches, sticks or slides: the derivatives hold up to it.
Of each pair of quantities that exclude each other, such as gap a and normal force b, with a >= 0,
b >= 0 and a b = 0, the number a - b keeps its sign up to the switch. Its distance from zero over
its change by a parameter tells how far the parameter may change.

The first neighbour is the run itself, after the same Newton step: its difference from the others
does not contain the out-of-balance forces that the run has left within its tolerance.

P. Michaleris, D.A. Tortorelli, C.A. Vidal, Tangent operators and design sensitivity formulations
for transient non-linear coupled problems with applications to elastoplasticity, International
Journal for Numerical Methods in Engineering 37 (1994) 2471-2499, direct differentiation of a
history.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from dataclasses import replace

import numpy as np

from solver.contact.candidates import Candidates
from solver.contact.problem import OPEN, STICK
from solver.contact.state import Converged, State
from solver.contact.system import System
from solver.errors import ModelError
from solver.fem.discretisation import Discretisation
from solver.fem.operators import Operator
from solver.fem.substructure import Substructure
from solver.linear.solvers import Singular, one_thread
from solver.loading.energy import worked
from solver.loading.increment import Increment
from solver.loading.outcome import IncrementFailed
from solver.loading.program import Control, Tolerances
from solver.loading.step import rounding
from solver.loading.stepper import Stepper, Way, placed
from solver.tensors import principal
from solver.typing import Array, Ints

_TIGHT = 1e-12
"""Tolerance of an increment of which differences of 1e-6 are taken, where rounding is smaller."""
_NOISE = 1e-10
"""Change of a number in a neighbouring run, over its scale: a smaller one may be rounding."""


class NeighbouringRuns:
    """The neighbouring runs of the runs of a system.

    Parameters
    ----------
    system : that of the run
    systems : those of its neighbours, by names of parameters

    Raises
    ------
    ModelError
        for a parameter that changes the elements, or the slave of a pair
    """

    def __init__(self, system: System, systems: Mapping[str, System]) -> None:
        for name, other in systems.items():
            _check_alike(name, system, other)
            for part, own in zip(system.parts, other.parts, strict=True):
                if isinstance(part, Substructure) and isinstance(own, Substructure):
                    own.follow(part)
        self._system = system
        self._steppers = [Stepper(each, Control()) for each in (system, *systems.values())]
        self._ways: tuple[Way, ...] = ()

    def between(self, ways: Sequence[Way]) -> None:
        """See `solver.loading.stepper.Followers`."""
        self._ways = (ways[0], *ways)

    def _times(self, time: float) -> list[float]:
        """Return the times of the neighbours that correspond to a time of the run."""
        (start, end), *others = self._ways
        share = (time - start) / (end - start) if end != start else 1.0
        return [a + share * (b - a) if share != 1.0 else b for a, b in others]

    def begun(
        self, before: Converged | None, balanced: Converged | None, time: float
    ) -> tuple[Converged, ...]:
        """See `solver.loading.stepper.Followers`."""
        if before and not before.beside:  # one has failed
            return ()
        operators = [] if balanced is None else self._system.tangents(balanced)
        known = before.beside if before else (None,) * len(self._steppers)
        out = []
        for stepper, last, at in zip(self._steppers, known, self._times(time), strict=True):
            system = stepper.system
            state = last.state if last else system.initial()
            if balanced is not None:
                increment = Increment(system, state, state.time, contact=False)
                state = system.at_rest(increment.linearised(balanced, operators)[0].state)
            now = stepper.rest(placed(system, state, at)).now
            out.append(replace(now, near=last.near) if last else now)
        return tuple(out)

    def again(self, beside: Sequence[Converged], time: float) -> tuple[Converged, ...]:
        """See `solver.loading.stepper.Followers`."""
        both = zip(beside, self._times(time), strict=False)
        return tuple(replace(each, state=replace(each.state, time=at)) for each, at in both)

    def followed(
        self, before: Converged, now: Converged, *, friction: bool = True
    ) -> tuple[Converged, ...]:
        """See `solver.loading.stepper.Followers`."""
        each = zip(self._steppers, before.beside, self._times(now.state.time), strict=False)
        try:
            with one_thread():
                operators = [_Shared(operator) for operator in self._system.tangents(now)]
                found = [
                    _next(stepper.system, own, at, now, operators, friction=friction)
                    for stepper, own, at in each
                ]
        except (IncrementFailed, Singular):
            return ()
        return tuple(
            replace(own, near=min(last.near, nearest(found[0][1], away)))
            for last, (own, away) in zip(before.beside, found, strict=False)
        )

    def alone(self, number: int, own: Converged, run: Converged) -> Converged:
        """Return an increment of a neighbour, by the solver of runs, from the end of the run's.

        Only the start of ``own``, the increment as it has followed, is used: not its end, nor the
        tangent and the active sets that led there. Stiffnesses of elastic bodies, which decide the
        steps and not where they lead, are those of the run: they are factorised.

        Parameters
        ----------
        number : of the neighbour; 0 for the run itself
        run : the same increment of the run

        Raises
        ------
        IncrementFailed
            if it does not converge to the tolerance that a difference needs
        """
        system, end = copy(self._steppers[number].system), run.state
        system.operators = self._system.operators
        limit = max(_TIGHT, rounding(system, end.u) / (end.force_scale or np.inf))
        found = Increment(
            system,
            own.start,
            own.state.time,
            guess=end,
            contact=not own.separated,
            elastic_first=False,
            tolerances=Tolerances(residual=limit, contact=limit),
        ).solve()
        return replace(found, energy=own.energy, near=own.near)


def _check_alike(name: str, system: System, other: System) -> None:
    """Raise `ModelError` unless two systems have the same elements, unknowns and slaves."""
    what = ""
    for one, two in zip(system.parts, other.parts, strict=True):
        same = type(one) is type(two) and one.n == two.n and np.array_equal(one.active, two.active)
        if same and isinstance(one, Discretisation) and isinstance(two, Discretisation):
            same = np.array_equal(one.dofs, two.dofs)
        what = what if same else f"the elements of {one.body.name}"
    for a, b in zip(system.interfaces, other.interfaces, strict=True):
        what = what if (a.slave, a.master) == (b.slave, b.master) else "the slave of a contact"
    if what:
        raise ModelError(name, what, "must not change: derivatives are taken by this parameter")


class _Shared:
    """An operator that keeps its last compliance: that of the neighbours is mostly the same."""

    def __init__(self, operator: Operator) -> None:
        self.begin = operator.begin
        self._operator = operator
        self._known: tuple[Ints, Array, Array] | None = None

    def compliance(self, dofs: Ints, rows: Array) -> Array:
        """See `Operator`."""
        known = self._known
        if known and np.array_equal(known[0], dofs) and np.array_equal(known[1], rows):
            return known[2]
        W = self._operator.compliance(dofs, rows)
        self._known = dofs, rows, W
        return W


def _next(
    system: System,
    before: Converged,
    time: float,
    run: Converged,
    operators: Sequence[Operator],
    *,
    friction: bool,
) -> tuple[Converged, Array]:
    """Return the next increment of a neighbour, given that of the run, and its `distances`."""
    increment = Increment(
        system,
        _started(system, before.state, run.start),
        time,
        contact=not run.separated,
        friction=friction,
    )
    now, candidates = increment.linearised(run, operators)
    now = replace(now, energy=worked(system, before, now, run.energy.scale))
    return now, distances(system, now, candidates)


def _started(system: System, own: State, run: State) -> State:
    """Return the state in which an increment of a neighbour starts.

    As in the run, pairs may have become finite, or present, and rates unknown.
    """
    contacts = []
    for interface, mine, its in zip(system.interfaces, own.contacts, run.contacts, strict=True):
        gap = mine.gap
        if np.isfinite(its.gap).any() and not np.isfinite(gap).any():
            gap = interface.pairing(own.u, run.time, finite=its.finite).gap
        contacts.append(replace(
            mine, finite=its.finite, touching=its.touching, status=its.status, gap=gap,
            rates=_where(its.rates, mine.rates), earlier=_where(its.earlier, mine.earlier),
        ))  # fmt: skip
    return replace(own, contacts=tuple(contacts), force_scale=run.force_scale)


def _where(known: Array, values: Array) -> Array:
    return np.where(np.isnan(known), np.nan, values)


def distances(system: System, now: Converged, candidates: Candidates) -> Array:
    """Return the distances (n,) of an increment from all switches, over their scales.

    They are NaN where there is no switch. The scales are the yield stress, the largest displacement
    before and after the increment, and the level of forces.
    """
    found = [*_of_flow(system, now), *_of_contact(now, candidates)]
    return np.concatenate([np.zeros(0), *(each.ravel() for each in found)])


def nearest(own: Array, other: Array) -> float:
    """Return the distance of the nearest switch, in differences of the parameter of a neighbour.

    Parameters
    ----------
    own, other : distances (n,) of the run and of the neighbour
    """
    with np.errstate(invalid="ignore"):
        change = np.abs(other - own)
    moves = change > _NOISE
    return float((np.abs(own[moves]) / change[moves]).min(initial=np.inf))


def _of_flow(system: System, now: Converged) -> Iterator[Array]:
    """Yield for each body: stress below yield, or flow; of flow with corners, also from these."""
    each = zip(system.parts, now.start.plastic, now.responses, strict=True)
    for part, before, response in each:
        if not isinstance(part, Discretisation) or part.body.law.elastic:
            continue
        law, after = part.law(now.state.time), response.state
        strength, stiffness = law.yield_stress, 2 * law.elasticity.shear_modulus
        flow = stiffness * (after.accumulated - before.accumulated)
        yield (-law.yield_value(response.stress, after) - flow) / strength
        if law.surface.has_corners:
            high, middle, low = principal(response.stress - law.back_stress(after))[0]
            aside = stiffness * principal(after.plastic_strain - before.plastic_strain)[0][1]
            edges = np.stack([high - middle - aside.clip(0), middle - low + aside.clip(None, 0)])
            yield np.where(response.yielding, edges / strength, np.nan)


def _of_contact(now: Converged, candidates: Candidates) -> Iterator[Array]:
    """Yield for each pair: gap or normal force; shear below its bound, or slip; lines of bounds."""
    every = (*now.start.u, *now.state.u)
    length = max((float(np.abs(u).max(initial=0.0)) for u in every), default=0.0) or 1.0
    force, n = now.state.force_scale or 1.0, candidates.n
    normal, status = candidates.forces[:n], candidates.status
    found = [candidates.motion[:n] / length - normal / force]
    if candidates.frictional:
        lines = candidates.lines.slope * normal + candidates.lines.level
        below = candidates.lines.least(normal) - np.abs(candidates.forces[candidates.along])
        slip, slides = np.abs(candidates.motion[candidates.along]), status > STICK
        found.append(np.where(slides, -slip / length, below / force))
        found[-1][status == OPEN] = np.nan
        found += [np.where(slides, each / force, np.nan) for each in np.diff(lines, axis=0)]
    for vertices, here, gap in zip(
        candidates.vertices, candidates.places, candidates.gaps, strict=True
    ):
        whole = np.full((len(found), len(gap)), np.nan)
        whole[:, vertices] = [each[here] for each in found]
        yield whole
