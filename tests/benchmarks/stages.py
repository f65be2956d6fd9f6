"""Where the processor time of a first run goes, and what memory its process needs.

Each run has a process of its own, which imports, makes the set-up of the scene, and computes; a
second, equal run takes what the set-up does not.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from typing import Any
from unittest import mock

from solver.memory import peak_memory
from solver.scenes import Scene
from studies.scenes.registry import scene_named
from tests.benchmarks.measure import Point

RUNS: Mapping[str, Mapping[str, Any]] = {
    "punch": {"load_ratio": 0.857, "friction": 0.3}, "ball": {"load_ratio": 3.0}, "shaft_hub": {},
    "rolling": {}, "raceway": {}, "wheel_rail": {},
}  # fmt: skip
STAGES = ("imports", "set_up", "states", "audit", "results", "peak_memory")


def measure(quick: bool) -> list[Point]:
    """Return for each scene the processor time of the stages [s], and the peak memory [MB]."""
    level, runs = ("draft", ["punch"]) if quick else ("standard", [*RUNS])
    points = []
    for name in runs:
        with ProcessPoolExecutor(1, get_context("spawn")) as pool:
            given = {"accuracy": level, **RUNS[name]}
            unknowns, values = pool.submit(_stages, name, given).result()
        cpu = sum(values[stage] for stage in STAGES[:-1])
        points.append(
            Point(problem="stages", series=name, setting=level, unknowns=unknowns, cpu=cpu,
                  spread=0.0, repeats=1, values=values)
        )  # fmt: skip
    return points


def _stages(name: str, given: Mapping[str, Any]) -> tuple[int, dict[str, float]]:
    imports = time.process_time()
    scene = scene_named(name)
    parameters = scene.parameters(**given)
    branch = [getattr(parameters, scene.branch)] if scene.branch else [0.0]
    spent = {"audit": 0.0, "record": 0.0}
    recorded = Scene.record

    def timed(what: str, function: Any, *args: Any) -> Any:
        started = time.process_time()
        found = function(*args)
        spent[what] += time.process_time() - started
        return found

    def record(self: Scene, run: Any) -> Any:
        own = replace(run, check=lambda: timed("audit", run.check))
        return timed("record", recorded, self, own)

    each = []
    for _ in range(2):
        spent |= dict.fromkeys(spent, 0.0)
        started = time.process_time()
        with mock.patch.object(Scene, "record", record):
            (found,) = scene.path(parameters, branch, lambda _: None)
        each.append(time.process_time() - started)
    values = {
        "imports": imports,
        "set_up": each[0] - each[1],
        "states": each[1] - spent["record"],
        "audit": spent["audit"],
        "results": spent["record"] - spent["audit"],
        "peak_memory": peak_memory() / 1e6,
    }
    return int(found.scalars.get("degrees_of_freedom", 0)), values
