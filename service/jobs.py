"""The durable queue: one row of an SQLite file for each accepted study.

The state of a study is in its row alone. Routes write the requests of users into it (accept,
dismiss, retry); the runner reads these, and writes the results. After a crash the service reads
the remaining work from it. A row that cannot be read does not affect other rows.
"""

from __future__ import annotations

import json
import sqlite3
import sys
import time
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from service import schema
from service.errors import Busy, Conflict, NotFound, QueueLost
from service.job import COLUMNS, UNREADABLE, Job, StudyState, job_of, wanted
from studies.storage.database import Database, check

NEXT_TURN = "(SELECT COALESCE(MAX(turn), 0) + 1 FROM job)"
SHARED = """SELECT 1 FROM run AS mine JOIN run AS theirs ON theirs.run = mine.run
    WHERE mine.job = ? AND theirs.job IN (SELECT value FROM json_each(?)) LIMIT 1"""


class Jobs(Database):
    """The queue in the file ``path``; safe to use from many threads and processes.

    Methods raise `QueueLost` if the file is missing or damaged, `StoreFull` if the disk is full.

    Parameters
    ----------
    path : the file; created, or converted to the current form, when the queue is opened
    longest : largest number of waiting studies; None for any number
    """

    def __init__(self, path: Path, longest: int | None = None) -> None:
        super().__init__(path, QueueLost, OSError)
        self.longest = longest
        new = not path.exists()
        with self.transaction("BEGIN IMMEDIATE", mode="rwc" if new else "rw") as connection:
            schema.prepare(connection, new)
            check(connection)

    def check(self) -> None:
        """Raise `QueueLost` if the file is missing or damaged; the whole file is read."""
        with self.transaction("BEGIN") as connection:
            connection.execute("SELECT 1 FROM job, run LIMIT 1")
            check(connection)
        self.damaged = False

    def accept(
        self, job_id: str, study: dict[str, Any], runs: Iterable[str], priority: int = 0
    ) -> tuple[Job, bool]:
        """Return the job of this study, and whether it is new.

        ``runs`` are the ids of its runs in the order of its cases. They are stored, because a
        changed solver would give other ids, and the study would not find its runs.

        Raises
        ------
        Busy
            If the queue has its largest length.
        """
        with self.transaction() as connection:
            with suppress(NotFound, Conflict):
                self._study(connection, job_id)
                return self._read(connection, job_id), False
            count = "SELECT COUNT(*) FROM job WHERE state = ?"
            (waiting,) = connection.execute(count, (StudyState.ACCEPTED,)).fetchone()
            if self.longest is not None and waiting >= self.longest:
                raise Busy(f"{waiting} studies wait already, the largest number: post it later")
            connection.execute("DELETE FROM job WHERE id = ?", (job_id,))  # an unreadable row
            connection.execute("DELETE FROM run WHERE job = ?", (job_id,))
            connection.executemany(
                "INSERT INTO run VALUES (?, ?, ?)",
                ((job_id, position, run) for position, run in enumerate(runs)),
            )
            connection.execute(
                "INSERT INTO job SELECT ?, ?, ?, ?, COUNT(*), ?, '', 0, 0, '', ?, ?, NULL, NULL,"
                f" {NEXT_TURN} FROM run WHERE job = ?",
                (
                    job_id, study["name"], study["scene"], json.dumps(study), StudyState.ACCEPTED,
                    priority, now(), job_id,
                ),
            )  # fmt: skip
            return self._read(connection, job_id), True

    def get(self, job_id: str) -> Job:
        """Return one job.

        Raises
        ------
        NotFound
            If no study with this id was accepted.
        """
        with self.transaction("BEGIN") as connection:
            return self._read(connection, job_id)

    def study(self, job_id: str) -> dict[str, Any]:
        """Return the study of a job as ``Study.to_dict`` gave it."""
        with self.transaction("BEGIN") as connection:
            return self._study(connection, job_id)

    def runs(self, job_id: str, limit: int = -1, offset: int = 0) -> list[str]:
        """Return the ids of a job's runs in the order of its cases, or one page of them."""
        with self.transaction("BEGIN") as connection:
            rows = connection.execute(
                "SELECT run FROM run WHERE job = ? AND position >= ? ORDER BY position LIMIT ?",
                (job_id, offset, limit),
            )
            return [row["run"] for row in rows]

    def page(self, *, limit: int, offset: int, **which: Any) -> tuple[list[Job], int]:
        """Return a page of jobs, the latest first, and the number of all; filters: `wanted`."""
        where, values = wanted(**which)
        with self.transaction("BEGIN") as connection:
            (total,) = connection.execute(f"SELECT COUNT(*) FROM job {where}", values).fetchone()
            rows = connection.execute(
                f"SELECT {COLUMNS} FROM job {where} ORDER BY turn DESC LIMIT ? OFFSET ?",
                (*values, limit, offset),
            )
            found = [job_of(row) for row in rows]
            return [job for job in found if job is not None], total

    def states(self) -> dict[str, int]:
        """Return the number of jobs by state, without states that no job has."""
        with self.transaction("BEGIN") as connection:
            counted = connection.execute("SELECT state, COUNT(*) FROM job GROUP BY state")
            return dict(counted.fetchall())

    def take(self, busy: Collection[str] = (), largest: int = sys.maxsize) -> Job | None:
        """Mark the next job as running, and return it; None if there is none.

        It has at most ``largest`` runs, and shares no run with ``busy``, the jobs that are being
        computed, so that common runs are computed once.
        """
        others = json.dumps(list(busy))
        with self.transaction() as connection:
            waiting = connection.execute(
                "SELECT id FROM job WHERE state IN (?, ?) AND size <= ?"
                " AND id NOT IN (SELECT value FROM json_each(?))"
                " ORDER BY priority DESC, turn",
                (StudyState.RUNNING, StudyState.ACCEPTED, largest, others),
            ).fetchall()
            for row in waiting:
                if connection.execute(SHARED, (row["id"], others)).fetchone():
                    continue
                connection.execute(
                    "UPDATE job SET state = ?, message = '', started = ?, finished = NULL"
                    " WHERE id = ? AND state = ?",
                    (StudyState.RUNNING, now(), row["id"], StudyState.ACCEPTED),
                )
                try:
                    return self._read(connection, row["id"])
                except NotFound:
                    end = (StudyState.FAILED, UNREADABLE, row["id"])
                    connection.execute("UPDATE job SET state = ?, message = ? WHERE id = ?", end)
            return None

    def resume(self, busy: Collection[str]) -> None:
        """Mark jobs as running, in a queue that was made again while processes work on them."""
        with self.transaction() as connection:
            connection.executemany(
                "UPDATE job SET stood = IIF(state = ?, '', state), state = ?, message = '',"
                " progress = 0, started = ?, finished = NULL WHERE id = ?",
                [(StudyState.ACCEPTED, StudyState.RUNNING, now(), job_id) for job_id in busy],
            )

    def waiting(self) -> dict[str, str]:
        """Return, by id, the reason for which running jobs wait, without those that do not."""
        with self.transaction("BEGIN") as connection:
            rows = connection.execute(
                "SELECT id, message FROM job WHERE state = ? AND message != ''",
                (StudyState.RUNNING,),
            )
            return {row["id"]: row["message"] for row in rows}

    def finish(
        self,
        job_id: str,
        state: StudyState,
        message: str,
        standing: StudyState = StudyState.RUNNING,
    ) -> None:
        """Write the final state of a job; if it was dismissed meanwhile, it stays dismissed."""
        with self.transaction() as connection:
            connection.execute(
                "UPDATE job SET state = ?, message = ?, finished = ?,"
                " progress = CASE ? WHEN 'successful' THEN 100 ELSE progress END"
                " WHERE id = ? AND state = ?",
                (state, message, now(), state, job_id, standing),
            )

    def note(self, job_id: str, progress: float, message: str = "") -> None:
        """Write the progress of a running job, and the reason for which it waits, if it does."""
        with self.transaction() as connection:
            connection.execute(
                "UPDATE job SET message = ?, progress = ? WHERE id = ? AND state = ?",
                (message, progress, job_id, StudyState.RUNNING),
            )

    def dismiss(self, job_id: str) -> Job:
        """Request that the work on a job stops; a repeated request has no further effect.

        A study that was successful before its retry becomes successful again: its data set exists.

        Raises
        ------
        NotFound
            If the job is unknown.
        Conflict
            If it has ended already.
        """
        with self.transaction() as connection:
            job = self._read(connection, job_id)
            if job.state in (StudyState.SUCCESSFUL, StudyState.FAILED):
                raise Conflict(f"the study is {job.state} already: there is no work to stop")
            if job.state is not StudyState.DISMISSED:
                connection.execute(
                    "UPDATE job SET state = IIF(stood = 'successful', stood, ?), message = '',"
                    " progress = IIF(stood = 'successful', 100, progress), finished = ?"
                    " WHERE id = ?",
                    (StudyState.DISMISSED, now(), job_id),
                )
            return self._read(connection, job_id)

    def retry(self, job_id: str, failed: bool = True) -> Job:
        """Put a job that has ended back into the queue, in the last place.

        Without ``failed`` only its missing runs are computed, and its data set is made again.

        Raises
        ------
        NotFound
            If the job is unknown.
        Conflict
            If it is waiting or running.
        """
        with self.transaction() as connection:
            job = self._read(connection, job_id)
            if not job.state.final:
                raise Conflict(f"the study is {job.state}: wait for its end or dismiss it first")
            connection.execute(
                "UPDATE job SET stood = state, state = ?, message = '', progress = 0, since = ?,"
                f" started = NULL, finished = NULL, turn = {NEXT_TURN} WHERE id = ?",
                (StudyState.ACCEPTED, time.time_ns() if failed else job.since, job_id),
            )
            return self._read(connection, job_id)

    @contextmanager
    def transaction(
        self, begin: str = "BEGIN IMMEDIATE", mode: str = "rw"
    ) -> Iterator[sqlite3.Connection]:
        """Give a connection for one transaction, during which no other process writes.

        A missing file is not created: other processes may have written to it.
        """
        with self.connection(begin, mode) as connection:
            connection.row_factory = sqlite3.Row
            connection.text_factory = lambda text: text.decode(errors="replace")
            yield connection

    @staticmethod
    def _study(connection: sqlite3.Connection, job_id: str) -> dict[str, Any]:
        row = connection.execute("SELECT study FROM job WHERE id = ?", (job_id,)).fetchone()
        if row is None:
            raise unknown(job_id)
        try:
            study: dict[str, Any] = json.loads(row["study"])
        except ValueError:
            raise Conflict(UNREADABLE) from None
        return study

    @staticmethod
    def _read(connection: sqlite3.Connection, job_id: str) -> Job:
        row = connection.execute(f"SELECT {COLUMNS} FROM job WHERE id = ?", (job_id,)).fetchone()
        job = job_of(row) if row else None
        if job is None:
            raise unknown(job_id)
        return job


def unknown(job_id: str) -> NotFound:
    """Return the error for an id that no study has."""
    return NotFound(f"no study has the id {job_id}")


def now() -> str:
    """Return the time in UTC as ISO 8601, to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds")
