"""The runs that a study with a goal asks for, and what it finds.

The searches at the places of the axes go on each by itself: as soon as the runs of one round are
known, those of the next one are handed to the workers.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from studies.appearing import appearing
from studies.definition.cases import Case, LoadingPath
from studies.definition.expansion import Expansion
from studies.definition.goal import ALREADY, FAILED, NEVER, NO_EQUILIBRIUM, PASSED, Limit, Search
from studies.definition.identity import canonical
from studies.definition.study import Study
from studies.definition.sweep import Axes, owners
from studies.definition.vocabulary import ERROR, KEEP, MISSING, OK, SOLVED, SYMMETRIC
from studies.storage import dataset as layout
from studies.storage import runfile, seal
from studies.storage.dataset import RunContent, Variable
from studies.storage.frame import axis_variables
from studies.storage.held import Combined
from studies.storage.made import Made
from studies.storage.provenance import provenance
from studies.storage.room import needs_room
from studies.storage.store import Store

_NAME = "data set"


class Goals:
    """The searches of a study.

    Parameters
    ----------
    study : a study with a goal
    store : the runs that are there are not computed again
    resume, since : as in `run_study`: which failed runs are taken as they are
    """

    def __init__(self, study: Study, store: Store, resume: bool = False, since: int = 0) -> None:
        assert study.asks is not None
        self._study, self._store, self._resume, self._since = study, store, resume, since
        self.places = list(study.cases())
        self.searches = [Search(study.asks) for _ in self.places]
        self._swept = owners(study.sweep)
        self._asked: dict[str, tuple[int, float]] = {}
        self._waits: list[set[float]] = [set() for _ in self.places]
        self._ready: deque[tuple[LoadingPath, Limit]] = deque()
        for number in range(len(self.searches)):
            self._go_on(number)

    @property
    def ended(self) -> bool:
        """Whether all searches have ended."""
        return all(search.reason for search in self.searches)

    @property
    def progress(self) -> float:
        """Share of all searches that is done, 0 to 1."""
        return float(np.mean([search.progress for search in self.searches]))

    def paths(self) -> Iterator[tuple[LoadingPath, Limit] | None]:
        """Yield loading paths and what ends them; None while all wait for runs."""
        while not self.ended:
            yield self._ready.popleft() if self._ready else None

    def heard(self, row: Mapping[str, Any]) -> None:
        """Tell the search that asked for a run of its row."""
        if row["id"] in self._asked:
            number, value = self._asked.pop(row["id"])
            self._waits[number].discard(value)
            if value in self.searches[number].wants:
                self.searches[number].tell(value, row)
                self._go_on(number)

    def place(self, run_id: str) -> str:
        """Return where a run is that was asked for, and the round of its search, as text."""
        assert self._study.asks is not None
        number, value = self._asked[run_id]
        at = [f"{name} = {each}" for name, each in self._study.place(self.places[number]).items()]
        search = self.searches[number]
        rounds = f"round {search.rounds + 1} of at most {search.goal.most[0]}"
        return ", ".join([*at, f"{search.goal.parameter} = {value:.6g}"]) + f" ({rounds})"

    def _go_on(self, number: int) -> None:
        """Take the runs of a search that are in the store, and ask for those that are not."""
        search = self.searches[number]
        while wanted := [each for each in search.wants if each not in self._waits[number]]:
            expansion = self._expansion(number, wanted)
            cases = {case.id: case for case in expansion.cases()}
            rows = self._store.sound(cases)
            told = False
            for run_id, case in cases.items():
                value = case.values[search.goal.parameter]
                if run_id in rows and self._stands(rows[run_id]) and value in search.wants:
                    search.tell(value, rows[run_id])
                    told = True
            if not told:
                for path in expansion.paths():
                    self._ask(number, path)
                return

    def _ask(self, number: int, path: LoadingPath) -> None:
        search = self.searches[number]
        # rounds share the id of a path, and a new one may begin before the last has ended
        path = replace(path, id=path.cases[0].id)
        for case in path.cases:
            value = case.values[search.goal.parameter]
            self._asked[case.id] = number, value
            self._waits[number].add(value)
        self._ready.append((path, search.limit))

    def _expansion(self, number: int, values: list[float]) -> Expansion:
        place = self.places[number].values
        fixed = self._study.parameters | {name: place[name] for name in self._swept}
        axes: Axes = {self.searches[number].goal.parameter: list(values)}
        return Expansion(self._study.problem, fixed, axes)

    def _stands(self, row: Mapping[str, Any]) -> bool:
        """Whether a run in the store is taken as it is."""
        if row["status"] in SOLVED:
            return self._study.keep in ("", row[KEEP])
        failed = self._resume and row["modified"] >= self._since
        return row["status"] in NO_EQUILIBRIUM or failed


def answers(study: Study, store: Store, goals: Goals) -> Combined:
    """Write the data set of a study with a goal, unless there is one with the same answers."""
    path, made = store.dataset_path(study.id), Made(study, store)
    outcomes = [_outcome(study, search) for search in goals.searches]
    runs = [[search.reason, list(search.rows.values())] for search in goals.searches]
    of = canonical([outcomes, runs])
    counts = Counter(status for status, _ in outcomes)
    failed = [
        (_run(search, search.high), *outcome)
        for search, outcome in zip(goals.searches, outcomes, strict=True)
        if outcome[0] != OK
    ]
    anew = made.kept(_NAME, of) is None
    if anew:
        content = runfile.packed(_content(study, goals, outcomes))
        with needs_room(store.directory), appearing(path) as part:
            part.write_bytes(seal.sealed(f"dataset {study.id}", content))
        made.note(_NAME, of, [path.name])
    return Combined(path=path, counts=dict(counts), failed=failed, missing=(), anew=anew)


def _outcome(study: Study, search: Search) -> tuple[str, str]:
    """Return the status of an answer, and the reason of one that is not as it was asked for."""
    goal, reason = search.goal, search.reason
    name, first, last = goal.parameter, *goal.between
    if reason == PASSED or (reason == NO_EQUILIBRIUM[0] and not goal.of):
        return OK, ""
    if reason in NO_EQUILIBRIUM:
        before = "; it comes before the goal" if goal.of else ""
        return (
            reason,
            f"at {name} = {search.high:.6g}{before}: {search.rows[search.high]['message']}",
        )
    if reason == NEVER:
        return MISSING, f"at {name} = {last:.6g} the goal is not reached{_number(search, last)}"
    if reason == ALREADY:
        return MISSING, f"at {name} = {first:.6g} the goal has been passed{_number(search, first)}"
    if reason == FAILED:
        row = search.rows[search.high]
        status = study.taken(row["status"])
        lacks = f"its run has no {goal.of}" if status == OK else row["message"]
        return ERROR if status == OK else status, f"at {name} = {search.high:.6g}: {lacks}"
    return MISSING, "stopped before its end"


def _number(search: Search, value: float) -> str:
    number = search.look(value).value
    return "" if number is None else f": {search.goal.of} = {number:.6g}"


def _run(search: Search, value: float) -> str:
    return str(search.rows[value]["id"]) if value in search.rows else ""


def _content(study: Study, goals: Goals, outcomes: list[tuple[str, str]]) -> RunContent:
    """Return the content of the data set of the answers.

    Its dimensions are those that a data set of the runs would have, without the parameter that was
    searched; and ``tried``, the runs of each search in increasing order of the parameter.
    """
    scene, goal = study.problem, goals.searches[0].goal
    name, linked = goal.parameter, study.linked
    usual = [each for each in layout.usual_dimensions(scene) if each not in {name, *linked}]
    place = goals.places[0].values
    axes = {each: [place[each]] for each in usual} | study.axes
    shape = tuple(map(len, axes.values()))
    beside = {"coordinates": " ".join(linked)} if linked else {}
    attributes = layout.axis_attributes(scene, name)
    unit = {key: attributes[key] for key in attributes.keys() & {"units"}}
    order = _order(study, goals.places, list(axes), shape)
    searches = [goals.searches[k] for k in order]
    variables: dict[str, Variable] = axis_variables(scene, axes, linked)

    def add(key: str, values: list[Any], kind: Any, attrs: Mapping[str, Any]) -> None:
        array = np.array(values, dtype=kind).reshape(shape)
        variables[key] = Variable(tuple(axes), array, {**attrs, **beside})

    for k, key in enumerate(("status", "message")):
        texts = [outcomes[each][k] for each in order]
        add(key, texts, object, layout.attributes_of(key))
    meaning = f"{attributes.get('long_name', name)} at which the goal is reached"
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
    variables |= _tried(searches, tuple(axes), shape, {**unit, **beside})
    attrs = provenance(study.name, scene, study.fixed) | {"goal": canonical(study.goal)}
    words = {"note": study.note, "tags": " ".join(study.tags)}
    attrs |= {key: text for key, text in words.items() if text}
    return RunContent(variables, {**attrs, "id": study.id, SYMMETRIC: 0})


def _tried(
    searches: list[Search], dims: tuple[str, ...], shape: tuple[int, ...], attrs: Mapping[str, Any]
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
        own = {**words, **(attrs if key == goal.parameter else {})}
        found[f"tried_{key}"] = Variable((*dims, "tried"), values.reshape(*shape, most), own)
    return found


def _order(study: Study, places: list[Case], dims: list[str], shape: tuple[int, ...]) -> list[int]:
    """Return the numbers of the places in the order of the data set."""
    at = [dict(zip(study.axes, place.index, strict=True)) for place in places]
    flat = [
        int(np.ravel_multi_index([each.get(name, 0) for name in dims], shape)) if dims else 0
        for each in at
    ]
    return [int(k) for k in np.argsort(flat)]
