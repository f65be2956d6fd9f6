"""The durable queue: one row of an SQLite file for each study ever accepted.

The row alone says what shall be done with a study. Routes write into it what users ask for
(accept, dismiss, retry); the runner reads that, and writes what was done. A service that starts
after a crash reads from it what is left to do. A row that cannot be read hides only itself.
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
from studies.errors import StoreFull

NEXT_TURN = "(SELECT COALESCE(MAX(turn), 0) + 1 FROM job)"
SHARED = """SELECT 1 FROM run AS mine JOIN run AS theirs ON theirs.run = mine.run
    WHERE mine.job = ? AND theirs.job IN (SELECT value FROM json_each(?)) LIMIT 1"""


class Jobs:
    """The queue in the file ``path``; safe to use from many threads and processes.

    Methods raise `QueueLost` when the file is gone or damaged, `StoreFull` when the disk is full.

    Parameters
    ----------
    path : the file; made, or brought into today's form, when the queue is opened
    longest : most studies that may wait; None for any number
    """

    def __init__(self, path: Path, longest: int | None = None) -> None:
        self.path = path
        self.longest = longest
        new = not path.exists()
        with self.transaction("BEGIN IMMEDIATE", mode="rwc" if new else "rw") as connection:
            schema.prepare(connection, new)
            for (finding,) in connection.execute("PRAGMA integrity_check(1)"):
                if finding != "ok":
                    raise sqlite3.DatabaseError(finding)

    def accept(
        self, job_id: str, study: dict[str, Any], runs: Iterable[str], priority: int = 0
    ) -> tuple[Job, bool]:
        """Return the job of this study, and whether it was not known before.

        ``runs`` are the ids of its runs in the order of its cases. They are kept, because an
        edited solver would give other ids, and the study would lose sight of what it computed.

        Raises
        ------
        Busy
            If as many studies wait as may.
        """
        with self.transaction() as connection:
            with suppress(NotFound, Conflict):
                self._study(connection, job_id)
                return self._read(connection, job_id), False
            count = "SELECT COUNT(*) FROM job WHERE state = ?"
            (waiting,) = connection.execute(count, (StudyState.ACCEPTED,)).fetchone()
            if self.longest is not None and waiting >= self.longest:
                raise Busy(f"{waiting} studies wait already, and no more may: post it later")
            connection.execute("DELETE FROM job WHERE id = ?", (job_id,))  # a row unreadable
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
        """Return jobs, the latest first, and how many there are altogether; see `wanted`."""
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
        """Return the number of jobs by state; a state that no job has is missing."""
        with self.transaction("BEGIN") as connection:
            counted = connection.execute("SELECT state, COUNT(*) FROM job GROUP BY state")
            return dict(counted.fetchall())

    def take(self, busy: Collection[str] = (), largest: int = sys.maxsize) -> Job | None:
        """Mark the job whose turn it is as running, and return it.

        It has at most ``largest`` runs. It is not one of ``busy``, the jobs that are being
        computed, and shares no run with them: what it shares with others is computed once.
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
        """Mark jobs as running on which a process works, in a queue made anew."""
        with self.transaction() as connection:
            connection.executemany(
                "UPDATE job SET stood = IIF(state = ?, '', state), state = ?, message = '',"
                " progress = 0, started = ?, finished = NULL WHERE id = ?",
                [(StudyState.ACCEPTED, StudyState.RUNNING, now(), job_id) for job_id in busy],
            )

    def waiting(self) -> dict[str, str]:
        """Return what the running jobs wait for, by id; nothing for those that go on."""
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
        """Write the end of a job in the given state; one dismissed meanwhile stays so."""
        with self.transaction() as connection:
            connection.execute(
                "UPDATE job SET state = ?, message = ?, finished = ?,"
                " progress = CASE ? WHEN 'successful' THEN 100 ELSE progress END"
                " WHERE id = ? AND state = ?",
                (state, message, now(), state, job_id, standing),
            )

    def note(self, job_id: str, progress: float, message: str = "") -> None:
        """Write how far a running job is, and what it waits for, if it does."""
        with self.transaction() as connection:
            connection.execute(
                "UPDATE job SET message = ?, progress = ? WHERE id = ? AND state = ?",
                (message, progress, job_id, StudyState.RUNNING),
            )

    def dismiss(self, job_id: str) -> Job:
        """Ask that the work on a job stops; asking twice is asking once.

        A study that was successful before its retry is so again: its data set is still there.

        Raises
        ------
        NotFound
            If the job is unknown.
        Conflict
            If it has come to its end already.
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

    def retry(self, job_id: str) -> Job:
        """Put a job that came to an end back in the queue, at its end.

        Raises
        ------
        NotFound
            If the job is unknown.
        Conflict
            If it is still waiting or running.
        """
        with self.transaction() as connection:
            job = self._read(connection, job_id)
            if not job.state.final:
                raise Conflict(f"the study is {job.state}: wait for its end or dismiss it first")
            connection.execute(
                "UPDATE job SET stood = state, state = ?, message = '', progress = 0, since = ?,"
                f" started = NULL, finished = NULL, turn = {NEXT_TURN} WHERE id = ?",
                (StudyState.ACCEPTED, time.time_ns(), job_id),
            )
            return self._read(connection, job_id)

    @contextmanager
    def transaction(
        self, begin: str = "BEGIN IMMEDIATE", mode: str = "rw"
    ) -> Iterator[sqlite3.Connection]:
        """Give a connection whose changes come at once or never; nobody else writes meanwhile."""
        try:
            # A file that is gone is not made anew behind the back of those who wrote in it.
            address = f"{self.path.resolve().as_uri()}?mode={mode}"
            connection = sqlite3.connect(address, uri=True, timeout=30.0, isolation_level=None)
            connection.row_factory = sqlite3.Row
            connection.text_factory = lambda text: text.decode(errors="replace")
            try:
                connection.execute(begin)
                with connection:
                    yield connection
            finally:
                connection.close()
        except sqlite3.DatabaseError as error:
            raise self._told(error) from error

    def _told(self, error: sqlite3.DatabaseError) -> Exception:
        """Return what an error of SQLite means for the queue."""
        code = getattr(error, "sqlite_errorcode", sqlite3.SQLITE_ERROR)
        if code in (sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR_WRITE):  # the latter past a quota
            return StoreFull(str(self.path.parent))
        damage = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_ERROR)
        if code & 0xFF in damage or not self.path.is_file():
            return QueueLost(f"{self.path.name} is gone or damaged ({error})")
        return OSError(f"{self.path.name} cannot be used now: {error}")

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
