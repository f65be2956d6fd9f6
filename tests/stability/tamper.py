"""Ways to spoil a right answer, for tests of the oracles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from solver import Solution
from solver.contact.state import Converged
from tests.stability.kinds import reopening, rolling

Tamper = Callable[[Converged], Converged]


def forces(
    normal: float = 1.0,
    tangential: float = 1.0,
    least: float | None = None,
    all_: float = 0.0,
    across: float = 0.0,
) -> Tamper:
    """Change the contact forces, by factors, by what is added, or at the least pressed point."""

    def change(converged: Converged) -> Converged:
        contacts = []
        for contact in converged.state.contacts:
            N = contact.normal * normal + all_
            if least is not None:
                N[N.argmin()] = least
            T = contact.tangential * tangential + across
            contacts.append(replace(contact, normal=N, tangential=T))
        return replace(converged, state=replace(converged.state, contacts=tuple(contacts)))

    return change


def moved(axis: int, by: float, only: int | None = None) -> Tamper:
    """Displace the first body, or one of its nodes."""

    def change(converged: Converged) -> Converged:
        first, *others = converged.state.u
        first = first.copy()
        first[slice(axis, None, 2) if only is None else 2 * only + axis] += by
        return replace(converged, state=replace(converged.state, u=(first, *others)))

    return change


def stressed(factor: float = 1.0, out_of_plane: float = 0.0, point: int | None = None) -> Tamper:
    """Change the stress of the first body, or of one of its points."""

    def change(converged: Converged) -> Converged:
        first, *others = converged.responses
        stress = first.stress.copy()
        at = slice(None) if point is None else point
        stress[:, at] *= factor
        stress[2, at] += out_of_plane
        return replace(converged, responses=(first._replace(stress=stress), *others))

    return change


def with_state(solution: Solution, stage: str, state: Converged) -> Solution:
    """Put another state in the place of that of a stage."""
    return replace(solution, stages={**solution.stages, stage: state})


def loaded(tamper: Tamper) -> Callable[[Solution], Solution]:
    """Apply to the loaded state."""
    return lambda s: with_state(s, "loaded", tamper(s.loaded))


def unloaded(tamper: Tamper) -> Callable[[Solution], Solution]:
    """Apply to the unloaded state."""
    return lambda s: with_state(s, "unloaded", tamper(s.unloaded))


def not_released(solution: Solution) -> Solution:
    """Leave the load on."""
    return with_state(solution, "unloaded", solution.loaded)


def free_energy(solution: Solution) -> Solution:
    """Let plastic work be negative."""
    return replace(solution, tally=replace(solution.tally, plastic_work=-1e3))


def cycle(which: str, tamper: Tamper) -> Callable[[reopening.Cycles], reopening.Cycles]:
    """Apply to the last cycle."""

    def change(cycles: reopening.Cycles) -> reopening.Cycles:
        states = getattr(cycles, which)
        return replace(cycles, **{which: [*states[:-1], tamper(states[-1])]})

    return change


def in_heavy(tamper: Tamper) -> Callable[[tuple], tuple]:
    """Apply to the heavier of two solutions."""
    return lambda pair: (pair[0], loaded(tamper)(pair[1]))


def rolled(tamper: Tamper) -> Callable[[rolling.Rolled], rolling.Rolled]:
    """Apply to the state at mid-track."""
    return lambda r: replace(r, loaded=tamper(r.loaded))


def recorded(
    name: str, change: Callable[[np.ndarray], np.ndarray]
) -> Callable[[rolling.Rolled], rolling.Rolled]:
    """Change a field of the record, or a scalar."""

    def tamper(rolled: rolling.Rolled) -> rolling.Rolled:
        record = rolled.record
        if name in record.scalars:
            scalars = dict(record.scalars) | {name: change(record.scalars[name])}
            return replace(rolled, record=replace(record, scalars=scalars))
        dims, values = record.fields[name]
        fields = dict(record.fields) | {name: (dims, change(values))}
        return replace(rolled, record=replace(record, fields=fields))

    return tamper


def last_stressed(converged: Converged) -> Converged:
    """Raise the stress of the last body."""
    *others, last = converged.responses
    return replace(converged, responses=(*others, last._replace(stress=last.stress * 1.5)))


def not_lifted(rolled: rolling.Rolled) -> rolling.Rolled:
    """Leave the wheel on the track, and take back what flowed."""
    loaded, first = rolled.loaded, rolled.loaded.responses[-1]
    state = replace(first.state, accumulated=first.state.accumulated + 1.0)
    flowed = replace(loaded, responses=(*loaded.responses[:-1], first._replace(state=state)))
    return replace(rolled, loaded=flowed, unloaded=loaded)
