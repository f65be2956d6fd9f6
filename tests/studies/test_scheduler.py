"""A study carried out by a scheduler and workers that others have started."""

from __future__ import annotations

import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from studies import GridLost, Store, StudyEvent, run_study
from tests.studies.conftest import fake_study

ROOT = Path(__file__).parents[2]


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """Start a scheduler and one worker with dask's own commands."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    scheduler = ["scheduler", "--host", address, "--no-dashboard", "--dashboard-address", ":0"]
    worker = ["worker", address, "--nthreads", "1", "--local-directory", str(tmp_path)]
    with ExitStack() as started:
        processes = []
        for arguments in (scheduler, [*worker, "--no-dashboard", "--death-timeout", "30"]):
            command = [sys.executable, "-m", "dask", *arguments]
            process = started.enter_context(
                subprocess.Popen(
                    command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
                )
            )
            started.callback(process.kill)
            processes.append(process)
        yield address, processes[0]


def test_a_running_scheduler_computes_the_study(
    cluster: tuple[str, subprocess.Popen[bytes]], store: Store
) -> None:
    address, _ = cluster
    events: list[StudyEvent] = []
    deadline = time.monotonic() + 20
    while True:
        try:
            outcome = run_study(fake_study(), store, scheduler=address, on_event=events.append)
            break
        except GridLost:
            assert time.monotonic() < deadline
    assert outcome.counts == {"ok": 4}
    assert len([event for event in events if event.kind == "run"]) == 4


def test_a_lost_scheduler_is_told_apart_from_failed_runs(
    cluster: tuple[str, subprocess.Popen[bytes]], store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("studies.execution.cluster._CONNECT", 3.0)
    address, scheduler = cluster
    study = fake_study(sweep={"friction": [0.0, 0.1, 0.2]}, seconds=1.0)

    def kill_scheduler(event: StudyEvent) -> None:
        if event.kind == "run":
            scheduler.kill()

    time.sleep(2.0)  # the scheduler is listening
    with pytest.raises(GridLost):
        run_study(study, store, scheduler=address, on_event=kill_scheduler)
    assert {row["status"] for row in store.catalogue.runs()[0]} == {"ok"}
    outcome = run_study(study, store, workers=1)
    assert outcome.counts == {"ok": 3}
    assert len(outcome.computed) < 3


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nowhere", "odd://127.0.0.1:1"])
def test_no_scheduler_at_the_address_is_one_clear_error_and_leaves_nothing(
    store: Store, monkeypatch: pytest.MonkeyPatch, address: str
) -> None:
    monkeypatch.setattr("studies.execution.cluster._CONNECT", 1.0)
    with pytest.raises(GridLost, match=f"no scheduler answers at {address}: "):
        run_study(fake_study(), store, scheduler=address)
    assert not store.directory.exists()
