"""The runs of a study that chooses them by the outcomes of others.

Its programs go on each by itself: as soon as it is known what one needs next, it is handed to the
workers. A program along a path that goes on is the task of one worker, which asks for its runs
itself.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Container, Iterator, Mapping, Sequence
from copy import copy, deepcopy
from dataclasses import replace
from functools import partial
from itertools import takewhile
from typing import Any, NamedTuple

import numpy as np

from solver.late import Late
from studies.definition.cases import Case, LoadingPath
from studies.definition.place import Limit, Place
from studies.definition.quantity import Line, Read
from studies.definition.study import Study
from studies.numbers import number_text
from studies.storage import runfile
from studies.storage.store import Store

NEIGHBOURS = Late("studies.definition.neighbours:Neighbours")  # loads scipy


class Asked(NamedTuple):
    """A loading path that a program asks for.

    Either ``limit`` tells its last run, or it goes on, for as long as ``place`` asks for runs. All
    rounds along one path have the same ``whole``.
    """

    path: LoadingPath
    limit: Limit | None
    place: Place[Any] | None
    whole: str


class Asking:
    """The programs of a study, and the runs that they ask for.

    Attributes
    ----------
    places : the programs with their runs, in the order of `Kind.programs`
    """

    def __init__(self, study: Study, store: Store, resume: bool = False, since: int = 0) -> None:
        self._study, self._store = study, store
        self._at: list[Sequence[str]] = []
        self.places: list[Place[Any]] = []
        kind = study.kind
        for at, program in kind.programs(
            study.sweep, lambda names: partial(_read, store, names), study.allow
        ):
            self._at.append([f"{axis} = {at.at[axis]}" for axis in study.sweep if axis in at.at])
            own = Place(
                scene=study.problem, fixed={**study.parameters, **at.sets}, program=program,
                keep=study.keep, resume=resume, since=since,
            )  # fmt: skip
            self.places.append(own)
        self._open, self._done = set(range(len(self.places))), np.zeros(len(self.places))
        self._paths: dict[str, tuple[int, list[Any]]] = {}
        self._waits: list[set[Any]] = [set() for _ in self.places]
        self._ready: deque[Asked] = deque()
        self._neighbours: Any = None
        self._after: dict[int, list[int]] = {}
        if kind.expects:
            self._neighbours = NEIGHBOURS([place.fixed for place in self.places])
            for number, before in enumerate(self._neighbours.before):
                for each in before:
                    self._after.setdefault(each, []).append(number)
        for number in range(len(self.places)):
            self._go_on(number)

    @property
    def ended(self) -> bool:
        """Whether all programs have ended."""
        return not self._open

    @property
    def asked(self) -> list[str]:
        """Ids of the runs that the programs have asked for, as far as they are known."""
        rows = (row for place in self.places for row in place.program.rows.values())
        return sorted({str(row["id"]) for row in rows if isinstance(row, Mapping)})

    @property
    def stage(self) -> str:
        """How far the programs are, as text: see `Study.stage`."""
        ended = len(self.places) - len(self._open)
        return self._study.stage(ended, self.places[0].program.told)

    @property
    def progress(self) -> float:
        """Share of all programs that is done, 0 to 1."""
        return float(self._done.mean())

    def paths(self) -> Iterator[Asked | None]:
        """Yield the loading paths that are asked for; None while all programs wait for runs."""
        while not self.ended:
            yield self._ready.popleft() if self._ready else None

    def heard(self, path: str, row: Mapping[str, Any]) -> str:
        """Tell the program of a loading path of the row of a run; return `about` of it."""
        about = self.about(path, row)
        number = self._paths[path][0]
        place = self.places[number]
        self._waits[number].discard(place.program.key(row["parameters"]))
        if place.hear(row):
            self._take_stock(number)
            if not place.program.goes_on:
                self._go_on(number)
        return about

    def owed(self, path: str) -> Case | None:
        """Return the run that a path which goes on has to compute next; None if it owes none.

        Runs that it has stored are taken, also those of which it told nothing.
        """
        number = self._paths[path][0]
        place = self.places[number]
        wanted = self._lacking(number, ()) if place.program.goes_on else []
        if not wanted or place.refusal(wanted[0]):
            return None
        return next(place.runs(wanted[:1]).cases())

    @property
    def goes_on(self) -> bool:
        """Whether each program has one loading path, to its end."""
        return all(place.program.goes_on for place in self.places)

    def complete(self, asked: Asked, there: Container[str]) -> bool:
        """Tell whether all runs of a path that are needed are among those there."""
        cases = asked.path.cases  # of a path that goes on they are not known
        ids = [case.id for case in takewhile(lambda case: case.id in there, cases)]
        if not ids or len(ids) == len(cases) or asked.limit is None:
            return bool(ids) and len(ids) == len(cases)
        rows, limit = self._store.sound(ids), copy(asked.limit)
        return any(limit(rows[each]) for each in ids if each in rows)

    def place(self, path: str) -> Place[Any]:
        """Return the program of a path that goes on, as it is now, for who carries it on."""
        place = self.places[self._paths[path][0]]
        return replace(place, program=deepcopy(place.program))

    def stored(self, path: str, since: int) -> list[Mapping[str, Any]]:
        """Return the rows of the runs of a program that have been stored since a time [ns].

        Some may have been stored by a worker that died before it told of them.
        """
        program = self.places[self._paths[path][0]].program
        rows = program.rows.values() if program.goes_on else ()
        return [row for row in rows if row["modified"] >= since]

    def closed(self, path: str) -> None:
        """Ask again for runs of which a path that has ended told nothing."""
        number, keys = self._paths[path]
        self._waits[number].difference_update(keys)
        self._go_on(number)

    def about(self, path: str, row: Mapping[str, Any]) -> str:
        """Return where a run is, and how far its program is, as text."""
        number = self._paths[path][0]
        program = self.places[number].program
        own = program.sets(program.key(row["parameters"])).items()
        text = (f"{name} = {_short(value)}" for name, value in own)
        return ", ".join([*self._at[number], *text]) + f" ({program.told})"

    def _go_on(self, number: int) -> None:
        """Go on with a program, and with those that wait for its end."""
        if self._begun(number):
            self._ask(number)
        if self.places[number].program.reason:
            for each in self._after.pop(number, ()):
                self._go_on(each)

    def _begun(self, number: int) -> bool:
        """Return whether a search may begin: those by which its goal is expected have ended."""
        program, near = self.places[number].program, self._neighbours
        if near is None or not near.before[number] or program.rows or program.expected is not None:
            return True
        before = [self.places[each].program for each in near.before[number]]
        if not all(each.reason for each in before):
            return False
        expected = near.foreseen(number, [each.found for each in before])
        self.places[number].program = replace(program, expected=expected)
        return True

    def _ask(self, number: int) -> None:
        """Take the runs of a program that are in the store, and ask for those that are not."""
        place, waits = self.places[number], self._waits[number]
        while True:
            lacking = self._lacking(number, waits)
            refused = next(filter(place.refusal, lacking), None)
            if refused is None or not place.program.refuse(refused, place.refusal(refused)):
                break
        wanted = list(takewhile(lambda key: key != refused, lacking))
        if not wanted:
            return
        waits.update(wanted)
        for path in place.runs(wanted).paths():
            # rounds share the id of a path, and one may begin before the last has ended
            own = replace(path, id=path.cases[0].id)
            self._paths[own.id] = number, [place.program.key(case.values) for case in own.cases]
            if place.program.goes_on:
                self._ready.append(Asked(replace(own, cases=()), None, self.place(own.id), path.id))
            else:
                self._ready.append(Asked(own, place.program.limit, None, path.id))

    def _lacking(self, number: int, waits: Collection[Any]) -> list[Any]:
        """Take the runs of a program that are in the store; return the keys of the others."""
        place = self.places[number]
        lacking: list[Any] = []
        while not lacking and (wanted := place.program.lacking(waits)):
            runs = place.runs(wanted)
            rows = self._store.sound([case.id for case in runs.cases()])
            stand = [rows[case.id] for case in runs.cases() if case.id in rows]
            if not sum(place.hear(row) for row in stand if place.stands(row)):
                lacking = wanted
        self._take_stock(number)
        return lacking

    def _take_stock(self, number: int) -> None:
        """Keep how far a program is: all are too many to be asked at each run."""
        program = self.places[number].program
        self._done[number] = program.progress
        if program.reason:
            self._open.discard(number)


def _read(store: Store, names: Collection[str], row: Mapping[str, Any]) -> Read:
    """Return what gives some variables of a run, and the values of their dimensions."""
    with runfile.opened(store.run_path(row["id"])) as run:
        found = {name: Line(*each) for name, each in runfile.lines(run, names).items()}
    return found.get


def _short(value: Any) -> str:
    return number_text(value, 6) if isinstance(value, float) else str(value)
