"""The data set of a study: as its last end left it, and before its first one of the runs there are.

The latter is made in another process, in a folder for temporary files, when somebody asks for it,
and again when runs have been added; meanwhile the one before is given. For this callers have turns
of their own, one at a time, so that nothing else waits for it. One that took much processor time is
made seldom: a study that adds a run each second would keep a processor busy.
"""

from __future__ import annotations

import asyncio
import errno
import math
import time
from collections import OrderedDict
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from service.cache import Cache
from service.errors import Busy, Conflict, NotFound
from service.job import Job, StudyState
from service.jobs import Jobs
from service.turns import Beyond, Share
from solver.late import Late
from studies.errors import FileDamaged, StoreFull
from studies.kinds import kind_of
from studies.scratch import scratch
from studies.storage.seal import State, state_of
from studies.storage.store import Store
from studies.storage.tiles import Tiles

COMBINED, FOUND = Late("service.reading:combined"), Late("service.reading:found")

KEPT = 4
"""Number of studies whose data set is kept."""
FOUND_KEPT = 16
"""Number of studies of which is kept what they found."""

REST = 10.0
"""Time for which a data set is kept though runs were added, as a multiple of the processor time of
making it."""

SECONDS = 600.0
"""Longest time of making one [s]."""

PATIENCE, BRIEFLY = 20.0, 2.0
"""Longest time that a request waits for one [s], after which the answer is to ask later; and that
after which it is the one before, if there is one."""

LARGE = (
    "the data set of the runs that are there takes too long, or too much memory, to be made in "
    "between: it is written when the study ends. Until then read the numbers of all runs in "
    "/studies/{id}/table.csv, and single runs in /runs/{run}.nc"
)
AGAIN = "the data set was lost or damaged, and is made again from the runs: ask later"


@dataclass(slots=True)
class _Offered:
    """A data set: of which state of the catalogue, where it is, and until when it stays.

    It is nowhere if none could be made; then it is tried again after this time. If one of more runs
    cannot be made, the one before stays. Each caller has a task, which waits for the caller's turn.
    """

    of: State | None = None
    path: Path | None = None
    until: float = 0.0
    number: int = 0
    tasks: dict[str, asyncio.Task[Path]] = field(default_factory=dict)

    @property
    def busy(self) -> bool:
        """Whether a caller waits for it, in its turn."""
        return not all(each.done() for each in self.tasks.values())


class Datasets:
    """The data sets of the studies in the queue.

    Parameters
    ----------
    computes : whether somebody takes studies from the queue
    """

    def __init__(self, jobs: Jobs, store: Store, computes: bool = True) -> None:
        self.jobs, self.store, self.computes = jobs, store, computes
        self.made: OrderedDict[str, _Offered] = OrderedDict()
        self.answers = Cache[Any](FOUND_KEPT)
        self.folders = ExitStack()
        self.folder: Path | None = None

    def ended(self, job: Job) -> Path:
        """Return the path of the data set that the last end of a study left, checked.

        Raise `NotFound` if there is none yet, `Busy` if it was lost or damaged, and is made again.
        """
        try:
            return self.store.dataset(job.id)
        except FileDamaged as error:
            held = error.state is not None or job.state is StudyState.SUCCESSFUL
        if held and not self.computes:
            raise NotFound("the data set was lost or damaged, and nothing is computed here")
        if held and job.state.final and job.state is not StudyState.DISMISSED:
            with suppress(Conflict):
                self.jobs.retry(job.id, failed=False)
            raise Busy(AGAIN)
        raise NotFound(
            f"no data set yet: it is written when the work ends, and the study is {job.state}"
        )

    async def current(self, job: Job, reading: Share, combining: Share) -> Path:
        """Return the path of that of `ended`, or before the first end of one of the runs there are.

        Raise `NotFound` if the study chooses its runs and has not ended, `Busy` if it is made now.
        """
        try:
            return await reading.here(self.ended, job)
        except NotFound:
            if job.stood == StudyState.SUCCESSFUL and not job.state.final:
                raise Busy(AGAIN) from None
            return await self._partial(job, await reading.here(self.jobs.study, job.id), combining)

    async def found(self, job: Job, reading: Share) -> Any:
        """Return what a study that chooses its runs has found; errors as `ended`."""
        path = await reading.here(self.ended, job)
        state = state_of(path)
        if (found := self.answers.get(path, of=state)) is not None:
            return found
        entries = await reading.read(FOUND, path)
        return self.answers.put(path, SimpleNamespace(**entries) if entries else None, of=state)

    async def tiles(self, job: Job, reading: Share, combining: Share) -> Tiles:
        """Return the current data set of a study as a Zarr store; errors as `current`."""
        path = await self.current(job, reading, combining)
        return await reading.here(self._tiles, job.id, path)

    def _tiles(self, study_id: str, path: Path) -> Tiles:
        found = Tiles(path)
        turn = self.jobs.layout_turn(study_id, found.layout)
        return Tiles(path, turn) if turn else found

    async def _partial(self, job: Job, study: dict[str, Any], share: Share) -> Path:
        """Return the path of the data set of a study as it is now, or was a little before."""
        if kind_of(study).chooses:
            raise NotFound(
                f"no data set yet: what the study finds is known at its end, and it is {job.state}"
            )
        made = self.made.setdefault(job.id, _Offered())
        self.made.move_to_end(job.id)
        if path := self._offered(made):
            return path
        task = made.tasks.get(share.caller)
        if task is None or task.done():
            task = asyncio.create_task(self._combined(job.id, study, made, share))
            made.tasks[share.caller] = task
        elif made.path:
            return made.path
        try:
            return await asyncio.wait_for(asyncio.shield(task), BRIEFLY if made.path else PATIENCE)
        except TimeoutError:
            if made.path:
                return made.path
            raise Busy("the data set is being made of the runs that are there: ask later") from None

    def _offered(self, made: _Offered) -> Path | None:
        """Return the data set if it may still be used; raise `Busy` if it may not be made now."""
        began = time.monotonic()
        if made.path and (began < made.until or made.of == state_of(self.store.catalogue.path)):
            return made.path
        if began < made.until:
            raise Busy(LARGE, math.ceil(made.until - began))
        return None

    async def _combined(
        self, study_id: str, content: dict[str, Any], made: _Offered, share: Share
    ) -> Path:
        """Return the data set, made in the turn of a caller unless it was made before it."""
        async with share.turn() as turn:
            if path := self._offered(made):
                return path
            of = state_of(self.store.catalogue.path)
            if self.folder is None:
                self.folder = self.folders.enter_context(scratch())
            target = self.folder / f"{study_id}-{made.number + 1}.nc"
            given = content, self.store.directory, self.store.aside, target
            try:
                await turn.apart(COMBINED, *given, field="data set", name=study_id, seconds=SECONDS)
            except StoreFull:  # not the data directory
                raise OSError(errno.ENOSPC, "no room is left for temporary files") from None
            except Beyond:
                made.until = rested(turn.spent)
                if made.path is None:
                    raise Busy(LARGE, math.ceil(made.until - time.monotonic())) from None
                return made.path
            finally:
                for part in target.parent.glob(f"{target.name}.*"):  # of a process that was ended
                    part.unlink(missing_ok=True)
            made.of, made.path, made.number = of, target, made.number + 1
            made.until = rested(turn.spent)
            self._forget(study_id, made.number - 2)  # the one before may still be sent
            self._keep_few(study_id)
            return target

    def _keep_few(self, latest: str) -> None:
        """Delete what was asked for longest ago; what is being made, and the latest, stay."""
        rest = [each for each, old in self.made.items() if not old.busy]
        over = max(len(self.made) - KEPT, 0)
        for gone in [each for each in rest if each != latest][:over]:
            self._forget(gone, self.made.pop(gone).number)

    def _forget(self, study_id: str, last: int) -> None:
        """Delete the files of a study up to this number."""
        assert self.folder is not None
        for path in self.folder.glob(f"{study_id}-*.nc"):
            with suppress(ValueError):
                if int(path.stem.rpartition("-")[2]) <= last:
                    path.unlink(missing_ok=True)

    def close(self) -> None:
        """Delete all of them."""
        self.folder = None
        self.made.clear()
        self.folders.close()


def rested(spent: float) -> float:
    """Return until when a data set stays that has just been made, in this processor time [s]."""
    return time.monotonic() + REST * spent
