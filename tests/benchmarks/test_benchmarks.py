"""The machinery of the benchmark, on runs too small to mean anything."""

from __future__ import annotations

import csv
import time
from dataclasses import replace

import pytest

from tests.benchmarks import punch
from tests.benchmarks.command import benchmark
from tests.benchmarks.measure import timed

TINY = punch.Plan(
    base=replace(punch.BASE, smallest_element=0.05, growth=2.0, load_step=0.2, unload_steps=1),
    finest={"smallest_element": 0.02},
    limits={"load_step": {"load_step": 0.1}},
    cases=(
        punch.Case(series="mesh", setting="base"),
        punch.Case(series="load_step", setting="0.1", changes={"load_step": 0.1}),
        punch.Case(series="pardiso", setting="base", linear_solver="auto"),
        punch.Case(series="superlu", setting="base", linear_solver="superlu"),
    ),
    repeats=1,
)


def test_errors_are_distances_from_the_reference() -> None:
    finest, mesh, step, pardiso, superlu = punch.measure(TINY)
    assert mesh.errors["plastic_work"] == pytest.approx(
        abs(mesh.values["plastic_work"] / finest.values["plastic_work"] - 1)
    )
    assert mesh.errors["plastic_work"] > 1e-6
    # the series tends to this very run
    assert step.errors["plastic_work alone"] == 0.0
    assert step.errors["plastic_work"] > 0.0
    assert superlu.errors == pytest.approx(pardiso.errors, rel=1e-4, abs=1e-6)


def test_a_benchmark_writes_its_tables_and_figures(tmp_path, capsys) -> None:
    benchmark(tmp_path, meshes=(4, 8), plan=TINY, repeats=1)
    with (tmp_path / "hertz.csv").open() as file:
        rows = list(csv.DictReader(file))
    errors = {r["setting"]: float(r["error of pressure"]) for r in rows if r["series"] == "quad8"}
    assert errors["a/8"] < 0.6 * errors["a/4"]
    pictures = {path.name for path in tmp_path.glob("*.png")}
    assert pictures == {
        "hertz.png",
        "punch-mesh.png",
        "punch-element.png",
        "punch-increments.png",
        "punch-solver.png",
    }
    printed = capsys.readouterr().out
    assert printed == (tmp_path / "table.txt").read_text()
    assert "one thread used" in printed


def test_short_runs_are_repeated_and_their_median_is_taken() -> None:
    def spin(repeat: int) -> int:
        until = time.process_time() + (0.01, 0.05, 0.02)[repeat]
        while time.process_time() < until:
            pass
        return repeat

    run = timed(spin)
    assert run.repeats == 3
    # the median of three lies between the other two however busy the machine is
    assert run.cpu * (1 + run.spread) >= run.cpu > 0
    assert run.spread > 0
