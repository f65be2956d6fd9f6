"""The machinery of the benchmark, on runs too small to mean anything."""

from __future__ import annotations

import json
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from tests.benchmarks import accuracy, growth, memory, punch, sweep
from tests.benchmarks.command import (
    benchmark,
    of_accuracy,
    of_hertz,
    of_prism,
    of_punch,
    of_rolling,
    of_stages,
    of_steady,
    of_walls,
)
from tests.benchmarks.measure import Point, timed

TINY = punch.Plan(
    base=replace(punch.BASE, smallest_element=0.05, growth=2.0, load_step=0.2, unload_steps=1),
    finest={"smallest_element": 0.02},
    limits={"load_step": {"load_step": 0.1}},
    cases=(
        punch.Case(series="mesh", setting="base"),
        punch.Case(series="load_step", setting="0.1", changes={"load_step": 0.1}),
        *(punch.Case(series=s, setting="base", linear_solver=s) for s in punch.SOLVERS),
    ),
)


QUICK = (of_steady, of_rolling, of_prism, of_accuracy)


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a benchmark of two Hertz meshes and of thick walls."""
    out = tmp_path_factory.mktemp("benchmarks")
    hertz = partial(of_hertz, out, ("quad4",), (4, 8), 1)
    benchmark(out, (hertz, partial(of_walls, out, quick=True, repeats=1)))
    return out


@pytest.fixture(scope="module")
def longer(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a benchmark of four punches and the quick other problems."""
    out = tmp_path_factory.mktemp("longer")
    others = (partial(of, out, quick=True, repeats=1) for of in QUICK)
    benchmark(out, (partial(of_punch, out, TINY, 1), *others))
    return out


def rows(out: Path, problem: str) -> dict[str, dict[str, float]]:
    """Return the numbers of a problem in the file of the machine, by series and setting."""
    (path,) = out.glob("*.json")
    found = json.loads(path.read_text())[problem]
    assert found["peak_memory"] > 50 and found["linear_solver"] in ("pardiso", "superlu")
    return {
        f"{point['series']} {point['setting']}": {
            **point["values"], **{f"error of {name}": e for name, e in point["errors"].items()}
        }
        for point in found["points"]
    }  # fmt: skip


def test_errors_of_hertz_contact_halve_with_the_mesh(written: Path) -> None:
    hertz = rows(written, "hertz")
    assert hertz["quad4 a/8"]["error of pressure"] < 0.6 * hertz["quad4 a/4"]["error of pressure"]


def test_stages_of_a_run_add_up_to_its_time(tmp_path: Path) -> None:
    """Another problem's results stay in the file of the machine."""
    of_hertz(tmp_path, ("quad4",), (4,), 1)
    of_stages(tmp_path, quick=True)
    ((name, found),) = rows(tmp_path, "stages").items()
    assert name == "punch draft"
    assert min(found[stage] for stage in ("imports", "states", "audit", "results")) > 0
    assert 50 < found["peak_memory"] < 1000
    assert rows(tmp_path, "hertz")


@pytest.mark.long
def test_errors_of_a_steady_pass_fall_with_the_mesh(longer: Path) -> None:
    steady = rows(longer, "steady pass")
    for depth in (2, 5):
        coarse, fine = (steady[f"mesh {h} mm, free"][f"error of {depth} mm"] for h in (4, 2))
        assert fine < 0.8 * coarse, depth


@pytest.mark.long
def test_errors_of_rolling_by_increments_fall_with_the_mesh(longer: Path) -> None:
    rolling = rows(longer, "rolling")
    coarse, fine = (rolling[f"mesh {h} mm, free"]["error of first row"] for h in (4, 2))
    assert 0 < fine < 0.8 * coarse


@pytest.mark.long
def test_errors_of_a_pass_over_a_prism_fall_with_the_elements(longer: Path) -> None:
    prism = rows(longer, "prism")
    coarse, fine = (prism[f"section {h} mm, ellipse"] for h in ("3.33", "2"))
    for measure in ("mean", "largest"):
        assert 0 < fine[f"error of {measure}"] < 0.7 * coarse[f"error of {measure}"]


def test_errors_of_thick_walls_fall_with_the_mesh_at_the_order_of_the_element(
    written: Path,
) -> None:
    """By 2 or more where the element is quadratic and does not lock; the table says so."""
    walls = rows(written, "walls")
    for name, least in (("quad8 {0} x {0}, cylinder", 1.8), ("quad8 {0} x {0}, sphere", 1.8),
                        ("quad4 {0} x {0}, cylinder", 0.8)):  # fmt: skip
        coarse, fine = (walls[name.format(n)]["error of mean"] for n in (8, 16))
        assert np.log2(coarse / fine) > least, name
    (line,) = (
        line
        for line in (written / "table.txt").read_text().splitlines()
        if line.startswith("quad8") and "16 x 16, cylinder" in line
    )
    coarse, fine = (walls[f"quad8 {n} x {n}, cylinder"]["error of mean"] for n in (8, 16))
    assert f"({np.log2(coarse / fine):.1f})" in line


@pytest.mark.long
def test_a_level_of_accuracy_has_an_error_against_a_finer_run(longer: Path) -> None:
    """Draft against sides of two thirds, from 1 mm down and at the first row: some percent."""
    (draft,) = rows(longer, "accuracy").values()
    assert 1.0 < draft["error of largest"] < 15.0


def test_levels_are_those_that_the_scenes_give() -> None:
    for problem in accuracy.PROBLEMS.values():
        for level in accuracy.LEVELS:
            found = accuracy.at_level(problem.parameters, level)
            given = {name: getattr(found, name) for name in found.usual()}
            assert found.accuracy == level
            assert given == dict(found.usual())
        # the reference is finer than any level
        for name, value in problem.finest.items():
            assert value < getattr(found, name) or name == "unload_steps", name


def test_many_paths_are_counted_and_their_memory_is_seen(tmp_path: Path) -> None:
    figures = {figure.what: figure.value for figure in sweep.many(tmp_path, 8)}
    memory = [value for what, value in figures.items() if what.startswith("peak memory")]
    assert len(memory) == 8
    assert figures["8 paths that cost nothing, 2 workers"] > 0
    assert len(list((tmp_path / "many" / "runs").glob("*.nc"))) == 8


def test_a_process_tells_its_memory_after_each_path() -> None:
    punches = [{**sweep.COARSE, "half_width": width} for width in (40.0, 41.0)]
    held, cpu = memory.after_each("punch", punches)
    assert len(held) == 2
    assert min(held) > 50.0  # Python with numpy and scipy
    assert cpu > 0.0


def test_the_exponent_of_growth_is_that_of_a_power() -> None:
    given = {"problem": "", "series": "", "setting": "", "spread": 0.0, "repeats": 1, "values": {}}
    points = [Point(**given, unknowns=n, cpu=1e-6 * n**1.3) for n in (1000, 3000, 20_000)]
    assert growth.exponent(points) == pytest.approx(1.3)


@pytest.mark.long
def test_errors_of_the_punch_are_distances_from_its_references(longer: Path) -> None:
    punches = rows(longer, "punch")
    finest, mesh, step = (
        punches[name] for name in ("finest reference", "mesh base", "load_step 0.1")
    )
    assert mesh["error of plastic_work"] == pytest.approx(
        abs(mesh["plastic_work"] / finest["plastic_work"] - 1)
    )
    assert mesh["error of plastic_work"] > 1e-6
    # this series tends to this very run
    assert step["error of plastic_work alone"] == 0.0
    assert step["error of plastic_work"] > 0.0
    for name in ("plastic_work", "residual_x_half_plane", "residual_x_punch"):
        assert punches["superlu base"][name] == pytest.approx(
            punches[f"{punch.SOLVERS[0]} base"][name], rel=1e-4, abs=1e-3
        )


def test_every_figure_and_the_table_are_written(written: Path) -> None:
    names = {path.name for path in written.glob("*.png")}
    assert names == {"hertz.png", "walls-cylinder.png", "walls-sphere.png"}
    assert "one thread used" in (written / "table.txt").read_text()


@pytest.mark.long
def test_so_are_those_of_what_takes_longer(longer: Path) -> None:
    assert {path.name for path in longer.glob("*.png")} == {
        "punch-mesh.png",
        "punch-element.png",
        "punch-increments.png",
        "punch-solver.png",
        "rolling-free.png",
        "accuracy.png",
        "prism-ellipse.png",
        "steady-free.png",
    }
    assert "superlu" in (longer / "table.txt").read_text()


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
