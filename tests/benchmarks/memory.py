"""What a process keeps that computes many loading paths, one after the other, as a worker does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any

import psutil

from solver.memory import release
from studies.scenes.registry import scene_named
from tests.benchmarks.sweep import COARSE
from tests.stress.measure import Figure, megabytes

LOADS = [2.0 + 0.2 * k for k in range(10)]
GEOMETRIES = 200
_FIRST = 10
"""Paths after which a process has what it needs; growth counts from there."""


def measure(quick: bool) -> list[Figure]:
    """Return what a process holds after ten loads of an endless track, and after many punches."""
    level = {"accuracy": "draft" if quick else "standard"}
    tracks = [{**level, "load_ratio": load} for load in (LOADS[:2] if quick else LOADS)]
    count = _FIRST + 2 if quick else GEOMETRIES
    punches = [{**COARSE, "half_width": 40.0 + 0.25 * k} for k in range(count)]
    held, cpu = after_each("rolling", tracks)
    grown, _ = after_each("punch", punches)
    return [
        Figure(f"endless track, {level['accuracy']}: after the first load", held[0], "MB"),
        Figure(f"after {len(held)} loads", held[-1], "MB", most=700.0),
        Figure("processor time of these", cpu, "s"),
        Figure(f"punch: after {_FIRST} geometries", grown[_FIRST - 1], "MB"),
        Figure(f"growth up to {count}", grown[-1] - grown[_FIRST - 1], "MB", most=20.0),
    ]


def after_each(scene: str, paths: Sequence[Mapping[str, Any]]) -> tuple[list[float], float]:
    """Return the memory of a new process after each path [MB], and its processor time [s]."""
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        return pool.submit(_walk, scene, paths).result()


def _walk(name: str, paths: Sequence[Mapping[str, Any]]) -> tuple[list[float], float]:
    scene, process, held = scene_named(name), psutil.Process(), []
    for given in paths:
        parameters = scene.parameters(**given)
        for record in scene.path(parameters, [getattr(parameters, scene.branch)], lambda _: None):
            if not record.status.solved:
                raise RuntimeError(f"{record.status.name}: {record.message} ({parameters})")
        release()
        held.append(megabytes(process))
    times = process.cpu_times()
    return held, times.user + times.system
