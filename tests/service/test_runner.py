"""The consumer of the queue, with children that do as they are told."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import subprocess
import sys
from asyncio.subprocess import PIPE, Process
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from service.job import Job, StudyState
from service.jobs import Jobs
from service.pool import Pool
from service.processes import LOADED, Starter
from service.runner import SILENT, Runner
from service.settings import Settings
from studies.execution.forks import NEEDED, Forks
from tests.architecture.sources import ROOT
from tests.service.servers import PATIENCE

RUN = {"kind": "event", "content": {"kind": "run", "progress": 0.5, "stage": "", "run": "b"}}
AWAY = {"kind": "wait", "content": {"reason": "the store is busy"}}


def outcome(counts: dict[str, int], stage: str = "", asked: tuple[str, ...] = ()) -> dict[str, Any]:
    """Return the last message of a child."""
    return {
        "kind": "outcome",
        "content": {"counts": counts, "stage": stage, "asked": asked, "counted": "runs"},
    }


ALL_FAILED = outcome({"error": 2})
GIBBERISH = "gibberish"
ENDLESS = "x" * 1_100_000


@dataclass
class Scripted(Runner):
    """Starts children that say what the script has for them; the last part holds for the rest."""

    script: list[list[Any]] = field(default_factory=list)
    orders: list[int] = field(default_factory=list)

    async def _start(self, job: Job) -> Process:
        said = self.script[min(len(self.orders), len(self.script) - 1)]
        self.orders.append(job.since)
        lines = [line if isinstance(line, str) else json.dumps(line) for line in said]
        path = self.settings.data / "said"
        path.write_text("".join(f"{line}\n" for line in lines))
        return await asyncio.create_subprocess_exec(
            "cat", str(path), stdin=PIPE, stdout=PIPE, limit=1_000_000
        )


def carried_out(
    data: Path, *script: list[Any], again: bool = False, **limits: Any
) -> tuple[Job, list[int]]:
    """Return what became of a study, and from when on outcomes counted for each child."""
    jobs = Jobs(data / "jobs.sqlite")
    jobs.accept("a", {"name": "a", "scene": "fake"}, ["b", "c"])
    if again:
        jobs.dismiss("a")
        jobs.retry("a")
    settings = Settings(**{"data": data, "attempts": 2, "poll_seconds": 0.01, **limits})
    pool = Pool(settings, Starter(0))
    runner = Scripted(settings, jobs, pool, Starter(0), lambda _: None, script=list(script))

    async def work() -> None:
        async with asyncio.timeout(PATIENCE), runner.working():
            while not jobs.get("a").state.final:
                await asyncio.sleep(0.01)

    asyncio.run(work())
    return jobs.get("a"), runner.orders


def test_every_child_of_a_retry_knows_when_it_was_asked_for(tmp_path: Path) -> None:
    job, orders = carried_out(tmp_path, [AWAY], [RUN], [RUN], [ALL_FAILED], again=True)
    assert job.since > 0 and orders == [job.since] * 4
    assert job.state is StudyState.FAILED


def test_a_study_that_brings_nothing_new_is_given_up(tmp_path: Path) -> None:
    job, orders = carried_out(tmp_path, [RUN], [], again=True)
    assert len(orders) == 3
    assert job.state is StudyState.FAILED and "without a result or an error message" in job.message


@pytest.mark.parametrize("line", [GIBBERISH, ENDLESS], ids=["gibberish", "endless"])
def test_a_child_that_cannot_be_understood_brought_nothing(tmp_path: Path, line: str) -> None:
    job, orders = carried_out(tmp_path, [RUN, line])
    assert len(orders) == 2
    assert job.state is StudyState.FAILED and "sent an unreadable message" in job.message


def test_time_of_work_is_no_time_of_waiting(tmp_path: Path) -> None:
    """The first child computes for longer than the service is patient."""
    script = [[RUN] * 3, [RUN], [AWAY], [outcome({"ok": 2})]]
    job, orders = carried_out(tmp_path, *script, patience_seconds=1.0, poll_seconds=0.05)
    assert len(orders) == 4 and job.state is StudyState.SUCCESSFUL


def test_a_frozen_process_is_told_of_and_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("service.runner.SILENCE_SECONDS", 0.1)
    told: list[dict[str, str]] = []

    @dataclass
    class Frozen(Scripted):
        async def _start(self, job: Job) -> Process:
            self.orders.append(0)
            return await asyncio.create_subprocess_exec("sleep", "60", stdin=PIPE, stdout=PIPE)

    jobs = Jobs(tmp_path / "jobs.sqlite")
    jobs.accept("a", {"name": "a", "scene": "fake"}, ["b"])
    settings = Settings(
        data=tmp_path, attempts=2, poll_seconds=0.02, stall_seconds=0.5, grace_seconds=0.1
    )
    runner = Frozen(settings, jobs, Pool(settings, Starter(0)), Starter(0), lambda _: None)

    async def work() -> None:
        async with asyncio.timeout(PATIENCE), runner.working():
            while not jobs.get("a").state.final:
                told.append(jobs.waiting())
                await asyncio.sleep(0.02)

    asyncio.run(work())
    assert {"a": SILENT} in told
    assert len(runner.orders) == 2
    assert SILENT in jobs.get("a").message


def test_a_study_that_waits_too_long_for_workers_is_given_up(tmp_path: Path) -> None:
    job, orders = carried_out(tmp_path, [AWAY], patience_seconds=0.2)
    assert len(orders) >= 2
    assert job.state is StudyState.FAILED and "the store is busy" in job.message


def test_what_the_next_study_needs_is_loaded_while_there_is_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("service.runner.READY_SECONDS", 0.1)
    asked: list[Sequence[str]] = []
    monkeypatch.setattr(Forks, "prepare", lambda forks: asked.append(forks.modules))
    jobs = Jobs(tmp_path / "jobs.sqlite")
    settings = Settings(data=tmp_path, poll_seconds=0.02)
    starter = Starter(0)
    runner = Runner(settings, jobs, Pool(settings, starter), starter, lambda _: jobs)

    async def work() -> None:
        async with asyncio.timeout(PATIENCE), runner.working():
            while not asked:
                await asyncio.sleep(0.02)

    asyncio.run(work())
    assert set(asked) == {(*LOADED, *NEEDED)}


def test_a_process_that_cannot_be_forked_is_an_error_of_the_system(tmp_path: Path) -> None:
    """What cannot be loaded ends the process that is to be forked; the next call starts another."""
    forks = Forks(("no_such_module",))
    with (tmp_path / "lock").open("w") as lock:
        for _ in range(2):
            with pytest.raises(OSError, match="unavailable"):
                asyncio.run(Starter(lock.fileno(), forks).start("service.child", {}))
    forks.close()


ECHO = """
import json, os, sys
def main(order):
    told = os.getpgid(0), os.getcwd(), os.environ["FOR_IT"]
    os.write(1, " ".join(map(str, told)).encode() + b"\\n")
    os.write(1, json.dumps(order).encode() + b"\\n")
    while os.read(0, 1):
        pass
    sys.exit(3)
"""


PROGRAM = """
import asyncio, json, os
from service import processes
from studies.execution.forks import NEEDED, Forks
from studies.execution.forks import Forks
async def work():
    starter = processes.Starter(os.open(os.devnull, os.O_RDONLY), Forks(()))
    await starter.prepare()
    os.environ["FOR_IT"] = "told"
    process = await starter.start("echo_order", {"id": "a"})
    told = (await process.stdout.readline()).decode().split()
    order = json.loads(await process.stdout.readline())
    running = process.returncode
    await processes.end(process, 10.0)
    pid, code = process.fork.pid, process.returncode
    other = await starter.start("echo_order", {"id": "b"})
    other.kill()
    await other.wait()
    print(json.dumps([told, order, running, pid, code, other.returncode]))
if __name__ == "__main__":
    asyncio.run(work())
"""


def test_a_process_starts_with_its_order_and_tells_its_end(tmp_path: Path) -> None:
    (tmp_path / "echo_order.py").write_text(ECHO)
    (tmp_path / "program.py").write_text(PROGRAM)
    done = subprocess.run(
        [sys.executable, str(tmp_path / "program.py")],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )
    told, order, running, pid, code, killed = json.loads(done.stdout)
    assert told == [str(pid), "/", "told"], "a group of its own, and no folder of the service"
    assert order == {"id": "a"}
    assert (running, code, killed) == (None, 3, -signal.SIGKILL)


@pytest.mark.parametrize(
    ("reason", "plain"),
    [
        ("{} is not there; mount it", "the data directory is not there; mount it"),
        ("cannot read {}/runs/ab.nc", "cannot read ab.nc"),
        ("cannot read {}-old/ab.nc", "cannot read ab.nc"),
    ],
)
def test_a_message_of_a_study_shows_no_half_of_a_path(
    reason: str, plain: str, tmp_path: Path
) -> None:
    runner = Runner(Settings(data=tmp_path), *[None] * 4)  # type: ignore[arg-type]
    assert runner._plain(reason.format(tmp_path.resolve())) == plain
