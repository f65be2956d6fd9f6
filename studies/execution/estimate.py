"""Estimate of the cost of a study before it is computed, and bounds on it.

The time of an increment follows from past runs in the catalogue: seconds = c unknowns^p increments
is fitted to those of the same scene. ``cpu_seconds`` and ``increments`` of a run both include the
increments that it shares with other runs of its path, so that their ratio is correct.
"""

from __future__ import annotations

import contextlib
import itertools
import math
import os
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from solver.derivatives.asked import WIDER
from solver.errors import ModelError
from solver.memory import most_kept
from solver.scenes import Effort, Scene
from studies.definition.cases import LoadingPath
from studies.definition.parameters import build
from studies.definition.study import Study
from studies.definition.vocabulary import FIELDS, OK, SOLVED
from studies.errors import StudyError
from studies.execution.bundles import most_together, setup_of
from studies.execution.executor import LOADED
from studies.numbers import size_text, time_text
from studies.storage.store import Store

_PER_RUN, _PER_SETUP = (0.075, 40e-6), (0.075, 40e-6)
"""Seconds, and seconds per element: for the results, audit and file of a run; for the mesh and the
operators, which a path has alone or shares with others of equal `Scene.setup`. Measured: 0.15 to
0.35 s a run of some hundred elements, then 50 to 150 us per element."""
_AROUND = 2.5
"""Factor of the low and high estimates of these seconds."""
_BYTES, _COMBINED = 1.1e6, 1.8
"""Size of a run's file if none is known; factor for the data set of a study beside the files."""
_FIELDS = 100
"""Bytes per unknown that kept fields add to a run's file, if none is known: 55 to 185."""
_TOLD = 2.0
"""Factor of the low and high estimates where the scene tells the seconds."""
_NEIGHBOUR = 0.75
"""Memory of the set-up of a neighbouring run over the memory of its path: .4 to .7 on a rail."""
_BATCH = 500


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """The cost of a study. All numbers except `runs` are for the runs that the store lacks.

    Of a study that chooses its runs they are the most that it may cost: see `Kind.longest`; only
    `cpu_seconds` are those that it is expected to take: see `Kind.usual_runs`.

    Attributes
    ----------
    runs : number of runs of the study
    to_compute : number of runs that the store does not have
    paths : number of loading paths to walk
    unknowns : largest number of displacement unknowns of a run
    increments : number of increments of all paths, if none is cut
    longest : largest number of increments of one path, if all are halved as often as permitted
    cpu_seconds : processor time, low, likely and high: 16 %, 50 % and 84 % quantiles of past runs;
        half, once and twice what the scene states, if it states seconds
    usual_runs : the number of runs for which these are
    most_cpu_seconds : high processor time of the most runs
    bytes : size on the disk, with the data set
    memory : most bytes of a worker process: libraries, the path that needs most, and what is kept
        of paths before
    basis : on which data the estimate is based, as text
    going_on : number of paths that go on from a stored run

    A number that cannot be estimated is None.
    """

    runs: int
    to_compute: int
    paths: int
    unknowns: int | None
    increments: int | None
    longest: int | None
    cpu_seconds: tuple[float, ...] | None
    usual_runs: int
    most_cpu_seconds: float | None
    bytes: int
    memory: int | None
    basis: str
    going_on: int = 0

    @property
    def time(self) -> str:
        """The processor time and its range as text; empty if it is not known."""
        low, likely, high = self.cpu_seconds or (0.0, 0.0, 0.0)
        if self.cpu_seconds is None:
            return ""
        most = self.most_cpu_seconds if self.usual_runs < self.runs else None
        return time_text(likely, low, high, most)

    def costs(self, chooses: bool) -> dict[str, str]:
        """Return all as text by name, of a study that chooses its runs or of another one."""
        unknown = "not known"
        most = f"about {self.usual_runs}, at most {self.runs}; some of them may be there"
        lacking = f"{self.to_compute} to compute" if self.to_compute else "all are stored"
        times = f"{self.increments} in all, at most {self.longest} on a path"
        walks = f"{self.paths} to walk"
        if self.going_on:
            walks += f", {self.going_on} of them on from the end of a stored run"
        return {
            "runs": most if chooses else f"{self.runs} in all, {lacking}",
            "loading paths": walks,
            "unknowns": unknown if self.unknowns is None else f"at most {self.unknowns} a run",
            "increments": unknown if self.increments is None else times,
            "processor time": self.time or unknown,
            "memory": f"about {size_text(self.memory)} a worker" if self.memory else unknown,
            "disk": f"about {size_text(self.bytes)}",
            "estimated from": self.basis,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Bounds:
    """Upper bounds on the cost of a study; None sets no bound.

    Attributes
    ----------
    runs : number of runs of the study
    unknowns : number of unknowns of a run
    increments : number of increments of a loading path
    cpu_seconds : likely processor time of the study
    bytes : size on the disk
    """

    runs: int | None = None
    unknowns: int | None = None
    increments: int | None = None
    cpu_seconds: float | None = None
    bytes: int | None = None

    def check_count(self, store: Store, runs: int, scene: Scene, keep: Any) -> None:
        """Refuse a number of runs, before one of them is made; as `refuse`.

        What the runs that `store` can lack will store is at least that of the scene's usual files.
        """
        self.refuse(runs=runs)
        there = store.catalogue.counts()
        lacking = runs - sum(there.get(status, 0) for status in SOLVED)
        if lacking > 0:
            self.refuse(bytes=lacking * _file_size(scene.name, keep, store) * _COMBINED)

    def check(self, estimate: Estimate) -> None:
        """Refuse a study whose estimate exceeds a bound; as `refuse`."""
        self.refuse(
            runs=estimate.runs,
            unknowns=estimate.unknowns,
            increments=estimate.longest,
            cpu_seconds=estimate.cpu_seconds[1] if estimate.cpu_seconds else None,
            bytes=estimate.bytes,
        )

    def refuse(self, **requested: float | None) -> None:
        """Refuse what exceeds a bound; None is accepted.

        Raises
        ------
        StudyError
            naming the bound, and the setting that holds it
        """
        for name, value in requested.items():
            most = getattr(self, name)
            if most is not None and value is not None and value > most:
                allowed = f"at most {most:g}: {_MEANING[name]} (setting max_{name})"
                raise StudyError(f"estimate.{name}", round(value), allowed)


_MEANING = {
    "runs": "use fewer values in sweep",
    "unknowns": "use a coarser mesh",
    "increments": "use larger or fewer increments",
    "cpu_seconds": "use fewer runs, a coarser mesh or larger increments",
    "bytes": "use fewer runs",
}


def estimate(study: Study, store: Store, bounds: Bounds | None = None) -> Estimate:
    """Return the cost of the runs of `study` that `store` lacks; nothing is written.

    Runs that the scene cannot set up end at once and cost nothing.

    Raises
    ------
    StudyError
        for the first run, if the store has none and the scene can set up none; as soon as the runs
        so far exceed one of the `bounds`
    ModelError
        if the setting of the memory that is kept is not a size
    """
    scene = study.problem
    pace = pace_of(store, scene.name)
    to_compute, paths, unknowns, increments, longest, memory = 0, 0, 0, 0, 0, 0
    set_ups: dict[Hashable, list[float]] = {}
    basis, alone, results, kept = pace.basis, 0.0, 0.0, most_kept()
    usual = study.usual_runs
    share, seconds = usual / max(study.size, 1), [0.0, 0.0, 0.0]
    refused: list[StudyError] = []
    begun: list[int] = []
    for path, missing, own in _missing(study, store):
        begun += own
        to_compute += len(missing)
        paths += 1
        elements, set_up = 0, 0.0
        if scene.effort is not None:
            try:
                effort = _effort(scene, path, missing, own)
            except ModelError as error:
                refused.append(study.expansion.located(error, path.cases[0].index))
                results += len(missing) * _of(_PER_RUN, 0)
                continue
            set_up, elements = effort.set_up, effort.elements
            unknowns = max(unknowns, effort.unknowns)
            memory = max(memory, _of_a_worker(effort, kept))
            increments += effort.increments
            longest = max(longest, effort.most_increments)
            if effort.seconds is None:
                more = pace.seconds(effort)
            else:
                more = effort.seconds / _TOLD, effort.seconds, effort.seconds * _TOLD
                basis = f"what passes of {scene.name} took elsewhere"
            cost = scene.derivatives.cost(scene.derives) if scene.derivatives else 1.0
            seconds = [each + cost * one for each, one in zip(seconds, more, strict=True)]
            if bounds:
                bounds.refuse(unknowns=unknowns, increments=longest, cpu_seconds=share * seconds[1])
        results += len(missing) * _of(_PER_RUN, elements)
        set_up += _of(_PER_SETUP, elements)
        if scene.setup is None:
            alone += set_up
        else:
            set_ups.setdefault(setup_of(scene, path), []).append(set_up)
    if refused and len(refused) == paths and to_compute == study.size:
        raise refused[0]
    fixed = results + alone + _shared(list(set_ups.values()))
    factors = 1 / _AROUND, 1.0, _AROUND
    most = [fixed * factor + each for factor, each in zip(factors, seconds, strict=True)]
    known = scene.effort is not None
    found = Estimate(
        runs=study.size,
        to_compute=to_compute,
        paths=paths,
        unknowns=unknowns if known else None,
        increments=increments if known else None,
        longest=longest if known else None,
        cpu_seconds=tuple(share * each for each in most) if known else None,
        usual_runs=usual,
        most_cpu_seconds=most[-1] if known else None,
        bytes=round(to_compute * _file_size(scene.name, study.keep, store, unknowns) * _COMBINED),
        memory=memory if known else None,
        basis=basis if known else f"{scene.name} does not estimate the work of its paths",
        going_on=len(begun),
    )
    if bounds:
        bounds.check(found)
    return found


def _effort(scene: Scene, path: LoadingPath, values: list[Any], begun: Sequence[int]) -> Effort:
    """Return the work of a path, without that of the stored run that it goes on from.

    Neighbouring runs of its derivatives may have set-ups of their own.
    """
    assert scene.effort is not None
    own = scene.effort(path.parameters, values)
    further = _set_ups(scene, path.parameters) - 1
    if further > 0:
        memory = round(own.memory * (1 + _NEIGHBOUR * further))
        own = replace(own, set_up=own.set_up * (1 + further), memory=memory)
    return own.without(scene.effort(path.parameters, begun)) if begun else own


def _set_ups(scene: Scene, parameters: Any) -> int:
    """Return the number of different set-ups of a run of passes and its neighbours."""
    asked, setup = scene.derivatives, scene.setup
    if not (asked and setup and scene.derives):
        return 1
    each = {setup(parameters)}
    for name, step in asked.steps(parameters, dict.fromkeys(asked.by, WIDER)).items():
        with contextlib.suppress(ModelError):  # then the other side is taken
            each.add(setup(replace(parameters, **{name: getattr(parameters, name) + step})))
    return len(each)


def _begun(path: LoadingPath, missing: Sequence[Any], store: Store) -> list[int]:
    """Return the first value of `Store.begun` for the first run that a path lacks, or none."""
    branch = path.cases[0].scene.branch
    first = next(case for case in path.cases if case.values.get(branch) in missing)
    # the catalogue knows at once that no shorter run keeps its state
    kept = first.shorter and store.catalogue.having(SOLVED, list(first.shorter), FIELDS)
    found = store.begun(first) if kept else None
    return [found[0]] if found else []


def _of(seconds: tuple[float, float], elements: int) -> float:
    return seconds[0] + seconds[1] * elements


def memory_needed(study: Study) -> int:
    """Return the most bytes of a worker, see `Estimate`, for the first paths; 0 if not known."""
    scene, most, kept = study.problem, 0, most_kept()
    if scene.effort is None:
        return most
    branch = scene.branch
    paths = ((path, [case.values.get(branch) for case in path.cases]) for path in study.paths())
    every = _longest(study) if study.kind.chooses else paths
    for path, values in itertools.islice(every, _BATCH):
        with contextlib.suppress(ModelError):  # its runs will end at once
            most = max(most, _of_a_worker(_effort(scene, path, values, ()), kept))
    return most


def _of_a_worker(effort: Effort, kept: int) -> int:
    """Return the most bytes of a worker that walks such a path, and keeps so many of others."""
    return round(LOADED + effort.memory + min(effort.memory, kept))


def _shared(each: list[list[float]]) -> float:
    """Return the seconds of set-ups, given those of the paths of each: every process makes its own.

    Paths of equal set-up go to a process in bundles.
    """
    processes = os.cpu_count() or 1
    most = most_together(sum(map(len, each)), processes)
    return sum(max(own) * min(processes, -(-len(own) // most)) for own in each)


def _missing(study: Study, store: Store) -> Iterator[tuple[LoadingPath, list[Any], list[int]]]:
    """Yield each path that lacks runs, the values of its branch parameter, and where it begins."""
    branch = study.problem.branch
    if study.kind.chooses:
        yield from ((*each, []) for each in _longest(study))
        return
    any_stored = bool(store.catalogue.counts())
    paths = study.paths()
    # the catalogue of an address may lack runs of other machines until something is computed here
    stored = store.stored_runs() if isinstance(store.address, str) else set()
    while batch := list(itertools.islice(paths, _BATCH)):
        ids = [case.id for path in batch for case in path.cases]
        done = store.catalogue.having(SOLVED, ids, study.keep)
        there = stored.intersection(ids)
        done |= there - store.catalogue.rows(there).keys()
        for path in batch:
            if missing := [case.values.get(branch) for case in path.cases if case.id not in done]:
                yield path, missing, _begun(path, missing, store) if any_stored else []


def _longest(study: Study) -> Iterator[tuple[LoadingPath, list[Any]]]:
    """Yield the loading paths of the most runs that a study may ask for, and their values."""
    for place, sets, values in study.kind.longest(study.cases(), study.problem.branch):
        yield (
            LoadingPath(place.id, build(study.problem, {**place.values, **sets}), (place,)),
            values,
        )


def _file_size(scene: str, keep: str, store: Store, unknowns: int = 0) -> float:
    """Return the usual size [bytes] of the file of a run with this ``keep``."""
    rows, _ = store.catalogue.runs(scene=scene, status=OK, limit=20)
    files = (store.run_path(row["id"]) for row in rows if row["keep"] == keep)
    sizes: Sequence[int] = [file.stat().st_size for file in files if file.exists()]
    fields = _FIELDS * unknowns if keep else 0
    return float(np.mean(sizes)) if sizes else _BYTES + fields


_FIGURES = ("degrees_of_freedom", "increments", "cpu_seconds")
_PAST = 1000
"""Largest number of past runs in the fit, the latest ones."""
_ENOUGH = 8
"""Smallest number of past runs for a fit."""
_RATE, _AT, _EXPONENT = 6e-6, 14_000, 1.15
"""Measured: seconds per unknown and increment, the number of unknowns at which, and p."""
_LEAST = 1_500
"""Number of unknowns below which an increment takes no less time."""
_DOUBT = 0.2
"""Uncertainty of p; it matters for other numbers of unknowns than those of past runs."""
_WIDE = 5.0
"""Factor of the low and high estimates without past runs: increments of bodies that yield take 1.5
to 30 us per unknown, by how far they yield (`tests/stability/estimates.py`)."""


@dataclass(frozen=True, slots=True)
class Pace:
    """Seconds of an increment: ``rate * unknowns ** exponent``.

    Attributes
    ----------
    low, high : factors for the 16 % and 84 % quantiles of past runs
    known_at : number of unknowns of the past runs
    basis : on which data it is based, as text
    elsewhere : whether the past runs are of other scenes, so that `Effort.slow` and
        `Effort.divided` count
    """

    rate: float
    exponent: float
    low: float
    high: float
    known_at: float
    basis: str
    elsewhere: bool = False

    def seconds(self, effort: Effort) -> tuple[float, float, float]:
        """Return low, likely and high seconds of the increments of a path."""
        least, most = effort.increments, effort.most_increments
        size = max(effort.unknowns, _LEAST)
        one = self.rate * size**self.exponent
        if self.elsewhere:
            most, one = most + effort.divided, one * effort.slow
        doubt = math.exp(_DOUBT * abs(math.log(size / self.known_at)))
        likely = one * math.sqrt(least * most)
        return one * least * self.low / doubt, likely, one * most * self.high * doubt


def pace_of(store: Store, scene: str) -> Pace:
    """Return the pace of past runs of a scene; if they are too few, one measured elsewhere."""
    found = store.catalogue.figures(scene, OK, _FIGURES, _PAST)
    past = np.array([row for row in found if None not in row and min(row) > 0], dtype=float)
    if len(past) < _ENOUGH:
        rate = _RATE * _AT ** (1 - _EXPONENT)
        basis = f"a pace measured elsewhere: fewer than {_ENOUGH} runs of {scene} are stored here"
        return Pace(rate, _EXPONENT, 1 / _WIDE, _WIDE, _AT, basis, True)
    basis = f"the pace of the last {len(past)} runs of {scene} stored here"
    unknowns, increments, seconds = past.T
    unknowns = np.maximum(unknowns, _LEAST)
    return _fitted(unknowns, increments, seconds, basis)


def _fitted(unknowns: np.ndarray, increments: np.ndarray, seconds: np.ndarray, basis: str) -> Pace:
    """Return the pace by least squares of logarithms, without outliers.

    Runs of one mesh do not determine the exponent. It is regularised towards the usual one, with
    the weight of its uncertainty relative to the usual scatter of runs (0.4).
    """
    x, y = np.log(unknowns), np.log(seconds / increments)
    kept = np.full(len(x), True)
    weight = (0.4 / _DOUBT) ** 2
    for _ in range(2):
        from_mean = x - x[kept].mean()
        product = (from_mean * (y - y[kept].mean()))[kept].sum()
        exponent = (product + weight * _EXPONENT) / ((from_mean[kept] ** 2).sum() + weight)
        off = y - exponent * x
        middle = np.median(off[kept])
        kept = np.abs(off - middle) <= 5 * np.median(np.abs(off - middle)) + 1e-12
    # the ratio of sums, not the mean of logarithms: a study is a sum of runs
    size = unknowns**exponent * increments
    rate = seconds[kept].sum() / size[kept].sum()
    low, high = np.quantile(seconds / size / rate, [0.16, 0.84])
    known_at = float(np.exp(x[kept].mean()))
    return Pace(float(rate), float(exponent), min(low, 1.0), max(high, 1.0), known_at, basis)
