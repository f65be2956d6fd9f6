"""Solve an increment in windows of its bodies, outside of which nothing yields.

Few elements of a body yield; iterations on the whole body would mostly repeat elastic work. An
increment is therefore first solved in windows around the yielding elements, the rest condensed
(`solver.fem.window`), and then checked on the whole bodies. If elements outside have yielded, the
windows grow. A window serves all increments until elements outside yield.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from solver.contact.candidates import Candidates, find_candidates
from solver.contact.state import Converged, State
from solver.contact.system import System
from solver.fem.discretisation import Discretisation
from solver.fem.part import Part
from solver.fem.window import Region, Windowed
from solver.linear.solvers import Singular
from solver.loading.increment import Balanced, Increment
from solver.loading.outcome import IncrementFailed
from solver.loading.program import Tolerances
from solver.materials import Response
from solver.typing import Array, Bools

Yields = list[Bools | None]


_LAYERS = 5
"""Number of layers of elements around the yielding ones, in a new window."""
_LARGE = 0.5
"""Elements of a window over those of the body: a window above this ratio saves too little."""
_ROUNDS = 4
"""Most attempts in windows per increment; windows grow between them."""


class FailedInWindows(IncrementFailed):
    """The increment failed in windows. This proves no limit load: whole bodies may converge."""


def narrowed(
    system: System,
    before: Converged,
    start: State,
    time: float,
    *,
    guess: State | None,
    patient: bool,
    tolerances: Tolerances,
) -> Converged | None:
    """Return an increment from ``start`` to ``time`` that was solved in windows.

    None if windows are unsuitable: there are links, a body is linear nowhere or pressures follow
    it, nothing yields, windows would be large or grow too often, a body loses its contacts, or the
    whole bodies are not in balance. Raises `FailedInWindows` if the increment fails in them.

    Parameters
    ----------
    before : the last increment, which ended at ``start``
    guess : predicted state, if any
    """
    if len(system.links) or not all(part.narrows for part in system.parts):
        return None
    windows = before.windows or (None,) * len(system.parts)
    begin, count = system.moved(start, time), np.zeros(3, dtype=int)
    at, elastic_first = system.moved(guess or start, time), guess is None
    each = zip(system.parts, at.u, start.plastic, strict=True)
    responses = tuple(part.respond(u, plastic, time) for part, u, plastic in each)
    own, had = [response.law for response in responses], before.responses
    both = zip(_yields(system, own), _yields(system, had), strict=True)
    yields: Yields = [now if now is None or was is None else now | was for now, was in both]
    flows = any(own is not None and own.any() for own in yields)
    if not (before.windows or flows or system.model.large):
        return None
    touched: Candidates | None = None  # unknown until contact leaves the windows (`Singular`)
    needed = _needed(system, touched, yields)
    compliance: dict[tuple[bytes, ...], Array] = {}
    for _ in range(_ROUNDS):
        if touched is None and not _hold(windows, needed):
            touched = find_candidates(system, start, at.u, at.contacts, at.links, time - start.time)
            needed = _needed(system, touched, yields)
        windows = tuple(_around(system, k, windows[k], need) for k, need in enumerate(needed))
        if not any(windows):
            return None
        parts = tuple(
            part
            if region is None
            else system.window(number, region).at(begin.u[number], start.plastic[number], time)
            for number, (part, region) in enumerate(zip(system.parts, windows, strict=True))
        )
        try:
            found = Increment(
                system.within(parts),
                _inside(start, parts),
                time,
                guess=_inside(at, parts),
                elastic_first=elastic_first,
                patient=patient,
                tolerances=tolerances.patient,
                compliance=compliance,
            ).approach()
        except Singular:
            if touched is not None:
                return None
            windows = (None,) * len(windows)
            continue
        except IncrementFailed as failure:
            raise FailedInWindows(str(failure)) from failure
        if _loose(system, found):
            return None
        count += (found.iterations, found.pivoted, found.blended)
        found = _expanded(system, start, time, parts, found)
        at, elastic_first = replace(at, u=found.u, contacts=found.contacts), False
        yields = _yields(system, [response.law for response in found.responses])
        inside = zip(windows, yields, strict=True)
        if all(w is None or y is None or not (y & ~w.elements).any() for w, y in inside):
            iterations, pivoted, blended = count.tolist()
            found = replace(found, iterations=iterations, pivoted=pivoted, blended=blended)
            whole = Increment(system, start, time, tolerances=tolerances, compliance=compliance)
            converged = whole.closed(found)
            return converged and replace(converged, windows=windows)
        touched = found.candidates
        needed = _needed(system, touched, yields)
    return None


def _loose(system: System, found: Balanced) -> bool:
    """Whether a body held by contact has lost it; only whole bodies then keep its position."""
    pairs = zip(system.interfaces, found.contacts, strict=True)
    return any(interface.floating and not state.normal.any() for interface, state in pairs)


def _expanded(
    system: System, start: State, time: float, parts: tuple[Part, ...], found: Balanced
) -> Balanced:
    """Return an iterate of windows as one of the whole bodies, with their contact candidates."""
    expanded = zip(parts, found.u, strict=True)
    u = tuple(p.expand(v, time) if isinstance(p, Windowed) else v for p, v in expanded)
    each = zip(system.parts, u, start.plastic, strict=True)
    responses = tuple(part.respond(ui, plastic, time) for part, ui, plastic in each)
    forces = zip(system.parts, u, responses, strict=True)
    return replace(
        found,
        u=u,
        responses=responses,
        residuals=tuple(part.residual(time, ui, response) for part, ui, response in forces),
        candidates=find_candidates(
            system, start, u, found.contacts, start.links, time - start.time
        ),
    )


def _yields(system: System, responses: Sequence[Response]) -> Yields:
    """Return for each meshed part which elements (n_elements,) yield; None for other parts."""
    each = zip(system.parts, responses, strict=True)
    return [
        np.asarray(response.yielding.reshape(part.weights.shape).any(axis=1))
        if isinstance(part, Discretisation)
        else None
        for part, response in each
    ]


def _hold(windows: Sequence[Region | None], needed: Sequence[Region | None]) -> bool:
    """Whether the windows contain the regions ``needed``."""
    both = zip(windows, needed, strict=True)
    return all(need is None or (own is not None and own.has(need)) for own, need in both)


def _needed(system: System, touched: Candidates | None, yields: Yields) -> list[Region | None]:
    """Return the region in which each meshed part yields and, if known, touches."""
    needed: list[Region | None] = []
    for number, elements in enumerate(yields):
        if elements is None:
            needed.append(None)
            continue
        contact = np.zeros(system.parts[number].n, dtype=bool)
        if touched is not None:
            contact[touched.touched(number)] = True
        needed.append(Region(elements, contact))
    return needed


def _around(
    system: System, number: int, window: Region | None, need: Region | None
) -> Region | None:
    """Return the present window if it contains ``need``, else a new one; None if it is large."""
    part = system.parts[number]
    if need is None or not isinstance(part, Discretisation):
        return None
    if window is None or not window.has(need):
        window = Region.around(part, system.surfaces[number], need, _LAYERS)
    return window if 0 < window.elements.mean() < _LARGE else None


def _inside(state: State, parts: tuple[Part, ...]) -> State:
    """Return a state with the unknowns and the points of the windows."""
    u, plastic = list(state.u), list(state.plastic)
    for k, part in enumerate(parts):
        if isinstance(part, Windowed):
            u[k], plastic[k] = u[k][part.kept], plastic[k].at(part.inside)
    return replace(state, u=tuple(u), plastic=tuple(plastic))
