"""Killed in mid study: nothing looks finished that is not, and nothing is computed twice."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

from studies import Limits, Store, Study, StudyEvent, open_netcdf, run_study
from tests.service.servers import wait_until
from tests.studies.conftest import fake_study

pytestmark = pytest.mark.processes

ROOT = Path(__file__).parents[2]
RUNS = 8


def start(study: Study, out: Path, directory: Path) -> subprocess.Popen[str]:
    """Start ``residua run`` in a process group of its own."""
    file = directory / "slow.toml"
    fixed = "\n".join(f"{name} = {value!r}" for name, value in study.parameters.items())
    file.write_text(
        f'name = "{study.name}"\nscene = "fake"\n[parameters]\n{fixed}\n'
        f"[sweep]\nfriction = {study.sweep['friction']}\n"
    )
    command = ["-m", "tests.residua.command", "run", str(file), "--out", str(out), "--workers", "2"]
    return subprocess.Popen(
        [sys.executable, *command],
        cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip


@pytest.fixture
def slow(tmp_path: Path) -> tuple[Study, Store, Path]:
    marks = tmp_path / "marks"
    marks.mkdir()
    sweep = {"friction": [i / 20 for i in range(RUNS)]}
    return fake_study("slow", sweep, mark=str(marks), seconds=0.5), Store(tmp_path / "out"), marks


def finished(store: Store) -> list[Path]:
    return list((store.directory / "runs").glob("*.nc"))


def test_a_killed_parent_leaves_only_whole_runs_and_its_workers_die(
    slow: tuple[Study, Store, Path], tmp_path: Path
) -> None:
    study, store, marks = slow
    with start(study, store.directory, tmp_path) as parent:
        wait_until(lambda: len(finished(store)) >= 2)
        family = psutil.Process(parent.pid).children(recursive=True)
        parent.send_signal(signal.SIGKILL)
        parent.wait()
    _, alive = psutil.wait_procs(family, timeout=60)
    assert alive == []
    done = finished(store)
    assert 2 <= len(done) < RUNS
    for path in done:
        with open_netcdf(path) as run:
            assert run.attrs["id"] == path.stem
            assert run["residual_stress"].load().notnull().any()
    assert not store.dataset_path(study.id).exists()
    begun_before = len(list(marks.iterdir()))

    outcome = run_study(study, store, workers=0)

    assert outcome.counts == {"ok": RUNS}
    assert len(outcome.computed) == RUNS - len(done)
    assert len(list(marks.iterdir())) - begun_before == RUNS - len(done)
    assert list(store.directory.rglob("*.part")) == []
    assert store.catalogue.runs()[1] == RUNS


def test_an_interrupt_while_workers_start_ends_the_command_without_a_traceback(
    slow: tuple[Study, Store, Path], tmp_path: Path
) -> None:
    """Ctrl-C in a terminal reaches every process of the group, the newest too."""
    study, store, _ = slow
    with start(study, store.directory, tmp_path) as parent:
        known: set[int] = set()
        while parent.poll() is None and not store.directory.joinpath("runs").exists():
            time.sleep(0.01)
        while parent.poll() is None and len(known) < 3:  # two workers, and Python's tracker
            family = {child.pid for child in psutil.Process(parent.pid).children(recursive=True)}
            if family - known:
                known |= family
                for each in family:
                    with suppress(ProcessLookupError):  # it has ended meanwhile
                        os.kill(each, signal.SIGINT)
        parent.send_signal(signal.SIGINT)
        printed, told = parent.communicate(timeout=60)
    assert parent.returncode == 130, told
    assert "Traceback" not in told + printed
    assert "stopping; finished runs are kept" in told


def test_a_killed_worker_costs_only_the_path_it_was_on(
    slow: tuple[Study, Store, Path],
) -> None:
    study, store, marks = slow
    killed: list[int] = []

    def kill_one_worker(event: object) -> None:
        if not killed and len(finished(store)) >= 2:
            killed.append(max(int(mark.name.split("-")[-1]) for mark in marks.iterdir()))
            os.kill(killed[0], signal.SIGKILL)

    outcome = run_study(study, store, workers=2, on_event=kill_one_worker)
    assert killed
    assert outcome.counts == {"ok": RUNS}
    assert RUNS <= len(list(marks.iterdir())) <= RUNS + 1


def test_a_frozen_worker_costs_only_the_path_it_was_on(
    slow: tuple[Study, Store, Path],
) -> None:
    study, store, marks = slow
    frictions = {path.id: path.parameters.friction for path in study.paths()}
    frozen: list[int] = []

    def freeze_one_worker(event: StudyEvent) -> None:
        amid = event.kind == "path" and 0.0 < event.fraction < 0.5
        if amid and not frozen and len(finished(store)) >= 2:
            (mark,) = marks.glob(f"{frictions[event.path]}-*")
            frozen.append(int(mark.name.split("-")[-1]))
            os.kill(frozen[0], signal.SIGSTOP)

    outcome = run_study(
        study, store, workers=2, limits=Limits(stall_seconds=6.0), on_event=freeze_one_worker
    )
    assert outcome.counts == {"ok": RUNS - 1, "error": 1}
    ((_, _, message),) = outcome.failed
    assert message.startswith("the loading path made no progress for 6 s (limit stall_seconds)")
    assert len(list(marks.iterdir())) == RUNS
    assert not psutil.pid_exists(frozen[0])


def test_ctrl_c_stops_cleanly(slow: tuple[Study, Store, Path], tmp_path: Path) -> None:
    study, store, _ = slow
    with start(study, store.directory, tmp_path) as parent:
        wait_until(lambda: len(finished(store)) >= 2)
        os.killpg(parent.pid, signal.SIGINT)  # a terminal sends it to the workers as well
        output, errors = parent.communicate(timeout=60)
    assert parent.returncode == 130
    assert "missing" in output
    assert "Traceback" not in output + errors
    assert {path.stem for path in finished(store)} == {
        row["id"] for row in store.catalogue.runs(status="ok")[0]
    }
    assert list(store.directory.rglob("*.part")) == []
