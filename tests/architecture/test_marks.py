"""A test without a mark neither solves nor starts a process: ``make check`` is quick."""

from __future__ import annotations

import multiprocessing
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from solver import Amplitude, Body, Displacement, Material, Model, Stage, solve
from solver.mesh import grid
from solver.rolling.scenes.rolling import RollingParameters
from solver.rolling.scenes.rolling_endless import steady_passes
from tests.architecture.sources import PROJECT, ROOT, tracked
from tests.marks import EXPENSIVE, FOLDERS, HERE, UNDIVIDED, allowed, of_folder


def pulled() -> object:
    """Solve a square that is pulled."""
    side = np.linspace(0.0, 1.0, 2)
    steel = Material(youngs_modulus=2e5, poisson_ratio=0.3)
    body = Body(name="bar", mesh=grid(side, side), material=steel,
                supports={"left": "x", "bottom": "y"}, pressure={"right": -1.0})  # fmt: skip
    return solve(Model(bodies=(body,)))


def rolled() -> object:
    """Find a steady pass."""
    parameters = RollingParameters(element_size=4.0, growth=2.0, load="hertz", friction=0.0)
    return next(steady_passes(parameters))


def started() -> object:
    """Start a process."""
    return subprocess.run([sys.executable, "-c", "pass"], check=True)


def forked() -> object:
    """Start a process as workers are started."""
    process = multiprocessing.get_context("spawn").Process(target=print)
    process.start()
    return process


@pytest.mark.parametrize(
    ("dear", "mark"),
    [(pulled, "solves"), (rolled, "solves"), (started, "processes"), (forked, "processes")],
)
def test_a_test_without_the_mark_fails(dear: Callable[[], object], mark: str) -> None:
    with pytest.raises(pytest.fail.Exception, match=f"mark `{mark}`"):
        dear()


def test_a_test_without_marks_may_ask_for_the_files_of_the_project() -> None:
    assert Path("Makefile") in tracked()


@pytest.mark.solves
def test_a_test_that_solves_starts_no_process() -> None:
    assert pulled()
    with pytest.raises(pytest.fail.Exception, match="mark `processes`"):
        started()


@pytest.mark.processes
def test_a_test_that_starts_a_process_does_not_solve() -> None:
    assert started()
    with pytest.raises(pytest.fail.Exception, match="mark `solves`"):
        pulled()


@pytest.mark.pages
def test_a_page_may_do_both() -> None:
    assert pulled() and started()


def test_the_quick_check_leaves_out_every_mark() -> None:
    marks = {each.partition(":")[0] for each in PROJECT["tool"]["pytest"]["ini_options"]["markers"]}
    assert marks == {*EXPENSIVE, "pages", "divides", "long"}
    (left_out,) = re.findall(r'pytest .*-m "(.*)"', (ROOT / "Makefile").read_text())
    assert set(left_out.split(" and ")) == {f"not {mark}" for mark in marks - {"divides"}}


def test_long_tests_are_run_by_the_stress_run_alone() -> None:
    chosen = re.findall(
        r"^(\w+):.*\n\t\$\(SUITE\).* -m (.*)", (ROOT / "Makefile").read_text(), re.M
    )
    assert dict(chosen) == {"test": '"not long"', "stress": "long"}


@pytest.mark.solves
@pytest.mark.divides
def test_increments_are_divided_as_the_marks_say() -> None:
    def increments() -> int:
        """Return how many increments a stretched square takes whose flow turns."""
        side, amplitude = np.linspace(0.0, 1.0, 2), Amplitude([0, 1, 2], [0, 1, 1])
        body = Body(
            name="square", mesh=grid(side, side), supports={"bottom": "xy"},
            material=Material(youngs_modulus=2e5, poisson_ratio=0.3, yield_stress=200.0),
            loads=(Displacement(boundary="top", y=0.004, amplitude=amplitude),
                   Displacement(boundary="top", x=0.02, amplitude=Amplitude([1, 2], [0, 1]))),
        )  # fmt: skip
        stages = tuple(Stage(name=str(time), target=time, steps=1) for time in (1.0, 2.0))
        return len(solve(Model(bodies=(body,)), stages=stages).tally.iterations)

    divided = increments()
    with allowed({"solves"}):
        assert increments() == 2 < divided


def test_marks_of_folders_are_known_and_their_folders_exist() -> None:
    assert {mark for marks in FOLDERS.values() for mark in marks} <= EXPENSIVE.keys()
    for folder, marks in FOLDERS.items():
        own = of_folder(HERE / folder / "test_any.py")
        assert own == (marks if folder in UNDIVIDED else (*marks, "divides"))
        assert list((HERE / folder).glob("test_*.py"))
    assert of_folder(HERE / "test_docs.py") == ("divides",)
