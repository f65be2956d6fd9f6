"""One study in the queue: its state and its data."""

from __future__ import annotations

import sqlite3
from collections.abc import Mapping
from dataclasses import dataclass, fields
from enum import StrEnum
from typing import Any

from studies.storage.database import WrongContent


class StudyState(StrEnum):
    """The state of a study."""

    ACCEPTED = "accepted"
    RUNNING = "running"
    SUCCESSFUL = "successful"
    FAILED = "failed"
    DISMISSED = "dismissed"

    @property
    def final(self) -> bool:
        """Whether the work has ended; only a retry starts it again."""
        return self not in (StudyState.ACCEPTED, StudyState.RUNNING)


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """One study in the queue.

    Attributes
    ----------
    id : content id of the study
    name, scene : name and scene of the study
    size : number of its runs
    state, message, stood : its state, the reason if there is one, and its state before a retry
    progress : completed percentage of the work
    since : time of the last retry [ns since 1970], 0 without one: runs that failed before it are
        computed again
    priority : the study with the greater priority is computed first
    submitted, started, finished : ISO 8601, UTC
    turn : the greater was accepted or retried later
    bytes : estimated size of the runs that it lacked, and of its data set
    stage : of a study that chooses its runs, how far it is; empty for others
    """

    id: str
    name: str
    scene: str
    size: int
    state: StudyState
    message: str
    progress: float
    since: int
    stood: str
    priority: int
    submitted: str
    started: str | None
    finished: str | None
    turn: int
    bytes: float
    stage: str


_KINDS = {
    "str": "TEXT NOT NULL", "str | None": "TEXT", "StudyState": "TEXT NOT NULL",
    "int": "INTEGER NOT NULL", "float": "REAL NOT NULL",
}  # fmt: skip
COLUMNS = {each.name: _KINDS[str(each.type)] for each in fields(Job)}
"""Columns of the table besides the text of the study, and what SQLite takes in them."""


def job_of(row: sqlite3.Row) -> Job:
    """Return the job of a row of the table; raise `WrongContent` if it has no known state."""
    try:
        values = {name: row[name] for name in COLUMNS}
        return Job(**{**values, "state": StudyState(row["state"])})
    except ValueError as error:
        raise WrongContent(f"the row of study {row['id']!r} is damaged: {error}") from None


def row_of(job: Job) -> list[Any]:
    """Return the row of a job, without the text of the study."""
    values = [getattr(job, name) for name in COLUMNS]
    return [str(each) if isinstance(each, StudyState) else each for each in values]


def wanted(
    state: StudyState | None = None,
    tag: str | None = None,
    scene: str | None = None,
    text: str | None = None,
    name: str | None = None,
) -> tuple[str, list[str]]:
    """Return the SQL condition for jobs, and its values.

    Parameters
    ----------
    tag : one of the tags of its study
    text : a part of its name or note, in capitals or not
    """
    tagged = "? IN (SELECT value FROM json_each(study, '$.tags'))"
    noted = "COALESCE(json_extract(study, '$.note'), '')"
    said = f"instr(lower(name || ' ' || {noted}), lower(?))"
    conditions = {"state = ?": state, "name = ?": name, "scene = ?": scene, tagged: tag, said: text}
    clauses = [clause for clause, value in conditions.items() if value is not None]
    values = [str(value) for value in conditions.values() if value is not None]
    return (f"WHERE {' AND '.join(clauses)}" if clauses else ""), values


def verdict(counts: Mapping[str, int], counted: str = "runs") -> tuple[StudyState, str]:
    """Return the final state of a study from what is ``counted`` by status, and the reason."""
    others = {status: count for status, count in counts.items() if count and status != "ok"}
    if not others:
        return StudyState.SUCCESSFUL, ""
    listed = ", ".join(f"{count} {status}" for status, count in others.items())
    most = sum(counts.values())
    return StudyState.FAILED, f"{sum(others.values())} of {most} {counted}: {listed}"
