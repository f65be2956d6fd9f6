"""The queue at the start of the service: with all studies of the directory, and repaired."""

from __future__ import annotations

import json
import logging
import shutil
from collections.abc import Collection
from pathlib import Path

from service.errors import NotFound, QueueLost
from service.job import StudyState, verdict
from service.jobs import Jobs
from studies import Store, Study
from studies.definition.identity import is_id

log = logging.getLogger(__name__)


def open_queue(
    path: Path, store: Store, longest: int | None, computed: Collection[str] = ()
) -> Jobs:
    """Return the queue; a missing or damaged one is made again from the studies of the store.

    A damaged file is kept under another name. A study with a data set gets its final state from
    the data set. One without is accepted, and computed. One in ``computed``, on which a process
    works now, is running.
    """
    try:
        if path.exists():
            jobs = Jobs(path, longest)
            _adopt(jobs, store)
            return jobs
    except QueueLost as error:
        damaged = path.with_name(f"{path.name}.damaged")
        log.error("%s: kept as %s, and made again from the studies", error, damaged.name)
        if damaged.is_dir():
            shutil.rmtree(damaged)
        damaged.unlink(missing_ok=True)
        path.replace(damaged)
    part = path.with_name(f"{path.name}.part")
    part.unlink(missing_ok=True)
    jobs = Jobs(part)
    for file in sorted(store.directory.glob("studies/*/study.json")):
        _find(file, jobs, store)
    jobs.resume(computed)
    # A journal of the lost file would be applied to the new one.
    path.with_name(f"{path.name}-journal").unlink(missing_ok=True)
    part.replace(path)  # at once, so that the queue is never seen empty
    return Jobs(path, longest)


def _adopt(jobs: Jobs, store: Store) -> None:
    """Add the studies to the queue that ``residua run`` has computed in this directory."""
    for file in sorted(store.directory.glob("studies/*/study.json")):
        study_id = file.parent.name
        try:
            jobs.get(study_id)
        except NotFound:
            if is_id(study_id) and store.outcomes(study_id):
                _find(file, jobs, store)


def _find(file: Path, jobs: Jobs, store: Store) -> None:
    """Add a study of the directory to the queue, if this version of the solver accepts it."""
    try:
        study = Study.known(json.loads(file.read_text(encoding="utf-8")), store.scene)
    except (OSError, ValueError) as error:  # StudyError is a ValueError
        log.warning("studies/%s: not restored: %s", file.parent.name, error)
        return
    if study.id != file.parent.name:
        return
    jobs.accept(study.id, study.to_dict(), study.run_ids())
    if counts := store.outcomes(study.id):
        jobs.finish(study.id, *verdict(counts), standing=StudyState.ACCEPTED)
