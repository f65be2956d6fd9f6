"""The numbers of a study's runs as columns, from the catalogue: sorted, filtered, a page of them.

They are there while the study runs. A run that is not in the catalogue has its values on the axes
of the sweep, the status ``pending``, and no numbers. The runs of a study that searches, refines
or fits are those that it has asked for: they fill no grid, and have no axes.
"""

from __future__ import annotations

import math
import re
from collections import OrderedDict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from threading import Lock
from typing import Any

import numpy as np

from service.job import Job
from service.jobs import Jobs
from service.overview import PENDING, chooses, searched_at
from solver.results.quantities import QUANTITIES
from solver.scenes import Scene
from studies import Store, StudyError
from studies.definition.parameters import parameters_of
from studies.definition.sweep import labels, linked_values
from studies.definition.vocabulary import STATUSES, taken
from studies.errors import one_of
from studies.scenes.registry import known_names, scene_named
from studies.storage.dataset import attributes_of, axis_attributes
from studies.storage.seal import state_of
from studies.views.figures import group_of

KEPT = 8
"""Number of tables that are kept."""

BATCH = 1000
"""Number of runs whose rows of the catalogue are in memory at a time."""

SAME = 1e-9
"""Relative difference below which a number is the one that a query names."""

MOST_VALUES = 100
"""Largest number of numbers that a query names of a column."""

RANGE = re.compile(r"(?P<low>[^.]*(?:\.\d[^.]*)?)\.\.(?P<high>.*)", re.DOTALL)

OUTCOMES = (*STATUSES[:-1], PENDING)
"""Statuses of runs in a table, by their number in the column ``status`` of octets."""

NUMBERS = ("result", "effort", "audit")
"""Groups of columns with the numbers of runs, the main ones first."""

STATUS, RUN, MESSAGE = "status", "run", "message"


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """One column of a table.

    Attributes
    ----------
    name, words, unit : name, meaning and unit
    group : ``sweep``, ``run``, or one of `NUMBERS`
    flags : meanings of its numbers, if they stand for words
    values : numbers, NaN where there is none, or texts, for each run
    """

    name: str
    words: str
    unit: str
    group: str
    flags: Mapping[int, str]
    values: np.ndarray

    @property
    def number(self) -> bool:
        """Whether it has numbers."""
        return self.values.dtype.kind == "f"


@dataclass(frozen=True, slots=True, kw_only=True)
class RunTable:
    """The runs of a study in the order of its cases.

    Attributes
    ----------
    axes : name of each axis of the sweep, with its values or labels; the last runs fastest
    columns : all columns by name: the sweep, status, numbers, audit, id, message
    """

    axes: Mapping[str, Sequence[Any]]
    columns: Mapping[str, Column]

    @property
    def size(self) -> int:
        """Number of runs."""
        return len(self.columns[RUN].values)

    @property
    def numbers(self) -> list[Column]:
        """The columns of results that are numbers."""
        every = self.columns.values()
        return [each for each in every if each.number and each.group in NUMBERS]

    def column(self, name: str, field: str = "columns") -> Column:
        """Return a column; raise `StudyError` if there is none of this name."""
        if name not in self.columns:
            raise StudyError(field, name, one_of(name, self.columns))
        return self.columns[name]

    def chosen(self, sort: str = "", where: Mapping[str, str] | None = None) -> np.ndarray:
        """Return the positions of the runs that meet all conditions, in order.

        Parameters
        ----------
        sort : name of a column; with a minus before it, the largest first. Runs without a value
            come last
        where : a condition by column: a value, several with commas between, or a range ``0.1..0.4``

        Raises
        ------
        StudyError
            if there is no such column, or it has numbers and the condition none
        """
        keep = np.ones(self.size, dtype=bool)
        for name, condition in (where or {}).items():
            keep &= _meets(self.column(name, name), condition)
        found = np.flatnonzero(keep)
        if not sort:
            return found
        column = self.column(sort.removeprefix("-"), "sort")
        values = column.values[found]
        if not column.number:
            _, values = np.unique(values.astype(str), return_inverse=True)
            values = values.astype(float)
        return found[np.argsort(-values if sort.startswith("-") else values, kind="stable")]


class Tables:
    """The tables of studies; one is made again when its study or the catalogue has changed."""

    def __init__(self, jobs: Jobs, store: Store) -> None:
        self.jobs, self.store = jobs, store
        self.kept: OrderedDict[str, tuple[object, RunTable]] = OrderedDict()
        self.one = Lock()

    def get(self, study_id: str) -> RunTable:
        """Return the table of a study."""
        with self.one:
            job = self.jobs.get(study_id)
            asked = job.state, job.stage  # its runs may not all be known yet
            state = job.turn, job.size, job.digest, asked, state_of(self.store.catalogue.path)
            known, table = self.kept.get(study_id, (None, None))
            if table is None or known != state:
                table = self._made(job)
                self.kept[study_id] = state, table
            self.kept.move_to_end(study_id)
            while len(self.kept) > KEPT:
                self.kept.popitem(last=False)
            return table

    def _made(self, job: Job) -> RunTable:
        study, runs = self.jobs.study(job.id), self.jobs.runs(job.id)
        scene = scene_of_study(self.store, job.scene)
        axes = {name: labels(name, axis) for name, axis in study["sweep"].items()}
        asks, allow = chooses(study), study.get("allow", [])
        outcome, said = (np.full(len(runs), text, dtype=object) for text in (PENDING, ""))
        numbers: dict[str, np.ndarray] = {}
        asked: dict[str, list[Any]] = {}
        for first in range(0, len(runs), BATCH):
            some = runs[first : first + BATCH]
            rows = self.store.catalogue.rows(some)
            for at, row in enumerate(map(rows.get, some), first):
                if row is None:
                    continue
                outcome[at], said[at] = taken(row["status"], allow), row["message"]
                for name, number in row["scalars"].items():
                    if name not in numbers:
                        numbers[name] = np.full(len(runs), math.nan)
                    numbers[name][at] = math.nan if number is None else number
                for name, value in searched_at(study, row["parameters"]).items() if asks else ():
                    asked.setdefault(name, [None] * len(runs))[at] = value
        if asks:
            axes = {}
            columns = [_placed(name, _array(each), scene) for name, each in asked.items()]
        else:
            columns = [*_sweep(study["sweep"], axes, scene)]
        columns.append(_column(STATUS, outcome, "run"))
        known = {each.name for each in columns}
        for name in (each for each in numbers if each not in known):
            columns.append(_column(name, numbers[name], group_of(name), scene))
        columns += [
            _column(RUN, np.array(runs, dtype=object), "run"),
            _column(MESSAGE, said, "run"),
        ]
        return RunTable(axes=axes, columns={each.name: each for each in columns})


def varied(table: RunTable) -> list[Column]:
    """Return the columns of the sweep that are not the same in all runs."""
    sweep = [each for each in table.columns.values() if each.group == "sweep"]
    several = [each for each in sweep if len(set(each.values.tolist())) > 1]
    return several or sweep


def scene_of_study(store: Store, name: str) -> Scene | None:
    """Return a scene by its name or by the id of a posted one; None if it is not known here."""
    if scene := store.scene(name, whole=False):
        return scene
    return scene_named(name) if name in known_names() else None


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
    return _column(name, values, "sweep", words=known)


def _column(
    name: str,
    values: np.ndarray,
    group: str,
    scene: Scene | None = None,
    words: Mapping[str, Any] | None = None,
) -> Column:
    attributes = attributes_of(name, scene) if words is None else words
    unit = str(attributes.get("units", ""))
    quantity = QUANTITIES.get(name)
    meanings = quantity.flags if quantity else None
    return Column(
        name=name,
        words=str(attributes.get("long_name", name.replace("_", " "))),
        unit="" if unit == "1" else unit,
        group=group,
        flags={flag.value: flag.name.lower() for flag in meanings} if meanings else {},
        values=values,
    )


def _meets(column: Column, condition: str) -> np.ndarray:
    """Return which runs meet a condition."""
    if not column.number or column.flags:
        wanted = {each.strip() for each in condition.split(",")}
        said = column.values.tolist()
        if column.flags:
            said = [column.flags.get(each) for each in said]
        return np.array([each in wanted for each in said], dtype=bool)
    values = column.values
    if match := RANGE.fullmatch(condition):
        low, high = (match[end].strip() for end in ("low", "high"))
        least, most = (_number(column, end, condition) if end else None for end in (low, high))
        above = least is None or values >= least - SAME * abs(least)
        below = most is None or values <= most + SAME * abs(most)
        return ~np.isnan(values) & above & below
    named = condition.split(",")
    if len(named) > MOST_VALUES:
        allowed = f"must be at most {MOST_VALUES} numbers, or a range such as 0.1..0.4"
        raise StudyError(column.name, f"{len(named)} numbers", allowed)
    numbers = [_number(column, each, condition) for each in named]
    return np.any([np.isclose(values, each, rtol=SAME, atol=0.0) for each in numbers], axis=0)


def _number(column: Column, text: str, condition: str) -> float:
    try:
        return float(text)
    except ValueError:
        allowed = "must be a number, several with commas between, or a range such as 0.1..0.4"
        raise StudyError(column.name, condition, allowed) from None
