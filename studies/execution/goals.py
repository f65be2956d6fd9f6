"""The runs that a study with a goal asks for, and what it finds.

The searches at the places of the axes go on each by itself: as soon as the runs of one round are
known, those of the next one are handed to the workers. A search along a path that goes on is the
task of one worker, which asks for its runs itself.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Collection, Iterator, Mapping
from copy import deepcopy
from dataclasses import replace
from itertools import takewhile
from typing import Any, NamedTuple

import numpy as np

from studies.appearing import appearing
from studies.definition.cases import Case, LoadingPath
from studies.definition.goal import (
    ALREADY,
    FAILED,
    NEVER,
    NO_EQUILIBRIUM,
    PASSED,
    REFUSED,
    STOPPED,
    PathLimit,
    Place,
    Search,
)
from studies.definition.identity import canonical
from studies.definition.study import Study
from studies.definition.sweep import owners
from studies.definition.vocabulary import ERROR, MISSING, OK, SYMMETRIC
from studies.storage import dataset as layout
from studies.storage import runfile, seal
from studies.storage.dataset import RunContent, Variable
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
    only : number of the one search that is to be carried out; by default all are
    """

    def __init__(
        self,
        study: Study,
        store: Store,
        resume: bool = False,
        since: int = 0,
        only: int | None = None,
    ) -> None:
        assert study.asks is not None
        self._study, self._store = study, store
        self.cases = [case for k, case in enumerate(study.cases()) if only in (None, k)]
        swept = owners(study.sweep)
        self.places = [
            Place(
                scene=study.problem,
                fixed=study.parameters | {name: case.values[name] for name in swept},
                search=Search(study.asks),
                keep=study.keep,
                resume=resume,
                since=since,
            )
            for case in self.cases
        ]
        self._paths: dict[str, tuple[int, list[float]]] = {}
        self._waits: list[set[float]] = [set() for _ in self.places]
        self._ready: deque[Asked] = deque()
        for number in range(len(self.places)):
            self._go_on(number)

    @property
    def searches(self) -> list[Search]:
        """The searches, in the order of the cases of the study."""
        return [place.search for place in self.places]

    @property
    def ended(self) -> bool:
        """Whether all searches have ended."""
        return all(search.reason for search in self.searches)

    @property
    def asked(self) -> list[str]:
        """Ids of the runs that the searches have asked for, as far as they are known."""
        return sorted({str(row["id"]) for each in self.searches for row in each.rows.values()})

    @property
    def stage(self) -> str:
        """How many of the searches have ended, as text."""
        return self._study.stage(sum(bool(each.reason) for each in self.searches))

    @property
    def progress(self) -> float:
        """Share of all searches that is done, 0 to 1."""
        return float(np.mean([search.progress for search in self.searches]))

    def paths(self) -> Iterator[Asked | None]:
        """Yield the loading paths that are asked for; None while all searches wait for runs."""
        while not self.ended:
            yield self._ready.popleft() if self._ready else None

    def heard(self, path: str, row: Mapping[str, Any]) -> None:
        """Tell the search of a loading path of the row of a run."""
        number = self._paths[path][0]
        place = self.places[number]
        self._waits[number].discard(row["parameters"][place.search.goal.parameter])
        if place.hear(row) and not place.search.goal.goes_on:
            self._go_on(number)

    def owed(self, path: str) -> Case | None:
        """Return the run that a path which goes on has to compute next; None if it owes none.

        Runs that it has stored are taken, also those of which it told nothing.
        """
        number = self._paths[path][0]
        place = self.places[number]
        wanted = self._lacking(number, ()) if place.search.goal.goes_on else []
        if not wanted or place.refusal(wanted[0]):
            return None
        return next(place.runs(wanted[:1]).cases())

    def stored(self, path: str, since: int) -> list[Mapping[str, Any]]:
        """Return the rows of the runs of a search that have been stored since a time [ns].

        Some may have been stored by a worker that died before it told of them.
        """
        rows = self.places[self._paths[path][0]].search.rows.values()
        return [row for row in rows if row["modified"] >= since]

    def closed(self, path: str) -> None:
        """Ask again for runs of which a path that has ended told nothing."""
        number, values = self._paths[path]
        self._waits[number].difference_update(values)
        self._go_on(number)

    def about(self, path: str, row: Mapping[str, Any]) -> str:
        """Return where a run is, and the round of its search, as text."""
        number = self._paths[path][0]
        search = self.places[number].search
        name, value = search.goal.parameter, row["parameters"][search.goal.parameter]
        at = [f"{axis} = {each}" for axis, each in self._study.place(self.cases[number]).items()]
        rounds = f"round {search.rounds + 1} of at most {search.goal.most[0]}"
        return ", ".join([*at, f"{name} = {value:.6g}"]) + f" ({rounds})"

    def _go_on(self, number: int) -> None:
        """Take the runs of a search that are in the store, and ask for those that are not."""
        place, waits = self.places[number], self._waits[number]
        lacking = self._lacking(number, waits)
        wanted = list(takewhile(lambda value: not place.refusal(value), lacking))
        if wanted:
            waits.update(wanted)
            for path in place.runs(wanted).paths():
                # rounds share the id of a path, and one may begin before the last has ended
                own = replace(path, id=path.cases[0].id)
                name = place.search.goal.parameter
                self._paths[own.id] = number, [case.values[name] for case in own.cases]
                self._ready.append(_asked(own, place))
        elif lacking and lacking[0] == place.search.wants[0]:
            place.search.refuse(lacking[0], place.refusal(lacking[0]))

    def _lacking(self, number: int, waits: Collection[float]) -> list[float]:
        """Take the runs of a search that are in the store; return the values of the others."""
        place = self.places[number]
        while wanted := [value for value in place.search.wants if value not in waits]:
            runs = place.runs(wanted)
            rows = self._store.sound([case.id for case in runs.cases()])
            stand = [rows[case.id] for case in runs.cases() if case.id in rows]
            if not sum(place.hear(row) for row in stand if place.stands(row)):
                return wanted
        return []


class Asked(NamedTuple):
    """A loading path that a search asks for.

    Either ``limit`` tells its last run, or it goes on, for as long as ``place`` asks for runs.
    """

    path: LoadingPath
    limit: PathLimit | None
    place: Place | None


def _asked(path: LoadingPath, place: Place) -> Asked:
    if place.search.goal.goes_on:
        own = replace(place, search=deepcopy(place.search))
        return Asked(replace(path, cases=()), None, own)
    return Asked(path, place.search.limit, None)


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


def _told(row: Mapping[str, Any]) -> str:
    return ": ".join(filter(None, (row["status"], row["message"])))


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
    from studies.storage.frame import axis_variables  # h5netcdf: a complete study needs it not

    scene, goal = study.problem, goals.searches[0].goal
    name, linked = goal.parameter, study.linked
    usual = [each for each in layout.usual_dimensions(scene) if each not in {name, *linked}]
    first = goals.cases[0].values
    axes = {each: [first[each]] for each in usual} | study.axes
    shape = tuple(map(len, axes.values()))
    beside = {"coordinates": " ".join(linked)} if linked else {}
    attributes = layout.axis_attributes(scene, name)
    unit = {key: attributes[key] for key in attributes.keys() & {"units"}}
    order = _order(study, goals.cases, list(axes), shape)
    searches = [goals.searches[k] for k in order]
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


def _order(study: Study, cases: list[Case], dims: list[str], shape: tuple[int, ...]) -> list[int]:
    """Return the numbers of the places in the order of the data set."""
    at = [dict(zip(study.axes, case.index, strict=True)) for case in cases]
    flat = [
        int(np.ravel_multi_index([each.get(name, 0) for name in dims], shape)) if dims else 0
        for each in at
    ]
    return [int(k) for k in np.argsort(flat)]
