"""What a study adds to its runs: start, workers, storage, catalogue, memory.

Measured is the wall time of the command ``residua run`` in fresh directories, so the machine must
be idle. The runs' own time is that of the same paths in this process, which stores nothing.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil

from solver import SCENES
from studies import Study, open_study
from tests.benchmarks.measure import timed
from tests.stress.measure import Figure, megabytes

RUNS = 8
"""Runs of the balanced study: the same punch in other sizes, so that all take the same time."""
PATHS = 10_000
COARSE = {"smallest_element": 0.05, "growth": 2.0, "load_step": 0.2}
_SMALL = {"coarse": COARSE, "draft": {"accuracy": "draft"}}
_GAINS = {16: 1.6, 32: 1.6, 64: 1.8}
"""Numbers of equal small runs, and how much faster two workers shall be than one."""
_TABLE = Path(__file__).parents[2] / "data" / "studies" / "rolling-table.toml"
_LOOK = 0.5  # seconds between two looks at the memory


@dataclass(frozen=True, slots=True)
class Content:
    """A study: its scene, its parameters, its sweep."""

    scene: str
    parameters: Mapping[str, Any]
    sweep: Mapping[str, Sequence[float]]

    def written(self, folder: Path) -> Path:
        """Return the study file, written into a folder."""
        lines = ['name = "measured"', f'scene = "{self.scene}"']
        lines += ['allow = ["large_strain"]', "[parameters]"]  # time alone is measured
        lines += [f"{name} = {json.dumps(value)}" for name, value in self.parameters.items()]
        lines += ["[sweep]", *(f"{name} = {list(each)}" for name, each in self.sweep.items())]
        path = folder / "study.toml"
        path.write_text("\n".join(lines) + "\n")
        return path


@dataclass(frozen=True, slots=True)
class Own:
    """What runs cost by themselves: CPU [s], and the part of it that a record tells."""

    cpu: float
    told: float


def measure(quick: bool) -> list[Figure]:
    """Return what was measured, with the goals."""
    with tempfile.TemporaryDirectory(prefix="residua-sweep-") as folder:
        return [*balanced(Path(folder), quick), *many(Path(folder), 200 if quick else PATHS)]


def balanced(folder: Path, quick: bool) -> list[Figure]:
    """Return start, speed-up, overhead, and the time to answer a complete study again."""
    one = Content("punch", COARSE, {"half_width": [50.0]})
    start = _wall(one.written(folder), folder / "one", 1) - _own(one).cpu
    parameters = {"friction": 0.4, **(COARSE if quick else {})}
    study = Content("punch", parameters, {"half_width": [40.0 + k for k in range(RUNS)]})
    file, own = study.written(folder), _own(study)
    walls, shares = {}, {}
    for workers in (1, 2):
        out = folder / f"by-{workers}"
        walls[workers] = _wall(file, out, workers)
        with open_study(out) as dataset:
            told = float(dataset["cpu_seconds"].sum())
        work = (walls[workers] - start) * workers
        shares[workers] = (work - own.cpu * told / own.told) / work
    again = _wall(file, folder / "by-2", 2)
    return [
        Figure("start: a study of one small run, without the run", start, "s", most=3.0),
        Figure(f"{RUNS} equal runs, 1 worker", walls[1], "s"),
        Figure("the same, 2 workers", walls[2], "s"),
        Figure("2 workers over 1", walls[2] / walls[1], most=0.55),
        Figure("time of 1 worker, start left out, that is not the runs' own", 100 * shares[1], "%",
               most=5.0),
        Figure("the same, 2 workers", 100 * shares[2], "%", most=5.0),
        Figure("the same study again, complete", again, "s", most=1.0),
    ]  # fmt: skip


def pairs(quick: bool) -> list[Figure]:
    """Return the times of equal small runs by one worker and by two."""
    figures = []
    with tempfile.TemporaryDirectory(prefix="residua-pairs-") as name:
        folder = Path(name)
        for size, parameters in _SMALL.items():
            for count, least in {4: 0.5}.items() if quick else _GAINS.items():
                sweep = {"half_width": [40.0 + k for k in range(count)]}
                file = Content("punch", {"friction": 0.4, **parameters}, sweep).written(folder)
                one, two = (
                    _wall(file, folder / f"{size}-{count}-{workers}", workers) for workers in (1, 2)
                )
                what = f"{count} punches, {size}"
                figures += [
                    Figure(f"{what}: 1 worker", one, "s"),
                    Figure(f"{what}: 2 workers", two, "s"),
                    Figure(f"{what}: time of 2 workers over that of 1", two / one, most=1 / least),
                ]
            if quick:
                break
    return figures


def table(quick: bool) -> list[Figure]:
    """Return the time of the published table of ten cases of rolling, by two workers."""
    with tempfile.TemporaryDirectory(prefix="residua-table-") as name:
        file, text = Path(name) / "table.toml", _TABLE.read_text()
        if quick:
            text = text.replace("track = 50.0", 'track = 24.0\naccuracy = "draft"')
        file.write_text(text)
        return [Figure("T1 to T10, 2 workers", _wall(file, Path(name) / "out", 2), "s", most=85.0)]


def _own(content: Content) -> Own:
    """Return the cost of all runs, from two of the first: they are equal."""
    study = Study.from_dict({
        "name": "measured", "scene": content.scene, "parameters": dict(content.parameters),
        "sweep": {name: list(each) for name, each in content.sweep.items()},
    })  # fmt: skip
    path, scene = next(iter(study.paths())), SCENES[content.scene]
    values = [getattr(path.parameters, scene.branch)]

    def walk(_: int) -> float:
        (record,) = scene.path(path.parameters, values, lambda share: None)
        return float(record.scalars["cpu_seconds"])

    walk(0)  # compiles
    run = timed(walk, 2)
    return Own(study.size * run.cpu, study.size * run.result)


def _wall(file: Path, out: Path, workers: int) -> float:
    """Return the seconds that the command takes; raise where it fails."""
    began = time.monotonic()
    residua = [sys.executable, "-m", "residua"]
    subprocess.run(residua + _arguments(file, out, workers), check=True, capture_output=True)
    return time.monotonic() - began


def _arguments(file: Path, out: Path, workers: int) -> list[str]:
    return ["run", str(file), "--out", str(out), "--workers", str(workers)]


def many(folder: Path, paths: int) -> list[Figure]:
    """Return how long paths that cost nothing take, and memory by the way."""
    content = Content("fake", {}, {"friction": [k / paths for k in range(paths)]})
    residua = [sys.executable, "-m", "tests.residua.command"]  # it knows the scene
    command = residua + _arguments(content.written(folder), folder / "many", 2)
    began = time.monotonic()
    marks, done = [], 0
    with subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    ) as process:
        watch = _Watch(process.pid)
        assert process.stderr is not None
        for line in process.stderr:
            if "ok" in line:
                done += 1
                if done % (paths // 4) == 0:
                    marks.append(watch.peak())
        watch.close()
    if process.returncode or done != paths:
        raise RuntimeError(f"{done} of {paths} paths, exit status {process.returncode}")
    seconds = time.monotonic() - began
    figures = [Figure(f"{paths} paths that cost nothing, 2 workers", seconds, "s")]
    for quarter, (main, worker) in enumerate(marks, start=1):
        figures += [
            Figure(f"peak memory in quarter {quarter}: main process", main, "MB"),
            Figure(f"peak memory in quarter {quarter}: largest worker", worker, "MB"),
        ]
    growth = [100 * (marks[3][k] / marks[1][k] - 1) for k in (0, 1)]
    return [
        *figures,
        Figure("main process, from the second quarter to the last", growth[0], "%", most=5.0),
        Figure("largest worker, from the second quarter to the last", growth[1], "%", most=5.0),
    ]


class _Watch:
    """Looks at the memory of a process and of its children until it is closed."""

    def __init__(self, pid: int) -> None:
        self._process = psutil.Process(pid)
        self._peak = (0.0, 0.0)
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._thread.start()

    def peak(self) -> tuple[float, float]:
        """Return the most of the process, and of one child [MB], since the last call."""
        self._look()
        peak, self._peak = self._peak, (0.0, 0.0)
        return peak

    def close(self) -> None:
        """Stop looking."""
        self._closing.set()
        self._thread.join()

    def _watch(self) -> None:
        while not self._closing.wait(_LOOK):
            self._look()

    def _look(self) -> None:
        with suppress(psutil.Error):  # one has just ended
            main = megabytes(self._process)
            children = [megabytes(child) for child in self._process.children(recursive=True)]
            self._peak = (max(self._peak[0], main), max([self._peak[1], *children]))
