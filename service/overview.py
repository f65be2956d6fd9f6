"""Jobs as the answers show them, together with what the catalogue knows of their runs."""

from __future__ import annotations

from collections import Counter
from typing import Any

from service.jobs import Job, Jobs
from service.schemas import StudyDetail, StudyRun, StudySummary, Window
from studies import Store

PENDING = ("pending", "")
"""Status and message of a run that is not in the catalogue."""


def summary(job: Job) -> StudySummary:
    """Return where a study stands."""
    return StudySummary(**_columns(job))


def detail(job: Job, jobs: Jobs, store: Store, window: Window) -> StudyDetail:
    """Return a study with the states of its runs, those in ``window`` one by one."""
    ids = jobs.runs(job.id)
    rows = store.catalogue.rows(ids)
    outcomes = [(rows[i]["status"], rows[i]["message"]) if i in rows else PENDING for i in ids]
    axes = {name: list(axis) for name, axis in job.study["sweep"].items()}  # of a table, its labels
    page = range(window.offset, min(window.offset + window.limit, len(ids)))
    return StudyDetail(
        **_columns(job),
        parameters=job.study["parameters"],
        sweep=job.study["sweep"],
        counts=Counter(status for status, _ in outcomes),
        runs=[
            StudyRun(
                id=ids[position],
                status=outcomes[position][0],
                message=outcomes[position][1],
                at=point(axes, position),
            )
            for position in page
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
        "name": job.study["name"],
        "scene": job.study["scene"],
        "status": job.state,
        "message": job.message,
        "progress": round(job.progress, 1),
        "size": job.size,
        "submitted": job.submitted,
        "started": job.started,
        "finished": job.finished,
    }
