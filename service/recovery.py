"""The queue as the service starts: all studies of the directory; made anew where it is lost."""

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
    """Return the queue; one that is missing or damaged is made from the studies of the store.

    A damaged file is kept under another name. A study with a data set has ended, as the data set
    tells; one without is accepted, and computed; one of ``computed``, on which a process works
    now, is running.
    """
    try:
        if path.exists():
            jobs = Jobs(path, longest)
            _adopt(jobs, store)
            return jobs
    except QueueLost as error:
        damaged = path.with_name(f"{path.name}.damaged")
        log.error("%s: kept as %s, and made anew from the studies", error, damaged.name)
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
    # What a writer in the lost file left behind would be taken for a part of the new one.
    path.with_name(f"{path.name}-journal").unlink(missing_ok=True)
    part.replace(path)  # at once: until then the queue is lost, not empty
    return Jobs(path, longest)


def _adopt(jobs: Jobs, store: Store) -> None:
    """Put studies into the queue that ``residua run`` has computed in this directory."""
    for file in sorted(store.directory.glob("studies/*/study.json")):
        study_id = file.parent.name
        try:
            jobs.get(study_id)
        except NotFound:
            if is_id(study_id) and store.outcomes(study_id):
                _find(file, jobs, store)


def _find(file: Path, jobs: Jobs, store: Store) -> None:
    """Put a study of the directory into the queue, if this version of the solver knows it."""
    try:
        study = Study.known(json.loads(file.read_text(encoding="utf-8")), store.scene)
    except (OSError, ValueError) as error:  # StudyError is a ValueError
        log.warning("studies/%s: not found again: %s", file.parent.name, error)
        return
    if study.id != file.parent.name:
        return
    jobs.accept(study.id, study.to_dict(), study.run_ids())
    if counts := store.outcomes(study.id):
        jobs.finish(study.id, *verdict(counts), standing=StudyState.ACCEPTED)
