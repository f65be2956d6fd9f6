"""Jobs as the answers show them, with the states and numbers of their runs from the catalogue.

The table of a study is there while it runs. A run that is not in the catalogue has its values on
the axes of the sweep, the status ``pending``, and no numbers. The runs of a study that searches,
refines or fits are those that it has asked for: they fill no grid, and have no axes.
"""

from __future__ import annotations

import asyncio
import math
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from service.cache import Cache
from service.job import Job
from service.jobs import Jobs
from service.scenes import scene_name, scene_of
from service.schemas import StudyDetail, StudyRun, StudySummary, Window
from service.turns import Share
from solver.scenes import Scene
from studies.definition.parameters import parameters_of
from studies.definition.sweep import labels, linked_values, positions
from studies.definition.vocabulary import STATUSES, taken
from studies.kinds import KINDS, kind_of
from studies.numbers import number_text
from studies.storage.dataset import axis_attributes
from studies.storage.seal import state_of
from studies.storage.store import Store
from studies.views.figures import group_of
from studies.views.table import MESSAGE, RUN, STATUS, Column, RunTable, column_of

KEPT = 100
"""Largest number of answers that are kept."""

PENDING = "pending"
"""Status of a run that is not in the catalogue."""
WORDS: dict[str, Any] = {"note": "", "tags": [], "keep": "", "allow": []}
"""Other entries of studies, and what one has that has no such entry."""


def summary(job: Job) -> StudySummary:
    """Return the state of a study."""
    return StudySummary(**_columns(job))


@dataclass(slots=True)
class Detail:
    """One answer: its inputs, the time they were read, and the reading that is under way."""

    state: object = None
    content: bytes = b""
    looked: float = -math.inf
    one: asyncio.Lock = field(default_factory=asyncio.Lock)


class Details:
    """Studies with the states of their runs, as JSON; unchanged answers are kept.

    Many clients may follow one study: one reading serves all requests before it.
    """

    def __init__(self, jobs: Jobs, store: Store) -> None:
        self.jobs = jobs
        self.store = store
        self.kept = Cache[Detail](KEPT)

    async def get(self, study_id: str, window: Window, share: Share) -> bytes:
        """Return a study, with those of its runs that are in ``window``, in a caller's turn.

        Who waits while another caller looks at the same study takes no slot.
        """
        requested = time.monotonic()
        key = study_id, window.limit, window.offset
        detail = self.kept.get(key) or self.kept.put(key, Detail())
        try:
            while detail.looked < requested:
                async with detail.one:
                    pass
                async with share.turn() as turn:
                    if detail.looked < requested and not detail.one.locked():
                        async with detail.one:
                            await turn.here(self._look, study_id, window, detail)
            return detail.content
        finally:
            # unless another caller looks, or has begun anew
            if not (detail.content or detail.one.locked()) and self.kept.get(key) is detail:
                self.kept.forget(key)

    def _look(self, study_id: str, window: Window, detail: Detail) -> None:
        began = time.monotonic()
        job = self.jobs.get(study_id)
        state = job, state_of(self.store.catalogue.path)
        if detail.state != state:
            detail.content = self._look_up(job, window).model_dump_json().encode()
            detail.state = state
        detail.looked = began

    def _look_up(self, job: Job, window: Window) -> StudyDetail:
        study = self.jobs.study(job.id)
        allow = study.get("allow", [])
        counts = Counter[str]()
        for status, number in self.store.catalogue.counts(self.jobs.runs(job.id)).items():
            counts[taken(status, allow)] += number
        asks = kind_of(study).chooses
        if not asks and (pending := job.size - sum(counts.values())):
            counts[PENDING] = pending
        axes = {name: labels(name, axis) for name, axis in study["sweep"].items()}
        page = self.jobs.runs(job.id, window.limit, window.offset)
        rows = self.store.catalogue.rows(page)

        def at(run_id: str, position: int) -> dict[str, Any]:
            if not asks:
                return point(axes, position)
            return searched_at(study, rows[run_id]["parameters"]) if run_id in rows else {}

        return StudyDetail(
            **_columns(job),
            scene_name=scene_name(self.store, job.scene),
            parameters=study["parameters"],
            sweep=study["sweep"],
            **{name: study.get(name, {}) for name in KINDS},
            **{name: study.get(name, usual) for name, usual in WORDS.items()},
            counts=counts,
            runs=[
                StudyRun(
                    id=run_id,
                    status=taken(rows[run_id]["status"], allow) if run_id in rows else PENDING,
                    message=rows[run_id]["message"] if run_id in rows else "",
                    at=at(run_id, position),
                )
                for position, run_id in enumerate(page, window.offset)
            ],
        )


def point(axes: dict[str, list[Any]], position: int) -> dict[str, Any]:
    """Return the values on the axes of the run at ``position``; the last axis runs fastest."""
    index = np.unravel_index(position, [*map(len, axes.values())]) if axes else ()
    return {name: axis[at] for (name, axis), at in zip(axes.items(), index, strict=True)}


def searched_at(study: Mapping[str, Any], parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Return where a study has asked for a run: on its axes, and of parameters that it searches.

    Runs may be between the values of the axes.
    """
    labelled = {
        name: each.at
        for name, axis in study["sweep"].items()
        for each in positions(name, axis)
        if all(parameters.get(key) == value for key, value in each.sets.items())
    }
    kind = kind_of(study)
    names = [*study["sweep"], *kind.searched(study[kind.name])]
    places = {name: labelled.get(name, parameters.get(name)) for name in names}
    return {name: place for name, place in places.items() if place is not None}


def log_of(job: Job, jobs: Jobs, store: Store) -> str:
    """Return a line for each thing that happened to a study, in the order of time.

    Runs that were there before it was accepted come first.
    """
    lines = jobs.told(job.id)
    for run_id, row in store.catalogue.each(jobs.runs(job.id)):
        if row:
            seconds = (
                ""
                if row["cpu_seconds"] is None
                else f", {number_text(row['cpu_seconds'])} s of CPU"
            )
            words = f"run {run_id}: {row['status']}{seconds}"
            said = f"{words}: {row['message']}" if row["message"] else words
            lines.append((str(row["created"]), said))
    told = ((at, " ".join(words.split())) for at, words in sorted(lines, key=lambda each: each[0]))
    return "".join(f"{at}  {words}\n" for at, words in told)


def _columns(job: Job) -> dict[str, Any]:
    names = StudySummary.model_fields.keys() - {"status"}
    columns = {name: getattr(job, name) for name in names}
    return columns | {"status": job.state, "progress": round(job.progress, 1)}


TABLES_KEPT = 8
"""Number of tables that are kept."""

OUTCOMES = (*STATUSES[:-1], PENDING)
"""Statuses of runs in a table, by their number in the column ``status`` of octets."""


class Tables:
    """The tables of studies; one is made again when its study or the catalogue has changed."""

    def __init__(self, jobs: Jobs, store: Store) -> None:
        self.jobs, self.store = jobs, store
        self.kept = Cache[RunTable](TABLES_KEPT)

    async def get(self, study_id: str, share: Share) -> RunTable:
        """Return the table of a study, made in the turn of a caller unless it is kept."""
        async with share.turn() as turn:
            job, state = await turn.here(self._state, study_id)
            if (table := self.kept.get(study_id, of=state)) is not None:
                return table
            return self.kept.put(study_id, await turn.here(self._made, job), of=state)

    def _state(self, study_id: str) -> tuple[Job, object]:
        """Return a study, and all on which its table depends."""
        job = self.jobs.get(study_id)
        asked = job.state, job.stage  # its runs may not all be known yet
        return job, (job.turn, job.size, asked, state_of(self.store.catalogue.path))

    def _made(self, job: Job) -> RunTable:
        study, runs = self.jobs.study(job.id), self.jobs.runs(job.id)
        scene = scene_of(self.store, job.scene)
        axes = {name: labels(name, axis) for name, axis in study["sweep"].items()}
        asks, allow = kind_of(study).chooses, study.get("allow", [])
        outcome, said = (np.full(len(runs), text, dtype=object) for text in (PENDING, ""))
        numbers: dict[str, np.ndarray] = {}
        asked: dict[str, list[Any]] = {}
        for at, (_, row) in enumerate(self.store.catalogue.each(runs)):
            if row is None:
                continue
            outcome[at], said[at] = taken(row["status"], allow), row["message"]
            for name, number in row["scalars"].items():
                if name not in numbers:
                    numbers[name] = np.full(len(runs), math.nan)
                numbers[name][at] = math.nan if number is None else number
            place = _asked(study, axes, row["parameters"]) if asks else {}
            for name, value in place.items():
                asked.setdefault(name, [None] * len(runs))[at] = value
        if asks:
            axes = {}
            columns = [_placed(name, _array(each), scene) for name, each in asked.items()]
        else:
            columns = [*_sweep(study["sweep"], axes, scene)]
        columns.append(column_of(STATUS, outcome, "run"))
        known = {each.name for each in columns}
        for name in (each for each in numbers if each not in known):
            columns.append(column_of(name, numbers[name], group_of(name), scene))
        columns += [
            column_of(RUN, np.array(runs, dtype=object), "run"),
            column_of(MESSAGE, said, "run"),
        ]
        return RunTable(axes=axes, columns={each.name: each for each in columns})


def _asked(
    study: Mapping[str, Any], axes: Mapping[str, Sequence[Any]], parameters: Mapping[str, Any]
) -> dict[str, Any]:
    """Return where a study has asked for a run, with what labels and points set.

    The number of a point is no place: what the point sets is.
    """
    found = searched_at(study, parameters)
    linked = linked_values(dict(study["sweep"]))
    own = {
        name: values[list(axes[axis]).index(found[axis])]
        for name, (axis, values) in linked.items()
        if axis in found
    }
    numbered = {axis for axis, _ in linked.values() if [*axes[axis]] == [*range(len(axes[axis]))]}
    return own | {name: value for name, value in found.items() if name not in numbered}


def _sweep(
    sweep: Mapping[str, Any], axes: Mapping[str, Sequence[Any]], scene: Scene | None
) -> Iterator[Column]:
    """Yield the axes of a sweep, and what axes of labels and points set, over its runs."""
    shape = tuple(len(values) for values in axes.values())
    places = np.unravel_index(np.arange(math.prod(shape)), shape) if shape else ()
    at = dict(zip(axes, places, strict=True))
    own = {name: (name, values) for name, values in axes.items()}
    for name, (axis, values) in {**own, **linked_values(dict(sweep))}.items():
        yield _placed(name, _array(values)[at[axis]], scene)


def _array(values: Sequence[Any]) -> np.ndarray:
    """Return numbers, NaN where there is none; texts if there is anything else."""
    there = [each for each in values if each is not None]
    if all(isinstance(each, int | float) and not isinstance(each, bool) for each in there):
        return np.array([math.nan if each is None else each for each in values], dtype=float)
    return np.array(["" if each is None else str(each) for each in values], dtype=object)


def _placed(name: str, values: np.ndarray, scene: Scene | None) -> Column:
    """Return a column that tells where runs are."""
    known = axis_attributes(scene, name) if scene and name in parameters_of(scene) else {}
    return column_of(name, values, "sweep", words=known)
