"""Compute a part of a study: one process of many, which meet in the directory alone.

Each process goes through all loading paths of the study, from a place of its own, and computes
those that lack runs and that it can claim (`studies.storage.claims`). Of a study that chooses its
runs each process carries out all programs: they ask for the same runs, whoever computes them. It
ends when nothing is left that it can claim, and no run of others can make a program ask for more.
What one that was killed has left is claimed by another one, or computed by `run_study` at the end,
which combines the runs.

A part is no `Executor`: one is given tasks by a study that has the store alone, and reports how
each ended. A part has nobody to report to. It decides by what is in the store, which others change,
which path is open, and what a program asks for next.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Container, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

from studies.definition.cases import LoadingPath
from studies.definition.identity import solver_hash
from studies.definition.study import Study
from studies.errors import StudyError
from studies.execution.asking import Asked, Asking
from studies.execution.run import StudyEvent
from studies.execution.task import PathTask, walk
from studies.scratch import scratch
from studies.storage.catalogue import Catalogue
from studies.storage.claims import Claim, Claims
from studies.storage.store import Store

_MOST_DEATHS = 2
"""Number of processes that died with a path, after which it is blamed and not tried again."""
_LOOK = 2.0
"""Seconds after which the files of runs are listed again."""
_WAIT = 0.5
"""Seconds after which a process that waits for the runs of others looks again."""
_DIED = (
    "the processes that computed this loading path died; if memory ran out, give each more, or "
    "more time if a limit of the cluster ended them"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class PartOutcome:
    """What a part has done.

    Attributes
    ----------
    computed : ids of the runs that it has computed
    left : number of loading paths that lack runs at its end: others have claimed them, or it was
        stopped
    stopped : whether it was stopped
    """

    computed: list[str]
    left: int
    stopped: bool


def run_part(
    study: Study,
    directory: Any,
    part: tuple[int, int],
    *,
    on_event: Callable[[StudyEvent], None] | None = None,
    should_stop: Callable[[], bool] | None = None,
) -> PartOutcome:
    """Compute runs of `study` that a directory lacks, as one of several processes.

    Stored runs are not computed again, also those that failed. Nothing is combined: `run_study`
    does this at the end.

    Parameters
    ----------
    study : the study
    directory : the directory of the store, which all processes see
    part : number of this process, from 1 on, and the number of processes
    on_event : called with every event
    should_stop : called several times a second; if it returns true the work stops

    Raises
    ------
    StoreBusy
        if a process that is no part computes into the directory
    StudyError
        if the part is none, or the directory is not writable
    StoreFull
        if the disk is full
    """
    number, count = part
    if not 1 <= number <= count:
        raise StudyError("part", f"{number}/{count}", "must be i/n with 1 <= i <= n")
    with scratch() as folder:
        store = Store(directory)
        # SQLite is not made for directories that machines share
        store.catalogue = Catalogue(folder / "catalogue.sqlite")
        with store.sharing():
            store.save_study(study)
            emit = on_event or (lambda event: None)
            work = _PartWork(study, store, emit, should_stop or (lambda: False))
            return work.done((number - 1) / count)


@dataclass(slots=True)
class _PartWork:
    """The work of one process."""

    study: Study
    store: Store
    emit: Callable[[StudyEvent], None]
    stop: Callable[[], bool]
    computed: list[str] = field(default_factory=list)
    _there: set[str] = field(default_factory=set)
    _looked: float = -1e9
    _share: float = 0.0

    def done(self, begin: float) -> PartOutcome:
        """Go through all units, from a place between 0 and 1 on, until none can be claimed."""
        claims = self.store.blobs.claims()
        asking = Asking(self.study, self.store, resume=True) if self.study.kind.chooses else None
        units = self._units(asking)
        first = round(begin * len(units))
        left, moved = units[first:] + units[:first], True
        while left and not self.stop() and not (asking and asking.ended):
            if not moved:
                if asking is None or asking.goes_on:
                    break
                time.sleep(_WAIT)
            moved = False
            waiting: list[_Unit] = []
            for at, unit in enumerate(left):
                open_ = len(left) - at + len(waiting)
                self._share = asking.progress if asking else 1.0 - open_ / len(units)
                if self.stop():
                    waiting += left[at:]
                    break
                if self._complete(unit):
                    moved = True
                    continue
                with unit.held(claims) as claim:
                    if claim is None:
                        waiting.append(unit)
                        continue
                    moved = True
                    unit.compute(self, claim.deaths >= _MOST_DEATHS)
                    claim.done = not self.stop()
                    if not claim.done:
                        waiting.append(unit)
            left = [*self._units(asking), *waiting] if asking else waiting
        return PartOutcome(computed=self.computed, left=len(left), stopped=self.stop())

    def _units(self, asking: Asking | None) -> list[_Unit]:
        """Return what is to be done; of programs what they have asked for anew."""
        if asking is None:
            return [_Unit(path) for path in self.study.paths()]
        asked = itertools.takewhile(lambda each: each is not None, asking.paths())
        return [_Unit(each.path, asking, each) for each in asked if each]

    def _complete(self, unit: _Unit) -> bool:
        """Whether the runs of a unit were there when the files were listed last."""
        if time.monotonic() - self._looked > _LOOK:
            self._there = self.store.stored_runs()
            self._looked = time.monotonic()
        return unit.complete(self._there)

    def walk(self, task: PathTask, hear: Callable[[str, dict[str, Any]], str]) -> None:
        """Compute the runs of a task."""

        def report(content: dict[str, Any]) -> None:
            path = content["path"]
            if "row" not in content:
                self._tell("path", path=path, fraction=content["fraction"])
                return
            row = content["row"]
            place = hear(path, row)
            self.computed.append(row["id"])
            self._tell(
                "run", path=path, run=row["id"], status=self.study.taken(row["status"]),
                message=row["message"], place=place,
            )  # fmt: skip

        walk(task, report, self.stop)

    def task(self, path: LoadingPath, **more: Any) -> PathTask:
        """Return the task of a loading path."""
        where = self.store.address
        return PathTask(self.study.problem, (path,), where, solver_hash(), self.study.keep, **more)

    def _tell(self, kind: str, **content: Any) -> None:
        self.emit(StudyEvent(kind=kind, progress=self._share, **content))


@dataclass(frozen=True, slots=True)
class _Unit:
    """A loading path of a sweep, or one that a program asks for."""

    path: LoadingPath
    asking: Asking | None = None
    asked: Asked | None = None

    def complete(self, there: Container[str]) -> bool:
        """Tell whether its runs are there; then its program takes them."""
        if not (self.asking and self.asked):
            return all(case.id in there for case in self.path.cases)
        if complete := self.asking.complete(self.asked, there):
            self.asking.closed(self.path.id)
        return complete

    @contextmanager
    def held(self, claims: Claims) -> Iterator[Claim | None]:
        """Claim it; None if another process may be at it.

        A search is claimed as a whole too: a process that begins later, and takes the runs that are
        there, would ask for the rest of a path under another name. A refinement and a fit are not:
        several processes may compute what they ask for along one path.
        """
        asked = self.asked
        whole = f"{asked.whole}-whole" if asked and (asked.limit or asked.place) else ""
        with ExitStack() as own:
            if whole and not own.enter_context(claims.held(whole)):
                yield None
            else:
                yield own.enter_context(claims.held(self.path.id))

    def compute(self, part: _PartWork, hopeless: bool) -> None:
        """Compute its runs that are not there; or store that those who tried have died."""
        there = part.store.modified(case.id for case in self.path.cases)
        cases = tuple(case for case in self.path.cases if case.id not in there)
        path = replace(self.path, cases=cases)
        if self.asking and self.asked:
            self._ask(part, path, hopeless, self.asking, self.asked)
        elif hopeless:
            for case in cases:
                part.store.write_run(case, _DIED)
        elif cases:
            part.walk(part.task(path), lambda path, row: "")

    def _ask(
        self, part: _PartWork, path: LoadingPath, hopeless: bool, asking: Asking, asked: Asked
    ) -> None:
        """Compute what its program asks for, if it still does."""
        place, cases = asked.place, path.cases
        if place:
            owed = asking.owed(path.id)
            place, cases = asking.place(path.id), (owed,) if owed else ()
        elif len(cases) < len(self.path.cases):
            cases = ()  # its program takes what is there, and asks anew
        if hopeless and cases:
            for case in cases[:1] if asked.limit else cases:
                part.store.write_run(case, _DIED)
        elif cases:
            part.walk(part.task(path, limit=asked.limit, place=place), asking.heard)
        asking.closed(path.id)
