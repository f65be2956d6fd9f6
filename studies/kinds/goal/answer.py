"""What a study with a goal finds: the data set of its answers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from solver.results.shakedown import ShakedownState
from studies.definition.cases import Case
from studies.definition.identity import canonical
from studies.definition.quantity import number_of_a_run
from studies.definition.study import Study
from studies.definition.vocabulary import (
    ERROR,
    MISSING,
    NO_EQUILIBRIUM,
    OK,
    STOPPED,
)
from studies.kinds.goal.search import ALREADY, FAILED, NEVER, PASSED, REFUSED, Search
from studies.kinds.kind import Answers
from studies.storage import dataset as layout
from studies.storage.dataset import Variable


def answers(study: Study, searches: list[Search]) -> Answers:
    """Return an answer for each place of the axes."""
    outcomes = [_outcome(study, search) for search in searches]
    runs = [[search.reason, list(search.rows.values())] for search in searches]
    return Answers(
        content=lambda: _content(study, searches, outcomes),
        outcomes=[
            (_run(search, search.high), *outcome)
            for search, outcome in zip(searches, outcomes, strict=True)
        ],
        of=canonical([outcomes, runs]),
    )


def _outcome(study: Study, search: Search) -> tuple[str, str]:
    """Return the status of an answer, and the reason of one that is not as it was asked for."""
    goal, reason = search.goal, search.reason
    name, first, last = goal.parameter, *goal.between
    if reason == PASSED or (reason == NO_EQUILIBRIUM[0] and not goal.of):
        return OK, _doubt(search)
    if reason in NO_EQUILIBRIUM:
        before = "; it comes before the goal" if goal.of else ""
        return (
            reason,
            f"at {name} = {search.high:.6g}{before}: {search.rows[search.high]['message']}",
        )
    if reason == NEVER and goal.kind == "at":
        each = [f"{search.look(end).value:.6g} at {name} = {end:.6g}" for end in goal.between]
        never = f"it does not reach {goal.threshold:.6g} in between"
        return MISSING, f"{goal.of} is {' and '.join(each)}: {never}"
    if reason == NEVER:
        return MISSING, f"at {name} = {last:.6g} the goal is not reached{_number(search, last)}"
    if reason == ALREADY and search.look(first).status in NO_EQUILIBRIUM:
        row = search.rows[first]
        return MISSING, f"at {name} = {first:.6g} there is no equilibrium: {_told(row)}"
    if reason == REFUSED:
        return ERROR, f"at {name} = {search.high:.6g}: {search.refusal}"
    if reason == ALREADY:
        return MISSING, f"at {name} = {first:.6g} the goal has been passed{_number(search, first)}"
    if reason == FAILED:
        row = search.rows[search.high]
        status = study.taken(row["status"])
        lacks = f"its run has no {goal.of}" if status == OK else row["message"]
        return ERROR if status == OK else status, f"at {name} = {search.high:.6g}: {lacks}"
    return MISSING, STOPPED


def _doubt(search: Search) -> str:
    """Return why an answer may be too low: its upper end is beyond for want of passes alone."""
    goal, high = search.goal, search.high
    if goal.of != "shakedown_state" or search.look(high).value != ShakedownState.UNDECIDED:
        return ""
    found = f"at {goal.parameter} = {high:.6g} the state is undecided"
    return f"{found}: the limit may be higher, compute more passes or cycles"


def _told(row: Mapping[str, Any]) -> str:
    return ": ".join(filter(None, (row["status"], row["message"])))


def _number(search: Search, value: float) -> str:
    number = search.look(value).value
    return "" if number is None else f": {search.goal.of} = {number:.6g}"


def _run(search: Search, value: float) -> str:
    return str(search.rows[value]["id"]) if value in search.rows else ""


def _content(
    study: Study, found: list[Search], outcomes: list[tuple[str, str]]
) -> dict[str, Variable]:
    """Return the variables of the data set of the answers.

    Its dimensions are those that a data set of the runs would have, without the parameter that was
    searched; and ``tried``, the runs of each search in increasing order of the parameter.
    """
    from studies.storage.frame import axis_variables  # h5netcdf: a complete study needs it not

    scene, goal, cases = study.problem, found[0].goal, list(study.cases())
    name, linked = goal.parameter, study.linked
    usual = [each for each in layout.usual_dimensions(scene) if each not in {name, *linked}]
    first = cases[0].values
    axes = {each: [first[each]] for each in usual} | study.axes
    shape = tuple(map(len, axes.values()))
    beside = {"coordinates": " ".join(linked)} if linked else {}
    words = layout.axis_attributes(scene, name)
    unit = {key: words[key] for key in words.keys() & {"units"}}
    order = _order(study, cases, list(axes), shape)
    searches = [found[k] for k in order]
    variables: dict[str, Variable] = axis_variables(scene, axes, linked)

    def add(key: str, values: list[Any], kind: Any, attrs: Mapping[str, Any]) -> None:
        array = np.array(values, dtype=kind).reshape(shape)
        variables[key] = Variable(tuple(axes), array, {**attrs, **beside})

    for k, key in enumerate(("status", "message")):
        texts = [outcomes[each][k] for each in order]
        add(key, texts, object, layout.attributes_of(key))
    meaning = f"{name.replace('_', ' ')} at which the goal is reached"
    add(name, [each.found for each in searches], float, {**unit, "long_name": meaning})
    for end in ("low", "high"):
        words = {"long_name": f"{end} end of the bracket of {name}"}
        add(f"{name}_{end}", [getattr(each, end) for each in searches], float, {**unit, **words})
    add(
        "runs", [len(each.rows) for each in searches], np.int32, {"long_name": "runs of the search"}
    )
    for end in ("low", "high"):
        words = {"long_name": f"id of the run at the {end} end"}
        add(f"run_{end}", [_run(each, getattr(each, end)) for each in searches], object, words)
    units = {name: unit}
    if goal.of:
        units[goal.of] = {"units": number_of_a_run(goal.of, scene)[0]}
    variables |= _tried(searches, tuple(axes), shape, units, beside)
    return variables


def _tried(
    searches: list[Search],
    dims: tuple[str, ...],
    shape: tuple[int, ...],
    units: Mapping[str, Mapping[str, str]],
    beside: Mapping[str, str],
) -> dict[str, Variable]:
    """Return the runs of the searches: value of the parameter, number, status and id."""
    goal = searches[0].goal
    most = max((len(each.rows) for each in searches), default=0)
    kinds = {goal.parameter: float, goal.of or "number": float, "status": object, "run": object}
    tried = {
        key: np.full((len(searches), most), np.nan if kind is float else "", dtype=kind)
        for key, kind in kinds.items()
    }
    for k, search in enumerate(searches):
        for j, value in enumerate(sorted(search.rows)):
            look = search.look(value)
            number = np.nan if look.value is None else look.value
            for key, each in zip(tried, (value, number, look.status, look.run), strict=True):
                tried[key][k, j] = each
    found = {"tried": Variable(("tried",), np.arange(most), {"long_name": "number of the run"})}
    for key, values in tried.items():
        words = {"long_name": f"{key.replace('_', ' ')} of the runs of the search"}
        own = {**words, **units.get(key, {}), **(beside if key == goal.parameter else {})}
        found[f"tried_{key}"] = Variable((*dims, "tried"), values.reshape(*shape, most), own)
    return found


def _order(study: Study, cases: list[Case], dims: list[str], shape: tuple[int, ...]) -> list[int]:
    """Return the numbers of the places in the order of the data set."""
    at = [dict(zip(study.axes, case.index, strict=True)) for case in cases]
    flat = [
        int(np.ravel_multi_index([each.get(name, 0) for name in dims], shape)) if dims else 0
        for each in at
    ]
    return [int(k) for k in np.argsort(flat)]
