"""Takes studies from the queue, one after the other, and has each computed by a child process."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import sys
from asyncio.subprocess import Process
from collections.abc import AsyncIterator, Mapping
from dataclasses import dataclass, field, replace

from service.jobs import Job, Jobs, State
from service.settings import Settings

log = logging.getLogger(__name__)

LONGEST_LINE = 1_000_000
"""Bytes of one event a child may send."""


@dataclass(slots=True)
class Attempt:
    """What one start of a study brought.

    Attributes
    ----------
    progress : percentage of the study that is done
    begun : whether the first event came: something was computed
    runs : number of runs that got an outcome
    counts : runs by status when the study ended; None when it did not
    reason : why it did not end
    patient : whether waiting helps: no scheduler answers, another process uses the directory
    hopeless : whether every further start would end in the same way
    """

    progress: float
    begun: bool = False
    runs: int = 0
    counts: dict[str, int] | None = None
    reason: str = "its process ended without a result or an error message; see the service's log"
    patient: bool = False
    hopeless: bool = False


@dataclass(slots=True)
class Runner:
    """The one consumer of the queue.

    Attributes
    ----------
    settings, jobs : how to compute, and what
    lock : descriptor of the directory's lock, handed on to the children
    """

    settings: Settings
    jobs: Jobs
    lock: int
    _stopping: asyncio.Event = field(default_factory=asyncio.Event)
    _task: asyncio.Task[None] | None = None

    @property
    def alive(self) -> bool:
        """Whether studies are being taken from the queue."""
        return self._task is not None and not self._task.done() and not self._stopping.is_set()

    @contextlib.asynccontextmanager
    async def working(self) -> AsyncIterator[None]:
        """Work while the context is open; at its end a running study stops, to resume later."""
        self._task = asyncio.create_task(self._work())
        try:
            yield
        finally:
            self._stopping.set()
            await self._task

    async def _work(self) -> None:
        while not self._stopping.is_set():
            try:
                job = await asyncio.to_thread(self.jobs.take)
                if job is None:
                    await self._pause(self.settings.poll_seconds)
                else:
                    await self._compute(job)
            except Exception:
                log.exception("the queue could not be read or written; trying again")
                await self._pause(10 * self.settings.poll_seconds)

    async def _compute(self, job: Job) -> None:
        """Start a study until it ends; give up after too many starts in a row without a new run."""
        barren, progress = 0, job.progress
        while True:
            attempt = await self._attempt(job, progress)
            if await self._unwanted(job):
                return
            if attempt.counts is not None:
                await asyncio.to_thread(self.jobs.finish, job.id, *verdict(attempt.counts))
                return
            progress = attempt.progress
            job = replace(job, again=job.again and not attempt.begun)
            barren = 0 if attempt.runs or attempt.patient else barren + 1
            message = f"the study stopped: {attempt.reason}"
            log.error("%s: %s", job.id, message)
            if attempt.hopeless or barren == self.settings.attempts:
                await asyncio.to_thread(self.jobs.finish, job.id, State.FAILED, message)
                return
            await asyncio.to_thread(self.jobs.note, job.id, progress, message)
            await self._pause(self.settings.poll_seconds * (10 if attempt.patient else 2**barren))

    async def _attempt(self, job: Job, progress: float) -> Attempt:
        """Start one child and follow its events; stop it when study or service shall stop."""
        attempt, again = Attempt(progress), job.again
        child = await self._start(job)
        events = asyncio.create_task(follow(child, attempt))
        try:
            while not events.done() and not await self._unwanted(job):
                await asyncio.wait({events}, timeout=self.settings.poll_seconds)
                if again and attempt.begun:
                    again = False
                    await asyncio.to_thread(self.jobs.begun, job.id)
                if attempt.progress != progress:
                    progress = attempt.progress
                    await asyncio.to_thread(self.jobs.note, job.id, progress)
        finally:
            await self._end(child)
            await asyncio.wait({events})
        if error := events.exception():
            log.error("%s: its process sent what cannot be read", job.id, exc_info=error)
            return Attempt(
                attempt.progress,
                begun=attempt.begun,
                reason=f"its process sent what cannot be read: {type(error).__name__}: {error}",
            )
        return attempt

    async def _start(self, job: Job) -> Process:
        child = await asyncio.create_subprocess_exec(
            sys.executable,
            "-m",
            "service.child",
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            limit=LONGEST_LINE,
            pass_fds=(self.lock,),
            start_new_session=True,  # an interrupt from a terminal is the service's to handle
        )
        order = {
            "id": job.id,
            "study": job.study,
            "data": str(self.settings.data.resolve()),
            "workers": self.settings.workers,
            "scheduler": self.settings.scheduler,
            "again": job.again,
            "grace": self.settings.grace_seconds,
        }
        assert child.stdin is not None
        child.stdin.write(json.dumps(order).encode() + b"\n")
        return child

    async def _end(self, child: Process) -> None:
        """Ask the child to stop by closing its input, and kill it when it does not."""
        assert child.stdin is not None
        child.stdin.close()
        try:
            async with asyncio.timeout(self.settings.grace_seconds):
                await child.wait()
        except TimeoutError:
            child.kill()
            await child.wait()

    async def _unwanted(self, job: Job) -> bool:
        if self._stopping.is_set():
            return True
        return (await asyncio.to_thread(self.jobs.get, job.id)).state is not State.RUNNING

    async def _pause(self, seconds: float) -> None:
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                await self._stopping.wait()


async def follow(child: Process, attempt: Attempt) -> None:
    """Write the events of a child into ``attempt`` until its output ends."""
    assert child.stdout is not None
    async for line in child.stdout:
        message = json.loads(line)
        content = message["content"]
        match message["kind"]:
            case "event":
                attempt.begun = True
                attempt.progress = 100 * content["progress"]
                attempt.runs += content["kind"] == "run"
            case "outcome":
                attempt.counts = content
            case "refused" | "wait" | "error" as kind:
                attempt.reason = content["reason"]
                attempt.hopeless = kind == "refused"
                attempt.patient = kind == "wait"


def verdict(counts: Mapping[str, int]) -> tuple[State, str]:
    """Return the final state of a study whose runs ended as counted, and the reason."""
    others = {status: count for status, count in counts.items() if count and status != "ok"}
    if not others:
        return State.SUCCESSFUL, ""
    listed = ", ".join(f"{count} {status}" for status, count in others.items())
    return State.FAILED, f"{sum(others.values())} of {sum(counts.values())} runs: {listed}"
