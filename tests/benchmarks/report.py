"""The table, the file of results, and the conditions they were measured under."""

from __future__ import annotations

import json
import math
import os
import platform
import re
from collections.abc import Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path

import numpy as np

from solver import __version__
from solver.linear import pardiso
from solver.linear.solvers import chosen
from solver.memory import peak_memory
from tests.benchmarks.measure import Point


def conditions() -> list[str]:
    """Return lines on the machine, the versions and the load at the start."""
    packages = ("numpy", "scipy", "scikit-fem", "numba")
    versions = ", ".join(f"{name} {metadata.version(name)}" for name in packages)
    mkl = "MKL PARDISO" if pardiso.library() is not None else "no MKL: SuperLU throughout"
    busy = os.getloadavg()[0]
    return [
        f"solver {__version__}; Python {platform.python_version()}, {versions}; {mkl}",
        f"{_processor()}, {os.cpu_count()} cores, {platform.system()}; one thread used; "
        f"{busy:.1f} processes were running at the start",
    ]


def _processor() -> str:
    """Return the processor's model name where the system tells it."""
    info = Path("/proc/cpuinfo")
    if info.is_file():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def table(
    points: Sequence[Point], measures: Sequence[str], values: Sequence[str] = ()
) -> list[str]:
    """Return one line a point; in brackets the order of convergence from the one before."""
    lines = [
        f"{'series':<18}{'setting':<26}{'unknowns':>9}{'CPU s':>8}{'noise':>7}"
        + "".join(f"{name:>29}" for name in measures)
        + "".join(f"{name:>18}" for name in values)
    ]
    for before, p in zip([None, *points], points, strict=False):
        errors = "".join(
            f"{p.errors[n]:>20.2e}{_order(before, p, n):>9}" if n in p.errors else f"{'-':>29}"
            for n in measures
        )
        told = "".join(f"{p.values[n]:>18.3g}" for n in values)
        noise = f"{p.spread:>7.0%}" if p.repeats > 1 else f"{'-':>7}"
        lines.append(
            f"{p.series:<18}{p.setting:<26}{p.unknowns:>9}{p.cpu:>8.2f}{noise}{errors}{told}"
        )
    return lines


def _order(before: Point | None, point: Point, measure: str) -> str:
    """Return the slope of log error over log size between two points of a series, in brackets."""
    if before is None or before.series != point.series or before.size == point.size:
        return ""
    pair = (point.errors[measure], before.errors.get(measure, 0.0), point.size, before.size)
    if not np.min(pair) > 0:  # one is exact, or the series has no sizes
        return ""
    return f"({math.log(pair[0] / pair[1]) / math.log(pair[2] / pair[3]):.1f})"


def store(points: Sequence[Point], out: Path) -> None:
    """Write the points of a problem into the JSON file of this machine, beside those of others.

    It has the date and the conditions of each problem, and the peak memory of the process until
    then [MB].
    """
    path = out / f"{re.sub('[^a-z0-9]+', '-', _processor().lower()).strip('-')}.json"
    found = json.loads(path.read_text()) if path.exists() else {}
    problem, series = points[0].problem, []
    for point in points:
        series.append({k: v for k, v in asdict(point).items() if v == v and k != "problem"})
    found[problem] = {
        "date": f"{datetime.now(UTC):%Y-%m-%d}",
        "conditions": conditions(),
        "linear_solver": chosen("auto"),
        "peak_memory": round(peak_memory() / 1e6),
        "points": series,
    }
    path.write_text(json.dumps(found, indent=1, sort_keys=True) + "\n")
