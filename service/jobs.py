"""The durable queue: one row of an SQLite file for each study ever accepted.

The row alone says what shall be done with a study. Routes write into it what users ask for
(accept, dismiss, retry); the runner reads that, and writes what was done. A service that starts
after a crash reads from it what is left to do.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from typing import Any

from service.errors import Conflict, NotFound

SCHEMA = """
CREATE TABLE IF NOT EXISTS job (
    id TEXT PRIMARY KEY,
    study TEXT NOT NULL,
    runs TEXT NOT NULL,
    size INTEGER NOT NULL,
    state TEXT NOT NULL,
    message TEXT NOT NULL,
    progress REAL NOT NULL,
    again INTEGER NOT NULL,
    submitted TEXT NOT NULL,
    started TEXT,
    finished TEXT,
    turn INTEGER NOT NULL
);
CREATE INDEX IF NOT EXISTS job_turn ON job (turn);
"""
COLUMNS = "id, study, size, state, message, progress, again, submitted, started, finished"
NEXT_TURN = "(SELECT COALESCE(MAX(turn), 0) + 1 FROM job)"


class State(StrEnum):
    """Where a study stands."""

    ACCEPTED = "accepted"
    RUNNING = "running"
    SUCCESSFUL = "successful"
    FAILED = "failed"
    DISMISSED = "dismissed"

    @property
    def final(self) -> bool:
        """Whether the work has ended; only a retry starts it again."""
        return self not in (State.ACCEPTED, State.RUNNING)


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """One study in the queue.

    Attributes
    ----------
    id : content id of the study
    study : the study as ``Study.to_dict`` gave it
    size : number of its runs
    state, message : where it stands, and why when that needs a reason
    progress : percentage of the work that is done
    again : whether runs that failed are to be computed again; over once the work has begun
    submitted, started, finished : ISO 8601, UTC
    """

    id: str
    study: dict[str, Any]
    size: int
    state: State
    message: str
    progress: float
    again: bool
    submitted: str
    started: str | None
    finished: str | None


class Jobs:
    """The queue in the file ``path``; safe to use from many threads and processes."""

    def __init__(self, path: Path) -> None:
        self.path = path
        with self._transaction() as connection:
            connection.executescript(SCHEMA)

    def accept(self, job_id: str, study: dict[str, Any], runs: Sequence[str]) -> tuple[Job, bool]:
        """Return the job of this study, and whether it was not known before.

        ``runs`` are the ids of its runs in the order of its cases. They are kept, because an
        edited solver would give other ids, and the study would lose sight of what it computed.
        """
        with self._transaction() as connection:
            cursor = connection.execute(
                "INSERT INTO job"
                " (id, study, runs, size, state, message, progress, again, submitted, turn)"
                f" VALUES (?, ?, ?, ?, ?, '', 0, 0, ?, {NEXT_TURN}) ON CONFLICT (id) DO NOTHING",
                (job_id, json.dumps(study), json.dumps(runs), len(runs), State.ACCEPTED, now()),
            )
            return self._read(connection, job_id), cursor.rowcount == 1

    def get(self, job_id: str) -> Job:
        """Return one job.

        Raises
        ------
        NotFound
            If no study with this id was accepted.
        """
        with self._transaction("BEGIN") as connection:
            return self._read(connection, job_id)

    def runs(self, job_id: str) -> list[str]:
        """Return the ids of a job's runs in the order of its cases."""
        with self._transaction("BEGIN") as connection:
            row = connection.execute("SELECT runs FROM job WHERE id = ?", (job_id,)).fetchone()
            if row is None:
                raise unknown(job_id)
            runs: list[str] = json.loads(row["runs"])
            return runs

    def page(self, *, limit: int, offset: int, state: State | None = None) -> tuple[list[Job], int]:
        """Return jobs, the latest first, and how many there are altogether."""
        where, values = ("WHERE state = ?", (state,)) if state else ("", ())
        with self._transaction("BEGIN") as connection:
            (total,) = connection.execute(f"SELECT COUNT(*) FROM job {where}", values).fetchone()
            rows = connection.execute(
                f"SELECT {COLUMNS} FROM job {where} ORDER BY turn DESC LIMIT ? OFFSET ?",
                (*values, limit, offset),
            )
            return [job_of(row) for row in rows], total

    def take(self) -> Job | None:
        """Mark the job whose turn it is as running, and return it."""
        with self._transaction() as connection:
            row = connection.execute(
                "SELECT id FROM job WHERE state IN (?, ?) ORDER BY turn LIMIT 1",
                (State.RUNNING, State.ACCEPTED),
            ).fetchone()
            if row is None:
                return None
            connection.execute(
                "UPDATE job SET state = ?, message = '', started = ?, finished = NULL"
                " WHERE id = ? AND state = ?",
                (State.RUNNING, now(), row["id"], State.ACCEPTED),
            )
            return self._read(connection, row["id"])

    def finish(self, job_id: str, state: State, message: str) -> None:
        """Write the end of a running job; one dismissed meanwhile stays dismissed."""
        with self._transaction() as connection:
            connection.execute(
                "UPDATE job SET state = ?, message = ?, finished = ?,"
                " progress = CASE ? WHEN 'successful' THEN 100 ELSE progress END"
                " WHERE id = ? AND state = ?",
                (state, message, now(), state, job_id, State.RUNNING),
            )

    def note(self, job_id: str, progress: float, message: str = "") -> None:
        """Write how far a running job is, and why it had to be started again, if it had."""
        with self._transaction() as connection:
            connection.execute(
                "UPDATE job SET message = ?, progress = ? WHERE id = ? AND state = ?",
                (message, progress, job_id, State.RUNNING),
            )

    def begun(self, job_id: str) -> None:
        """Write that a running job has begun: runs that fail now are not tried again."""
        with self._transaction() as connection:
            connection.execute(
                "UPDATE job SET again = 0 WHERE id = ? AND state = ?", (job_id, State.RUNNING)
            )

    def dismiss(self, job_id: str) -> Job:
        """Ask that the work on a job stops; asking twice is asking once.

        Raises
        ------
        NotFound
            If the job is unknown.
        Conflict
            If it has come to its end already.
        """
        with self._transaction() as connection:
            job = self._read(connection, job_id)
            if job.state in (State.SUCCESSFUL, State.FAILED):
                raise Conflict(f"the study is {job.state} already: there is no work to stop")
            if job.state is not State.DISMISSED:
                connection.execute(
                    "UPDATE job SET state = ?, message = '', finished = ? WHERE id = ?",
                    (State.DISMISSED, now(), job_id),
                )
            return self._read(connection, job_id)

    def retry(self, job_id: str) -> Job:
        """Put a job that came to an end back in the queue, at its end.

        Raises
        ------
        NotFound
            If the job is unknown.
        Conflict
            If it is still waiting or running.
        """
        with self._transaction() as connection:
            job = self._read(connection, job_id)
            if not job.state.final:
                raise Conflict(f"the study is {job.state}: wait for its end or dismiss it first")
            connection.execute(
                "UPDATE job SET state = ?, message = '', progress = 0, again = 1,"
                f" started = NULL, finished = NULL, turn = {NEXT_TURN} WHERE id = ?",
                (State.ACCEPTED, job_id),
            )
            return self._read(connection, job_id)

    @contextmanager
    def _transaction(self, begin: str = "BEGIN IMMEDIATE") -> Iterator[sqlite3.Connection]:
        connection = sqlite3.connect(self.path, timeout=30.0, isolation_level=None)
        connection.row_factory = sqlite3.Row
        try:
            connection.execute(begin)
            with connection:
                yield connection
        finally:
            connection.close()

    @staticmethod
    def _read(connection: sqlite3.Connection, job_id: str) -> Job:
        row = connection.execute(f"SELECT {COLUMNS} FROM job WHERE id = ?", (job_id,)).fetchone()
        if row is None:
            raise unknown(job_id)
        return job_of(row)


def job_of(row: sqlite3.Row) -> Job:
    """Return the job a row of the table stands for."""
    return Job(
        **dict(row)
        | {
            "study": json.loads(row["study"]),
            "state": State(row["state"]),
            "again": bool(row["again"]),
        }
    )


def unknown(job_id: str) -> NotFound:
    """Return the error for an id that no study has."""
    return NotFound(f"no study has the id {job_id}")


def now() -> str:
    """Return the time in UTC as ISO 8601, to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds")
