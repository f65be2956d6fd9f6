"""The consumer of the queue, with children that do as they are told."""

from __future__ import annotations

import asyncio
import json
import sqlite3
from asyncio.subprocess import PIPE, Process
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import psutil
import pytest

from service import processes
from service.job import Job, StudyState
from service.jobs import Jobs
from service.pool import Pool
from service.processes import Starter
from service.runner import SILENT, Runner
from service.settings import Settings

RUN = {"kind": "event", "content": {"kind": "run", "progress": 0.5, "stage": "", "run": "b"}}
AWAY = {"kind": "wait", "content": {"reason": "the store is busy"}}


def outcome(counts: dict[str, int], stage: str = "", asked: tuple[str, ...] = ()) -> dict[str, Any]:
    """Return the last message of a child."""
    return {"kind": "outcome", "content": {"counts": counts, "stage": stage, "asked": asked}}


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
    pool = Pool.of(settings, lock=0)
    runner = Scripted(settings, jobs, pool, Starter("none", 0), lambda _: None, script=list(script))

    async def work() -> None:
        async with asyncio.timeout(30.0), runner.working():
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
    runner = Frozen(settings, jobs, Pool.of(settings, lock=0), Starter("none", 0), lambda _: None)

    async def work() -> None:
        async with asyncio.timeout(30.0), runner.working():
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


def test_a_study_that_is_no_json_fails_and_holds_nobody_back(tmp_path: Path) -> None:
    jobs = Jobs(tmp_path / "jobs.sqlite")
    for name in ("bad", "good"):
        jobs.accept(name, {"name": name, "scene": "fake"}, [name])
    with closing(sqlite3.connect(jobs.path)) as connection, connection:
        connection.execute("UPDATE job SET study = '{' WHERE id = 'bad'")
    settings = Settings(data=tmp_path, poll_seconds=0.01, scheduler="tcp://127.0.0.1:1")
    runner = Runner(settings, jobs, Pool.of(settings, lock=0), Starter("none", 0), lambda _: None)

    async def work() -> None:
        async with asyncio.timeout(30.0), runner.working():
            while not jobs.get("bad").state.final:
                await asyncio.sleep(0.01)

    asyncio.run(work())
    assert jobs.get("bad").state is StudyState.FAILED
    assert "cannot be read" in jobs.get("bad").message
    assert jobs.get("good").state is StudyState.RUNNING


def test_the_processes_of_the_next_study_load_while_there_is_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("service.runner.READY_SECONDS", 0.1)
    jobs = Jobs(tmp_path / "jobs.sqlite")
    settings = Settings(data=tmp_path, poll_seconds=0.02)
    starters = Starter("this", 0), Starter("this", 0)
    pool = Pool(settings, starters[0])
    runner = Runner(settings, jobs, pool, starters[1], lambda _: jobs)

    async def work() -> list[Process]:
        async with asyncio.timeout(30.0), runner.working():
            while not all(each._ready for each in starters):
                await asyncio.sleep(0.02)
            ready = [each._ready for each in starters if each._ready]
            await asyncio.sleep(0.2)
            assert [each._ready for each in starters] == ready, "one of each is enough"
        return ready

    ready = asyncio.run(work())
    assert len(ready) == 2
    assert all(process.returncode is not None for process in ready)


def test_a_process_is_ready_before_it_is_needed() -> None:
    async def work() -> None:
        starter = Starter("this", 0)
        before = len(psutil.Process().children())
        await asyncio.gather(*(starter.prepare() for _ in range(3)))
        ready = starter._ready
        assert ready is not None
        assert len(psutil.Process().children()) == before + 1, "one is enough"
        given = await starter.give({"id": "a"})
        assert given is ready and starter._ready is None
        await processes.end(given, 1.0)
        await starter.prepare()
        dead = starter._ready
        assert dead is not None
        dead.kill()
        await dead.wait()
        given = await starter.give({"id": "b"})
        assert given.pid != dead.pid, "one that has died is of no use"
        await processes.end(given, 1.0)
        await starter.prepare()
        waiting = starter._ready
        await starter.close()
        assert waiting is not None and waiting.returncode is not None

    asyncio.run(work())


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
