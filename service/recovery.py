"""Queue and catalogue: opened at the start, and made again when they are missing or damaged."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Collection
from contextlib import suppress
from pathlib import Path

from service.errors import NotFound, QueueLost
from service.job import StudyState, verdict
from service.jobs import Jobs
from studies.definition.vocabulary import MISSING
from studies.errors import FileDamaged
from studies.storage.database import Database
from studies.storage.seal import State, state_of
from studies.storage.store import Store

log = logging.getLogger(__name__)

REST = 50.0
"""A file that changes all the time is checked in at most a part of the time, one in so many."""


def open_queue(
    path: Path, store: Store, longest: int | None, computed: Collection[str] = ()
) -> Jobs:
    """Return the queue; a missing or damaged one is made again from the studies of the store.

    A damaged file is set aside. A study with a data set and all runs in it gets its final state
    from the data set. Another one is accepted, and computed. One in ``computed``, on which a
    process works now, is running.
    """
    try:
        if path.exists():
            jobs = Jobs(path, longest)
            _adopt(jobs, store)
            return jobs
    except QueueLost as error:
        store.put_aside(path, str(error.__cause__), "it is made again from the studies")
    part = path.with_name(f"{path.name}.part")
    part.unlink(missing_ok=True)
    jobs = Jobs(part)
    for study_id in store.study_ids():
        add(study_id, jobs, store)
    jobs.resume(computed)
    # A journal of the lost file would be applied to the new one.
    path.with_name(f"{path.name}-journal").unlink(missing_ok=True)
    part.replace(path)  # at once, so that the queue is never seen empty
    return Jobs(path, longest)


def _adopt(jobs: Jobs, store: Store) -> None:
    """Add the studies to the queue that ``residua run`` has computed in this directory."""
    for study_id in store.study_ids():
        try:
            jobs.get(study_id)
        except NotFound:
            if store.blobs.names(f"studies/{study_id}/dataset.nc"):
                add(study_id, jobs, store, begun=False)


def add(study_id: str, jobs: Jobs, store: Store, begun: bool = True) -> None:
    """Add a study of the directory to the queue, if this version of the solver accepts it.

    One that the service has ``begun`` has ended if its data set is there, and all runs in it.
    Another one, which nobody asked the service to compute, is added with its data set alone.
    """
    try:
        study = store.study(study_id)
    except FileDamaged:  # the store has told it
        return
    except ValueError as error:  # StudyError is one
        if getattr(error, "value", None) != study_id:  # that is of another version of the solver
            log.warning("studies/%s: not restored: %s", study_id, error)
        return
    counts, content = store.outcomes(study.id), study.to_dict(files=True)
    if not (counts or begun):
        return
    if study.kind.chooses:
        asked = store.asked(study)
        ended = asked is not None and len(store.modified(asked)) == len(asked)
        stage = study.stage(study.expansion.size if ended else 0)
        jobs.accept(study.id, content, sorted(asked or ()), most=study.size, stage=stage)
    else:
        jobs.accept(study.id, content, study.run_ids())
        there = len(store.modified(study.run_ids()))
        ended = not begun or there >= counts.total() - counts[MISSING]
    if counts and (ended or not begun):
        jobs.finish(study.id, *verdict(counts, study.kind.counted), standing=StudyState.ACCEPTED)


class Mender:
    """Looks after queue, catalogue and studies: what is lost or damaged is made again, unasked."""

    def __init__(self, jobs: Jobs, store: Store) -> None:
        self.jobs, self.store = jobs, store
        self._seen: dict[Path, tuple[State | None, float]] = {}

    def look(self, computed: Collection[str]) -> None:
        """Look at all; a study in ``computed``, on which a process works, keeps its definition."""
        self._look_at(self.jobs, lambda: self._mend_queue(computed))
        self._look_at(self.store.catalogue, self.store.reconcile)
        for study_id in computed:
            with suppress(NotFound):
                self.store.save_definition(study_id, self.jobs.study(study_id), keep=True)

    def _look_at(self, file: Database, mend: Callable[[], None]) -> None:
        """Mend a file if it has changed, is missing, or damage was found in it."""
        state, began = state_of(file.path), time.monotonic()
        seen, due = self._seen.get(file.path, (None, 0.0))
        if file.damaged or state is None or (state != seen and began >= due):
            mend()
            now = time.monotonic()
            self._seen[file.path] = state, now + REST * (now - began)

    def _mend_queue(self, computed: Collection[str]) -> None:
        try:
            self.jobs.check()
        except QueueLost:
            open_queue(self.jobs.path, self.store, self.jobs.longest, computed)
            self.jobs.damaged = False
            log.warning("%s has been made again from the studies", self.jobs.path.name)
