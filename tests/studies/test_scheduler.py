"""A study carried out by a scheduler and workers that others have started."""

from __future__ import annotations

import json
import re
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import dask
import pytest
from distributed import Security

from residua.cli import main
from studies import (
    Access,
    GridLost,
    Limits,
    Store,
    Study,
    StudyError,
    StudyEvent,
    StudyOutcome,
    run_study,
)
from studies.execution.workers import connect, own_workers
from tests.studies.conftest import fake_study

ANSWERS = "distributed.comm.timeouts.connect"
"""Dask's setting: within which time a scheduler must answer."""

pytestmark = pytest.mark.processes

ROOT = Path(__file__).parents[2]


Process = subprocess.Popen[bytes]

BLIND = """
import os
from studies.execution.task import Proof
Proof._seen = lambda self: os.path.exists({!r})
"""
"""Makes a worker see no directory before a file exists."""


@dataclass
class Stage:
    """Processes started with dask's own commands."""

    home: Path
    address: str
    started: ExitStack
    tls: list[str] = field(default_factory=list)

    def scheduler(self) -> Process:
        return self._dask(
            "scheduler", "--host", self.address, "--no-dashboard", "--dashboard-address", ":0"
        )

    def worker(self, *options: str) -> Process:
        return self._dask(
            "worker", self.address, "--nthreads", "1", "--local-directory", str(self.home),
            "--no-dashboard", "--death-timeout", "30", *options,
        )  # fmt: skip

    def ready(self) -> None:
        """Wait until a worker is connected."""
        deadline = time.monotonic() + 60
        while True:
            try:
                with connect(Access(self.address)) as client:
                    return client.wait_for_workers(1, timeout=60)
            except GridLost:
                assert time.monotonic() < deadline

    def _dask(self, *arguments: str) -> Process:
        process = self.started.enter_context(
            subprocess.Popen(
                [sys.executable, "-m", "dask", *arguments, *self.tls],
                cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            )
        )  # fmt: skip
        self.started.callback(process.kill)
        return process


def free_port() -> int:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


@pytest.fixture
def stage(tmp_path: Path) -> Iterator[Stage]:
    with ExitStack() as started:
        yield Stage(tmp_path, f"tcp://127.0.0.1:{free_port()}", started)


def answered(study: Study, store: Store, scheduler: Access | str, **options: Any) -> StudyOutcome:
    """Compute a study as soon as the scheduler answers."""
    deadline = time.monotonic() + 30
    while True:
        try:
            return run_study(study, store, scheduler=scheduler, **options)
        except GridLost as error:
            if "no scheduler answers" not in str(error) or time.monotonic() > deadline:
                raise


def test_a_goal_is_searched_by_workers_that_find_the_scheduler_by_a_file(tmp_path: Path) -> None:
    file, store = tmp_path / "scheduler.json", Store(tmp_path / "out")
    goal = {"of": "peak_contact_pressure", "at": 120.0, "between": [0.1, 4.0], "within": 0.1}
    study = Study.from_dict({"name": "goal", "scene": "fake", "goal": goal})
    with own_workers(1) as access:
        file.write_text(json.dumps({"type": "Scheduler", "address": access.address}))
        found = Access.of_file(file, access.ca, access.cert, access.key)
        assert found == access
        outcome = run_study(study, store, scheduler=found)
    assert outcome.counts == {"ok": 1}
    assert {*outcome.computed} == {*outcome.asked}


def test_a_file_without_a_scheduler_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("studies.execution.access._APPEARS", 0.1)
    with pytest.raises(GridLost, match="no scheduler has written the file"):
        Access.of_file(tmp_path / "none.json", None, None, None)
    (tmp_path / "begun.json").touch()
    with pytest.raises(GridLost):
        Access.of_file(tmp_path / "begun.json", None, None, None)  # it is not written yet
    (tmp_path / "odd.json").write_text("[]")
    with pytest.raises(StudyError, match=r"scheduler-file = .*must be a file that `dask"):
        Access.of_file(tmp_path / "odd.json", None, None, None)


def test_a_lost_scheduler_is_told_apart_from_failed_runs(stage: Stage, store: Store) -> None:
    scheduler = stage.scheduler()
    stage.worker()
    study = fake_study(sweep={"friction": [0.0, 0.1, 0.2]}, seconds=0.5)

    def kill_scheduler(event: StudyEvent) -> None:
        if event.kind == "run":
            scheduler.kill()

    with pytest.raises(GridLost), dask.config.set({ANSWERS: "3s"}):
        answered(study, store, stage.address, on_event=kill_scheduler)
    assert {row["status"] for row in store.catalogue.runs()[0]} == {"ok"}
    outcome = run_study(study, store, workers=0)
    assert outcome.counts == {"ok": 3}
    assert len(outcome.computed) < 3


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nowhere", "odd://127.0.0.1:1"])
def test_no_scheduler_at_the_address_is_one_clear_error_and_leaves_nothing(
    store: Store, address: str
) -> None:
    no_scheduler = pytest.raises(GridLost, match=f"no scheduler answers at {address}: ")
    began = time.monotonic()
    with no_scheduler:
        run_study(fake_study(), store, scheduler=address, limits=Limits(patience=1.0))
    assert time.monotonic() - began < 20.0, "not the 30 s that Dask waits"
    assert not store.directory.exists()


def test_that_a_scheduler_is_waited_for_is_reported_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    for name, seconds in (("_LATE", 0.1), ("_APPEARS", 0.6)):
        monkeypatch.setattr(f"studies.execution.access.{name}", seconds)
    address, file = "tcp://127.0.0.1:1", tmp_path / "none.json"
    with pytest.raises(GridLost), dask.config.set({ANSWERS: "2s"}):
        connect(Access(address))
    with pytest.raises(GridLost):
        Access.of_file(file, None, None, None)
    assert [each for each in caplog.messages if each.endswith("yet: waiting")] == [
        f"no scheduler answers at {address} yet: waiting",
        f"no scheduler has written the file {file} yet: waiting",
    ]


@pytest.mark.long
def test_a_worker_that_does_not_see_the_directory_computes_nothing(
    stage: Stage, store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(stage.home)
    store = Store("out")  # the user is told of the directory by this name
    seen = stage.home / "mounted"
    blind = stage.home / "blind.py"
    blind.write_text(BLIND.format(str(seen)))
    stage.scheduler()
    stage.worker("--preload", str(blind))
    events: list[StudyEvent] = []

    def hear(event: StudyEvent) -> None:
        events.append(event)
        if event.kind == "waiting" and event.message:
            assert not list(Path("out").rglob("*.nc"))
            seen.touch()

    stage.ready()
    for patience in (4.0, 16.0, 64.0):  # the worker may still load
        with pytest.raises(GridLost) as lost:
            run_study(
                fake_study(), store, scheduler=stage.address, limits=Limits(patience=patience)
            )
        if "none takes the work" not in str(lost.value):  # else it still loads
            break
    assert "does not see the directory out" in str(lost.value)
    assert store.catalogue.runs()[1] == 0
    assert not list(Path("out").rglob("*.nc"))
    outcome = run_study(fake_study(), store, scheduler=stage.address, on_event=hear)
    assert outcome.counts == {"ok": 4}
    waits = [event.message for event in events if event.kind == "waiting"]
    assert len(waits) == 2
    assert re.fullmatch(
        r"the worker tcp://127\.0\.0\.1:\d+ does not see the directory out; "
        "mount it there under the same path",
        waits[0],
    )
    assert waits[1] == ""
    assert not list(Path("out").rglob("token*"))


def test_a_scheduler_computes_the_study_and_without_workers_is_waited_for_aloud(
    stage: Stage, store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("studies.execution.watch._QUIET", 2.0)
    stage.scheduler()
    events: list[StudyEvent] = []

    def hear(event: StudyEvent) -> None:
        if event.kind == "waiting" and not events:
            stage.worker()
        events.append(event)

    assert answered(fake_study(), store, stage.address, on_event=hear).counts == {"ok": 4}
    told = [event.message for event in events if event.kind == "waiting"]
    assert told[0].startswith("no worker is connected to the scheduler")
    assert told[-1] == ""
    assert len([event for event in events if event.kind == "run"]) == 4


def test_certificates_in_files_open_a_scheduler_that_asks_for_them(
    stage: Stage, store: Store
) -> None:
    made = Security.temporary()
    files = {"ca": made.tls_ca_file, "cert": made.tls_client_cert, "key": made.tls_client_key}
    names = {name: str(stage.home / f"{name}.pem") for name in files}
    for name, text in files.items():
        Path(names[name]).write_text(text)
    stage.address = stage.address.replace("tcp:", "tls:")
    stage.tls = [
        "--tls-ca-file", names["ca"], "--tls-cert", names["cert"], "--tls-key", names["key"],
    ]  # fmt: skip
    stage.scheduler()
    stage.worker()
    access = Access(stage.address, **names)
    assert answered(fake_study(), store, access).counts == {"ok": 4}


def test_a_scheduler_that_needs_certificates_is_refused_before_anything_is_written(
    study_file: Callable[..., Path], store: Store, capsys: pytest.CaptureFixture[str]
) -> None:
    address = "tls://127.0.0.1:1"
    with pytest.raises(StudyError, match="needs certificates"):
        run_study(fake_study(), store, scheduler=address)
    run = ["run", str(study_file()), "--out", str(store.directory)]
    assert main([*run, "--scheduler", address]) == 2
    assert "--tls-ca" in capsys.readouterr().err
    assert main([*run, "--scheduler", address, "--tls-ca", "no.pem", "--tls-cert", "no.pem"]) == 2
    assert "certificates = 'no.pem, no.pem': cannot be used" in capsys.readouterr().err
    assert main([*run, "--memory", "much"]) == 2
    assert "memory = 'much': must be a size" in capsys.readouterr().err
    assert main([*run, "--memory", "10MB", "--workers", "1"]) == 2
    assert "memory = '10MB': must be at least 240MB" in capsys.readouterr().err
    assert main([*run, "--workers", "0", "--scheduler", "tcp://127.0.0.1:1"]) == 2
    assert "--workers = 0: must be left out with a scheduler" in capsys.readouterr().err
    assert main([*run, "--stall-seconds", "0"]) == 2
    assert "stall_seconds = 0.0: must be greater than 0" in capsys.readouterr().err
    assert not store.directory.exists()
