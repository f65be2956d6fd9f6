"""Takes studies from the queue and computes each in a child process, several at once."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import math
import re
import sys
import time
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass, field
from typing import Any

from service import processes
from service.errors import NotFound, QueueLost
from service.job import Job, StudyState, verdict
from service.jobs import Jobs
from service.pool import Pool, PoolAway
from service.processes import Process, Starter
from service.settings import Settings
from studies.errors import CatalogueDamaged, StoreBusy, StoreFull, Unusable, without_folders

log = logging.getLogger(__name__)

SILENCE_SECONDS = 20.0
"""Time without a report after which a process is logged [s]."""

SMALL = 100
"""Largest number of runs of a study for which the last place is reserved."""

READY_SECONDS = 0.5
"""Time without a study after which what the next one needs is loaded [s]."""

SILENT = "its process says nothing: it is frozen, or the machine is overloaded"


@dataclass(slots=True)
class Attempt:
    """The result of one start of a study.

    Attributes
    ----------
    progress : completed percentage of the study
    heard : time of the last message of its process [s]
    waiting : reason for which the study waits; empty if it does not
    runs : number of runs that were finished
    asked, stage : of a study that chooses its runs, those that it has asked for, and how far it is
    counts, counted : number by status at the end of the study, and of what; None if it did not end
    reason : why it did not end
    patient : whether waiting helps: no scheduler answers, or another process uses the directory
    hopeless : whether every further start would fail in the same way
    """

    progress: float
    heard: float = field(default_factory=time.monotonic)
    waiting: str = ""
    runs: int = 0
    asked: set[str] = field(default_factory=set)
    stage: str = ""
    counts: dict[str, int] | None = None
    counted: str = "runs"
    reason: str = "its process ended without a result or an error message; see the service's log"
    patient: bool = False
    hopeless: bool = False


@dataclass(slots=True)
class Runner:
    """The only consumer of the queue.

    Attributes
    ----------
    settings, jobs : settings of the service, and its queue
    pool : the workers, and the lock of the store
    starter : starts the child processes
    mend : (ids of the studies being computed) -> makes again what is lost of queue and catalogue
    """

    settings: Settings
    jobs: Jobs
    pool: Pool
    starter: Starter
    mend: Callable[[list[str]], None]
    _stopping: asyncio.Event = field(default_factory=asyncio.Event)
    _task: asyncio.Task[None] | None = None
    _studies: dict[str, asyncio.Task[None]] = field(default_factory=dict)

    @property
    def alive(self) -> bool:
        """Whether the runner is working."""
        return self._task is not None and not self._task.done() and not self._stopping.is_set()

    def computes(self, job_id: str) -> bool:
        """Whether a process may still work on a study, even if the study was stopped."""
        return job_id in self._studies

    @contextlib.asynccontextmanager
    async def working(self) -> AsyncIterator[None]:
        """Work while the context is open; at its end running studies stop, to resume later."""
        self._task = asyncio.create_task(self._work())
        try:
            yield
        finally:
            self._stopping.set()
            await self._task

    async def _work(self) -> None:
        idle, trouble = 0.0, ""
        while not self._stopping.is_set():
            pause = self.settings.poll_seconds
            try:
                await asyncio.to_thread(self.mend, list(self._studies))
                if await self._next():
                    continue
                idle = 0.0 if self._studies else idle + pause
                if idle >= self.settings.idle_seconds:
                    await self.pool.close()
                if idle >= READY_SECONDS:
                    await self.starter.prepare()
                trouble = ""
            except (CatalogueDamaged, QueueLost, StoreBusy, StoreFull, Unusable, OSError) as error:
                if trouble != (trouble := str(error)):  # log it only once
                    log.error("no study can be begun: %s", trouble)
                pause *= 1 if isinstance(error, QueueLost) else 10
            except Exception:
                log.exception("no study can be begun; trying again")
                pause *= 10
            await self._pause(pause)
        await asyncio.gather(*self._studies.values(), return_exceptions=True)
        await self.pool.close()

    async def _next(self) -> bool:
        """Begin the next study; return whether there was one, and a free place for it.

        The last place is reserved for a small study. This costs no time, since all studies share
        the workers.
        """
        places = self.settings.studies_at_once
        free = places - len(self._studies)
        if free <= 0:
            return False
        largest = sys.maxsize if free > 1 or places == 1 else SMALL
        job = await asyncio.to_thread(self.jobs.take, list(self._studies), largest)
        if job is None:
            return False
        self._studies[job.id] = asyncio.create_task(self._carry_out(job))
        return True

    async def _carry_out(self, job: Job) -> None:
        """Compute a study; if its end cannot be written, it is tried again a little later."""
        try:
            await self._compute(job)
        except (QueueLost, StoreFull, OSError) as error:
            log.error("to be taken again: %s", error, extra={"study": job.id})
            await self._pause(10 * self.settings.poll_seconds)
        except Exception:
            log.exception("to be taken again", extra={"study": job.id})
            await self._pause(10 * self.settings.poll_seconds)
        finally:
            del self._studies[job.id]

    async def _compute(self, job: Job) -> None:
        """Start a study until it ends; give up after too many starts in a row without new runs."""
        barren, progress, patient_since = 0, job.progress, time.monotonic()
        if await self._unwanted(job):  # such as deleted, just before `computes` knew it
            return
        while True:
            attempt = await self._attempt(job, progress)
            if attempt.stage:
                await self._write(self.jobs.asked, job.id, attempt.asked, attempt.stage)
            if await self._unwanted(job):
                return
            if attempt.counts is not None:
                end = verdict(attempt.counts, attempt.counted)
                await asyncio.to_thread(self.jobs.finish, job.id, *end)
                return
            progress = attempt.progress
            barren = 0 if attempt.runs or attempt.patient else barren + 1
            message = f"the study stopped: {self._plain(attempt.reason)}"
            log.error(message, extra={"study": job.id})
            if attempt.runs or not attempt.patient:
                patient_since = time.monotonic()
            waited = time.monotonic() - patient_since
            impatient = waited >= (self.settings.patience_seconds or math.inf)
            if attempt.hopeless or impatient or barren == self.settings.attempts:
                await asyncio.to_thread(self.jobs.finish, job.id, StudyState.FAILED, message)
                return
            await self._write(self.jobs.note, job.id, progress, message)
            await self._pause(self.settings.poll_seconds * (10 if attempt.patient else 2**barren))

    async def _attempt(self, job: Job, progress: float) -> Attempt:
        """Start one child and follow its events; stop it if the study or the service stops."""
        try:
            child = await self._start(job)
        except PoolAway as error:
            return Attempt(progress, reason=str(error), patient=True)
        except OSError as error:
            return Attempt(progress, reason=f"its process cannot be started: {error.strerror}")
        attempt, reported, stage = Attempt(progress), (progress, ""), (0, "")
        events = asyncio.create_task(follow(child, attempt))
        try:
            while not events.done() and not await self._unwanted(job):
                await asyncio.wait({events}, timeout=self.settings.poll_seconds)
                silence = time.monotonic() - attempt.heard
                waiting = SILENT if silence > SILENCE_SECONDS else attempt.waiting
                if silence > max(self.settings.stall_seconds or math.inf, 2 * SILENCE_SECONDS):
                    attempt.reason = SILENT
                    break
                if stage != (stage := (len(attempt.asked), attempt.stage)):
                    await self._write(self.jobs.asked, job.id, set(attempt.asked), attempt.stage)
                now = attempt.progress, self._plain(waiting)
                if reported != now and await self._write(self.jobs.note, job.id, *now):
                    reported = now
        finally:
            await processes.end(child, self.settings.grace_seconds)
            await asyncio.wait({events})
        if unread := events.exception():
            about = {"study": job.id}
            log.error("its process sent an unreadable message", exc_info=unread, extra=about)
            return Attempt(
                attempt.progress,
                reason=f"its process sent an unreadable message: {type(unread).__name__}: {unread}",
            )
        return attempt

    async def _start(self, job: Job) -> Process:
        study = await asyncio.to_thread(self.jobs.study, job.id)
        order = {
            "id": job.id,
            "study": study,
            "data": self.settings.data,
            "access": await self.pool.access(study),
            "limits": self.settings.limits,
            "priority": job.priority,
            "since": job.since,
            "grace": self.settings.grace_seconds,
        }
        return await self.starter.start("service.child", order)

    def _plain(self, text: str) -> str:
        """Return a message about a study without folders of this machine."""
        data = str(self.settings.data)
        inside = text.replace(f"{data}/", "/")
        return without_folders(
            re.sub(rf"{re.escape(data)}(?![\w.-])", "the data directory", inside)
        )

    async def _unwanted(self, job: Job) -> bool:
        if self._stopping.is_set():
            return True
        try:
            return (await asyncio.to_thread(self.jobs.get, job.id)).state is not StudyState.RUNNING
        except (QueueLost, StoreFull, OSError):  # the work continues, and is found again later
            return False
        except NotFound:
            return True

    async def _write(self, write: Callable[..., None], *what: Any) -> bool:
        """Write the state of a study; return whether that succeeded. The work continues anyway."""
        try:
            await asyncio.to_thread(write, *what)
        except (QueueLost, StoreFull, OSError) as error:
            log.error("%s", error)
            return False
        return True

    async def _pause(self, seconds: float) -> None:
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                await self._stopping.wait()


async def follow(child: Process, attempt: Attempt) -> None:
    """Write the events of a child into ``attempt`` until its output ends."""
    async for line in child.stdout:
        message = json.loads(line)
        attempt.heard = time.monotonic()
        content = message["content"]
        match message["kind"]:
            case "event" if content["kind"] == "waiting":
                attempt.waiting = content["message"]
            case "event":
                attempt.waiting = ""
                attempt.progress, attempt.stage = 100 * content["progress"], content["stage"]
                attempt.runs += content["kind"] == "run"
                if attempt.stage and content["run"]:
                    attempt.asked.add(content["run"])
            case "outcome":
                attempt.counts, attempt.counted = content["counts"], content["counted"]
                attempt.stage = content["stage"]
                attempt.asked.update(content["asked"])
            case "refused" | "wait" | "error" as kind:
                attempt.reason = content["reason"]
                attempt.hopeless = kind == "refused"
                attempt.patient = kind == "wait"
