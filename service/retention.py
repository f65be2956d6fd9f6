"""Deletion of runs and studies: on request, and of studies beyond the operator's age or size.

A check and the deletion are one transaction of the queue: no study that needs the files can be
accepted or begun in between. A study is ``dismissed`` before its first file is deleted, and its row
is deleted last. After a crash in between, its row therefore shows a study without a result.
Deleting it again, or a retry, completes the work.
"""

from __future__ import annotations

import asyncio
import logging
import shutil
import sqlite3
import threading
import time
from collections.abc import AsyncIterator, Callable, Collection, Iterator
from contextlib import asynccontextmanager, contextmanager, suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from typing import Any

from service.errors import Busy, Conflict, NoRoom, NotFound
from service.examined import Examined
from service.job import Job, StudyState
from service.jobs import Jobs, forget, put
from studies.errors import FileDamaged
from studies.numbers import size_text
from studies.storage.store import Store

log = logging.getLogger(__name__)

INTERVAL = 300.0
"""Seconds between two checks of age and size."""

FRESH = 24 * 3600 * 10**9
"""Time in which a scene that no study needs is not deleted for its size [ns]."""

DELETED = "deleted in part: delete it again to complete that, or retry it"
"""Message of a study that is being deleted; also correct after a crash."""


@dataclass(frozen=True, slots=True)
class Keeper:
    """Deletes runs and studies that are not needed.

    Attributes
    ----------
    jobs, store : the queue and the store
    computes : (study id) -> whether a process may still work on it
    days, size : age of studies [days], and size of runs, scenes and studies together [bytes],
        beyond which first scenes that no study needs, then studies that have ended are deleted, the
        oldest first; None for no limit
    scenes, own : largest size of all posted scenes, and of those of a key [bytes]; None for no
        limit
    """

    jobs: Jobs
    store: Store
    computes: Callable[[str], bool]
    days: float | None = None
    size: int | None = None
    scenes: int | None = None
    own: int | None = None
    _one: threading.Lock = field(default_factory=threading.Lock)

    def delete_run(self, run_id: str) -> None:
        """Delete a run; raise `Conflict` if a waiting or running study needs it."""
        with self.jobs.transaction() as queue:
            users = queue.execute(
                "SELECT id, state FROM job WHERE id IN (SELECT job FROM run WHERE run = ?)",
                (run_id,),
            )
            for user in users:
                if user["state"] in ("accepted", "running") or self.computes(user["id"]):
                    needed = f"the study {user['id']} needs this run"
                    raise Conflict(f"{needed}: dismiss it first, or wait for its end")
            if self._searched([run_id]):
                needed = "a study chooses its runs in the scene of this one, and may need it"
                raise Conflict(f"{needed}: dismiss it first, or wait for its end")
            self.store.discard([run_id])

    def _searched(self, runs: Collection[str]) -> set[str]:
        """Return those runs in whose scene a waiting or running study chooses its runs.

        What it asks for is known at its end.
        """
        scenes = set(self.jobs.searches().values())
        described = (self.store.scene(each, whole=False) for each in scenes)
        scenes.update(each.name for each in described if each)
        rows = self.store.catalogue.rows(runs) if scenes else {}
        return {run_id for run_id, row in rows.items() if row["scene"] in scenes}

    def accept(self, found: Examined, priority: int) -> tuple[Job, bool]:
        """Store a study, and put it into the queue; its scene is not deleted in between.

        If it does not fit on the disk, or too many wait (`NoRoom`, `Busy`), nothing of it stays.
        """
        study, size = found.study, found.estimate.bytes
        with self._one:
            self.check_room(found)
            there = bool(self.store.blobs.names(f"studies/{study.id}/*"))  # also damaged ones
            self.store.save_study(study, keep=True)
            content, most = study.to_dict(files=True), study.size
            try:
                return self.jobs.accept(
                    study.id, content, found.runs, priority, size, most, study.stage()
                )
            except Busy:  # or a queue that is made again from the studies would have it
                if not there:
                    self.store.discard_study(study.id)
                raise

    def check_room(self, found: Examined) -> None:
        """Raise `NoRoom` if a study does not fit on the disk beside those that have not ended."""
        size, promised = found.estimate.bytes, self.jobs.promised(but=found.study.id)
        free = shutil.disk_usage(self.store.directory).free
        if size and size + promised > free:
            each = ([size_text(b, n) for b in (size, free, promised)] for n in range(3, 17))
            takes, has, others = next(texts for texts in each if promised or texts[0] != texts[1])
            told = f"the study takes about {takes}, and {has} are free on the disk of the data"
            before = f", of which studies before it take {others}" if promised else ""
            raise NoRoom(f"{told} directory{before}: use fewer runs, or make room")

    def keep_scene(self, scene_id: str, description: Any, owner: str) -> bool:
        """Store a posted scene for a key; return whether it is new.

        Raise `Conflict` if all posted scenes, or those of the key, would take more than is allowed.
        """
        with self._one:
            if self.store.scene(scene_id, whole=False) is None:
                meshes = (description.meshes or {}).values()
                given = sum(len(mesh.data) + len(mesh.arrays) for mesh in meshes)
                there = self.store.scene_files()
                own = sum(scene.size for scene in there if scene.owner == owner)
                every = sum(scene.size for scene in there)
                for whose, taken, most in (("your", own, self.own), ("the", every, self.scenes)):
                    if most is not None and taken + given > most:
                        would = f"{whose} posted scenes would take {taken + given} bytes"
                        raise Conflict(f"{would}, at most {most} are allowed: delete some")
            return self.store.keep_scene(scene_id, description, owner)

    def delete_scene(self, scene_id: str) -> None:
        """Delete a posted scene, also one that this version does not allow.

        Raise `Conflict` if a study, of the queue or of the command line, names it.
        """
        if not self.store.size(f"scenes/{scene_id}/*"):
            raise NotFound(f"no posted scene has the id {scene_id}")
        with self._one:
            if user := self._users().get(scene_id):
                raise Conflict(f"the study {user} needs this scene: delete it first")
            self.store.discard_scene(scene_id)

    def _users(self) -> dict[str, str]:
        """Return a study for each scene that is named, in the queue or by the command line."""
        every = ((each, self.store.definition(each)) for each in self.store.study_ids())
        found = {str(study.get("scene")): study_id for study_id, study in every if study}
        return found | dict(self.jobs.rows("SELECT scene, id FROM job"))

    def purge(self, study_id: str) -> int:
        """Delete a study, its data set, and those of its runs that no other study needs.

        Return the number of bytes freed. Raise `Conflict` if it is waiting or running, or its
        process has not ended yet.
        """
        with self._ended(study_id) as queue:
            job = self.jobs.read(queue, study_id)
            put(queue, job, state=StudyState.DISMISSED, message=DELETED)
        elsewhere = self._needed_elsewhere()
        with self._ended(study_id) as queue:
            own = queue.execute(
                "SELECT run FROM run AS mine WHERE job = ? AND NOT EXISTS"
                " (SELECT 1 FROM run WHERE run = mine.run AND job <> mine.job)",
                (study_id,),
            )
            unneeded = {row["run"] for row in own} - elsewhere
            unneeded -= self._searched(unneeded)
            freed = self.store.size(
                f"studies/{study_id}/*", *(f"runs/{run}.nc" for run in unneeded)
            )
            self.store.discard(unneeded)
            self.store.discard_study(study_id)
            forget(queue, study_id)
        return freed

    def sweep(self) -> None:
        """Purge studies that are too old, and the oldest ones while the total size is too large.

        Scenes that no study needs go before them. Studies that only the command line has computed
        are kept, and so are scenes of the last day, for the studies that will name them.
        """
        if self.days is None and self.size is None:
            return
        oldest = datetime.now(UTC) - timedelta(days=self.days) if self.days else None
        excess = 0
        if self.size is not None:
            used = self.store.size("runs/*", "studies/*/*")
            excess = used + sum(scene.size for scene in self.store.scene_files()) - self.size
        if excess > 0:
            excess -= self._sweep_scenes(excess)
        for job in self.jobs.ended():
            old = oldest is not None and datetime.fromisoformat(str(job.finished)) < oldest
            if not (old or excess > 0):
                return
            with suppress(Conflict, NotFound):
                excess -= self.purge(job.id)
                reason = f"older than {self.days} days" if old else f"above {self.size} bytes"
                log.info("deleted a study: %s", reason, extra={"study": job.id})

    def _sweep_scenes(self, excess: int) -> int:
        """Delete scenes that no study needs, the oldest first; return the bytes freed."""
        freed, before = 0, time.time_ns() - FRESH
        with self._one:
            users = self._users()
            for scene in self.store.scene_files():
                if freed >= excess or scene.added > before:
                    break
                if scene.id not in users:
                    self.store.discard_scene(scene.id)
                    freed += scene.size
                    log.info("deleted a posted scene: above %s bytes", self.size)
        return freed

    @asynccontextmanager
    async def working(self) -> AsyncIterator[None]:
        """Sweep at intervals, in a thread, while the context is open."""
        stop = asyncio.Event()

        async def work() -> None:
            while not stop.is_set():
                try:
                    await asyncio.to_thread(self.sweep)
                except Exception:
                    log.exception("studies beyond the age or size could not be deleted")
                with suppress(TimeoutError):
                    await asyncio.wait_for(stop.wait(), INTERVAL)

        task = asyncio.create_task(work())
        try:
            yield
        finally:
            stop.set()
            await task

    @contextmanager
    def _ended(self, study_id: str) -> Iterator[sqlite3.Connection]:
        """Give a transaction in which a study has ended, and cannot begin again."""
        with self.jobs.transaction() as queue:
            state = self.jobs.read(queue, study_id).state
            if not state.final:
                raise Conflict(f"the study is {state}: dismiss it first, then delete it")
            if self.computes(study_id):
                raise Conflict("the work on the study is being stopped: delete it a little later")
            yield queue

    def _needed_elsewhere(self) -> set[str]:
        """Return the runs of studies that are not in the queue: those of the command line.

        A study that cannot be read, or whose id has changed, cannot be computed again, and needs no
        run. One that chooses its runs needs those that it has asked for (`Store.runs_of`).
        """
        known = {row["id"] for row in self.jobs.rows("SELECT id FROM job")}
        needed: set[str] = set()
        for study_id in set(self.store.study_ids()) - known:
            with suppress(FileDamaged, ValueError):
                needed.update(self.store.runs_of(self.store.study(study_id)))
        return needed
