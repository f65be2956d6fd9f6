"""Estimate of what a study will cost, before anything is computed, and its bounds."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from studies.definition.cases import LoadingPath
from studies.definition.study import Study
from studies.definition.vocabulary import OK, SOLVED
from studies.errors import StudyError
from studies.execution.pace import pace_of
from studies.storage.store import Store

_PER_RUN, _PER_PATH = 0.5, 1.0
"""Seconds to look at a run, check and write it; to make the mesh of a path and its operators."""
_BYTES, _COMBINED = 1.1e6, 1.8
"""Size of a run's file where none is known; what the data set of a study adds to the files."""
_FIELDS = 100
"""Bytes for each unknown that kept fields add to a run's file where none is known: 55 to 185."""
_BATCH = 500


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """What a study asks for. But for `runs`, all is about what the store lacks.

    Attributes
    ----------
    runs : runs of the study
    to_compute : those that the store does not have
    paths : loading paths to walk
    unknowns : most displacement unknowns of a run
    increments : of all paths, when none is cut
    longest : most increments of one path, where they are halved as often as they may be
    cpu_seconds : processor time, low, likely and high: 16 %, 50 % and 84 % quantiles of past runs
    bytes : on the disk, data set included
    basis : what the estimate rests on, in words

    None stands for what cannot be estimated.
    """

    runs: int
    to_compute: int
    paths: int
    unknowns: int | None
    increments: int | None
    longest: int | None
    cpu_seconds: tuple[float, ...] | None
    bytes: int
    basis: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Bounds:
    """The most that a study may ask for; None sets no bound.

    Attributes
    ----------
    runs : runs of the study
    unknowns : unknowns of a run
    increments : increments of a loading path
    cpu_seconds : likely processor time of the study
    bytes : on the disk
    """

    runs: int | None = None
    unknowns: int | None = None
    increments: int | None = None
    cpu_seconds: float | None = None
    bytes: int | None = None

    def check_size(self, study: Study) -> None:
        """Refuse a study of too many runs, before they are gone through.

        Raises
        ------
        StudyError
            naming the bound, and the setting that holds it
        """
        self._refuse("runs", study.size)

    def check(self, estimate: Estimate) -> None:
        """Refuse a study that asks for more; what cannot be estimated is not refused.

        Raises
        ------
        StudyError
            naming the bound, and the setting that holds it
        """
        likely = estimate.cpu_seconds[1] if estimate.cpu_seconds else None
        asked = {
            "runs": estimate.runs,
            "unknowns": estimate.unknowns,
            "increments": estimate.longest,
            "cpu_seconds": likely,
            "bytes": estimate.bytes,
        }
        for bound in fields(self):
            self._refuse(bound.name, asked[bound.name])

    def _refuse(self, name: str, asked: float | None) -> None:
        most = getattr(self, name)
        if most is not None and asked is not None and asked > most:
            allowed = f"at most {most:g}: {_MEANING[name]} (setting max_{name})"
            raise StudyError(f"estimate.{name}", round(asked), allowed)


_MEANING = {
    "runs": "ask for fewer values in sweep",
    "unknowns": "take a coarser mesh",
    "increments": "take larger steps, or fewer of them",
    "cpu_seconds": "ask for fewer runs, a coarser mesh or larger steps",
    "bytes": "ask for fewer runs",
}


def estimate(study: Study, store: Store) -> Estimate:
    """Return what `study` will cost beyond what `store` has of it; nothing is written."""
    scene = study.problem
    pace = pace_of(store, scene.name)
    to_compute, paths, unknowns, increments, longest = 0, 0, 0, 0, 0
    seconds = [0.0, 0.0, 0.0]
    for path, missing in _missing(study, store):
        to_compute += len(missing)
        paths += 1
        if scene.effort is not None:
            effort = scene.effort(path.parameters, missing)
            unknowns = max(unknowns, effort.unknowns)
            increments += effort.increments
            longest = max(longest, effort.most_increments)
            more = pace.seconds(effort.unknowns, effort.increments, effort.most_increments)
            seconds = [sum(both) for both in zip(seconds, more, strict=True)]
    fixed = _PER_RUN * to_compute + _PER_PATH * paths
    low, likely, high = (fixed + each for each in seconds)
    told = scene.effort is not None
    return Estimate(
        runs=study.size,
        to_compute=to_compute,
        paths=paths,
        unknowns=unknowns if told else None,
        increments=increments if told else None,
        longest=longest if told else None,
        cpu_seconds=(low, likely, high) if told else None,
        bytes=round(to_compute * _file_size(study, store, unknowns) * _COMBINED),
        basis=pace.basis if told else f"{scene.name} does not tell the work of its paths",
    )


def _missing(study: Study, store: Store) -> Iterator[tuple[LoadingPath, list[Any]]]:
    """Yield each path that lacks runs, and the values of its branch parameter that it lacks."""
    branch = study.problem.branch
    paths = study.paths()
    while batch := list(itertools.islice(paths, _BATCH)):
        ids = (case.id for path in batch for case in path.cases)
        done = store.catalogue.having(SOLVED, ids, study.keep)
        for path in batch:
            if missing := [case.values.get(branch) for case in path.cases if case.id not in done]:
                yield path, missing


def _file_size(study: Study, store: Store, unknowns: int) -> float:
    """Return the usual size of a run's file [bytes], of runs that keep as much as these."""
    rows, _ = store.catalogue.runs(scene=study.problem.name, status=OK, limit=20)
    files = (store.run_path(row["id"]) for row in rows if row["keep"] == study.keep)
    sizes: Sequence[int] = [file.stat().st_size for file in files if file.exists()]
    fields = _FIELDS * unknowns if study.keep else 0
    return float(np.mean(sizes)) if sizes else _BYTES + fields
