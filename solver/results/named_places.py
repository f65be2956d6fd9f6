"""Named places and the values stored there: lines, points, contacts, requested numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from solver.results.acting import contact_result
from solver.results.contact import contacts
from solver.results.increments import over_increments
from solver.results.places import along_lines, at_points
from solver.results.requested import RequestedNumber
from solver.results.run import FinishedRun, Values
from solver.results.view import Places


class NamedPlaces(NamedTuple):
    """Named places in addition to the view of a scene, and requested numbers.

    Attributes
    ----------
    lines, points : places by name, in the order of their dimensions
    contacts : names of the contact pairs
    numbers : numbers requested of every run
    samples : number of positions along each contact; 0 if contact is stored along the view
    """

    lines: Mapping[str, Places]
    points: Mapping[str, Places]
    contacts: Sequence[str]
    numbers: Sequence[RequestedNumber]
    samples: int


def at_named_places(run: FinishedRun, places: NamedPlaces, times: Sequence[float]) -> Values:
    """Return all values stored at named places, and after each increment.

    Parameters
    ----------
    times : initial time, and the times at which the increments of the program end; empty for a run
        without increments
    """
    system: Any = run.system
    fields = run.samples.fields
    states: list[Any] = [state for state, _ in run.stages]
    stored = bool(places.samples) or any(number.contact for number in places.numbers)
    names = places.contacts if stored else ()
    results = [[contact_result(system, at, k) for at in states] for k in range(len(names))]
    out: dict[Any, Any] = {}
    if places.lines:
        out |= along_lines(fields, places.lines, states)
    if places.points:
        out |= at_points(fields, places.points, states)
    if places.contacts and places.samples:
        out |= contacts(results, places.contacts, places.samples)
    if times:
        out |= over_increments(run.outcome.history, times, system.all_names, places.contacts)
    for number in places.numbers:
        k = run.view.stages.index(number.stage)
        before = states[run.view.stages.index(number.minus)] if number.minus else None
        if number.course:
            since = None if before is None else before.state.time
            out |= number.at_increments(out, states[k].state.time, since)
            continue
        acting = {name: of[k] for name, of in zip(names, results, strict=True)}
        out |= number.values(fields, states[k], places.lines, acting, before)
    return out
