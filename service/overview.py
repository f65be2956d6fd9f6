"""Jobs as the answers show them, together with what the catalogue knows of their runs."""

from __future__ import annotations

from typing import Any

from service.job import Job
from service.jobs import Jobs
from service.schemas import StudyDetail, StudyRun, StudySummary, Window
from studies import Store

PENDING = "pending"
"""Status of a run that is not in the catalogue."""


def summary(job: Job) -> StudySummary:
    """Return where a study stands."""
    return StudySummary(**_columns(job))


def detail(job: Job, jobs: Jobs, store: Store, window: Window) -> StudyDetail:
    """Return a study with the states of its runs, those in ``window`` one by one."""
    study = jobs.study(job.id)
    ids = jobs.runs(job.id)
    counts = store.catalogue.counts(ids)
    if pending := len(ids) - sum(counts.values()):
        counts[PENDING] = pending
    axes = {name: list(axis) for name, axis in study["sweep"].items()}  # of a table, its labels
    page = ids[window.offset : window.offset + window.limit]
    rows = store.catalogue.rows(page)
    return StudyDetail(
        **_columns(job),
        parameters=study["parameters"],
        sweep=study["sweep"],
        counts=counts,
        runs=[
            StudyRun(
                id=run_id,
                status=rows[run_id]["status"] if run_id in rows else PENDING,
                message=rows[run_id]["message"] if run_id in rows else "",
                at=point(axes, position),
            )
            for position, run_id in enumerate(page, window.offset)
        ],
    )


def point(axes: dict[str, list[Any]], position: int) -> dict[str, Any]:
    """Return the values on the axes of the run at ``position``; the last axis runs fastest."""
    values = {}
    for name, axis in reversed(axes.items()):
        position, index = divmod(position, len(axis))
        values[name] = axis[index]
    return dict(reversed(values.items()))


def _columns(job: Job) -> dict[str, Any]:
    return {
        "id": job.id,
        "name": job.name,
        "scene": job.scene,
        "status": job.state,
        "message": job.message,
        "progress": round(job.progress, 1),
        "priority": job.priority,
        "size": job.size,
        "submitted": job.submitted,
        "started": job.started,
        "finished": job.finished,
    }
