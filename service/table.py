"""The numbers of a study's runs as columns, from the catalogue: sorted, filtered, a page of them.

They are there while the study runs. A run that is not in the catalogue has its values on the axes
of the sweep, the status ``pending``, and no numbers. The runs of a study that searches, refines
or fits are those that it has asked for: they fill no grid, and have no axes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from service.cache import Cache
from service.job import Job
from service.jobs import Jobs
from service.overview import PENDING, searched_at
from service.scenes import scene_of
from service.turns import Share
from solver.scenes import Scene
from studies.definition.parameters import parameters_of
from studies.definition.sweep import labels, linked_values
from studies.definition.vocabulary import STATUSES, taken
from studies.kinds import kind_of
from studies.storage.dataset import axis_attributes
from studies.storage.seal import state_of
from studies.storage.store import Store
from studies.views.figures import group_of
from studies.views.table import MESSAGE, RUN, STATUS, Column, RunTable, column_of

KEPT = 8
"""Number of tables that are kept."""

OUTCOMES = (*STATUSES[:-1], PENDING)
"""Statuses of runs in a table, by their number in the column ``status`` of octets."""


class Tables:
    """The tables of studies; one is made again when its study or the catalogue has changed."""

    def __init__(self, jobs: Jobs, store: Store) -> None:
        self.jobs, self.store = jobs, store
        self.kept = Cache[RunTable](KEPT)

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
