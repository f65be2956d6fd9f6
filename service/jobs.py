"""The durable queue: one row of an SQLite file for each accepted study.

The state of a study is in its row alone. Routes write the requests of users into it (accept,
dismiss, retry); the runner reads these, and writes the results. After a crash the service reads
the remaining work from it. A queue that cannot be read is made again from the studies.
"""

from __future__ import annotations

import json
import sqlite3
import sys
import time
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from service.errors import Busy, Conflict, NotFound, QueueLost
from service.job import COLUMNS, Job, StudyState, job_of, row_of, wanted
from studies.storage.database import Database, WrongContent, check

ALL, DECLARED = ", ".join(COLUMNS), ", ".join(map(" ".join, COLUMNS.items()))
MARKS = ", ".join("?" * len(COLUMNS))
NEXT_TURN = "SELECT COALESCE(MAX(turn), 0) + 1 FROM job"
BEGUN = {"state": StudyState.RUNNING, "message": "", "finished": None}
SHARED = """SELECT 1 FROM run AS mine JOIN run AS theirs ON theirs.run = mine.run
    WHERE mine.job = ? AND theirs.job IN (SELECT value FROM json_each(?)) LIMIT 1"""
ALIKE = """SELECT 1 FROM job AS mine JOIN job AS theirs ON theirs.scene = mine.scene
    WHERE mine.id = ? AND theirs.id IN (SELECT value FROM json_each(?))
    AND mine.stage <> '' AND theirs.stage <> '' LIMIT 1"""
BOTH = (SHARED, ALIKE)
NOTES = 200
"""Number of notes that are kept of what happened to a job."""


FORM = 5
"""Form of the tables; a queue of another form is set aside, and made again from the studies."""

TABLES = (
    f"CREATE TABLE job ({DECLARED}, study TEXT NOT NULL, PRIMARY KEY (id))",
    "CREATE INDEX job_by_turn ON job (turn)",
    "CREATE INDEX job_by_state ON job (state, priority, turn)",
    """CREATE TABLE run (
    job TEXT NOT NULL, position INTEGER NOT NULL, run TEXT NOT NULL,
    PRIMARY KEY (job, position)
) WITHOUT ROWID""",
    "CREATE INDEX run_by_id ON run (run)",
    # what happened to studies
    "CREATE TABLE told (job TEXT NOT NULL, at TEXT NOT NULL, words TEXT NOT NULL)",
    "CREATE INDEX told_by_job ON told (job)",
    # the layout of the data set of a study that was shown last, and how many it had before
    "CREATE TABLE layout (job TEXT PRIMARY KEY, digest TEXT NOT NULL, turn INTEGER NOT NULL)",
    f"PRAGMA user_version = {FORM}",
)


class Jobs(Database):
    """The queue in the file ``path``; safe to use from many threads and processes.

    Methods raise `QueueLost` if the file is missing or damaged, `StoreFull` if the disk is full,
    and those that return or change one job `NotFound` if it is not there.

    Parameters
    ----------
    path : the file; created when the queue is opened
    longest : largest number of waiting studies; None for any number
    """

    def __init__(self, path: Path, longest: int | None = None) -> None:
        super().__init__(path, QueueLost, OSError)
        self.longest = longest
        new = not path.exists()
        with self.transaction("BEGIN IMMEDIATE", mode="rwc" if new else "rw") as connection:
            _prepare(connection, new)
            _check(connection)

    def check(self) -> None:
        """Raise `QueueLost` if the file is missing or damaged; the whole file is read."""
        with self.transaction("BEGIN") as connection:
            _check(connection)
        self.damaged = False

    def accept(
        self,
        job_id: str,
        study: dict[str, Any],
        runs: Iterable[str],
        priority: int = 0,
        size: float = 0.0,
        most: int = 0,
        stage: str = "",
    ) -> tuple[Job, bool]:
        """Return the job of this study, and whether it is new.

        ``runs`` are the ids of its runs in the order of its cases. They are stored, because a
        changed solver would give other ids, and the study would not find its runs. Those of a study
        that chooses them are not known yet: they are at most ``most``, and its ``stage`` tells how
        far it is. ``size`` is what it will write [bytes]. Raise `Busy` if too many wait.
        """
        with self.transaction() as connection:
            with suppress(NotFound):
                return self.read(connection, job_id), False
            (waiting,) = connection.execute(
                "SELECT COUNT(*) FROM job WHERE state = ?", (StudyState.ACCEPTED,)
            ).fetchone()
            if self.longest is not None and waiting >= self.longest:
                raise Busy(f"{waiting} studies wait already, the largest number: post it later")
            count = connection.executemany(
                "INSERT INTO run VALUES (?, ?, ?)",
                ((job_id, position, run) for position, run in enumerate(runs)),
            ).rowcount
            job = Job(
                id=job_id, name=study["name"], scene=study["scene"], size=max(count, most, 0),
                state=StudyState.ACCEPTED, message="", progress=0.0, since=0, stood="",
                priority=priority, submitted=now(), started=None, finished=None,
                turn=connection.execute(NEXT_TURN).fetchone()[0], bytes=float(size), stage=stage,
            )  # fmt: skip
            connection.execute(
                f"INSERT INTO job ({ALL}, study) VALUES ({MARKS}, ?)",
                [*row_of(job), json.dumps(study)],
            )
            tell(connection, job)
            return job, True

    def rows(self, query: str, *values: Any) -> list[Any]:
        """Return what a query finds."""
        with self.transaction("BEGIN") as connection:
            return connection.execute(query, values).fetchall()

    def told(self, job_id: str) -> list[tuple[str, str]]:
        """Return what happened to a job: times and words, the oldest first."""
        found = self.rows("SELECT at, words FROM told WHERE job = ? ORDER BY rowid", job_id)
        return [tuple(row) for row in found]

    def layout_turn(self, job_id: str, digest: str) -> int:
        """Return how many other layouts the data set of a job had before the one of a digest."""
        same = "SELECT turn FROM layout WHERE job = ? AND digest = ?"
        if known := self.rows(same, job_id, digest):  # also on a full disk
            return int(known[0]["turn"])
        with self.transaction() as connection:
            found = connection.execute(
                "INSERT INTO layout VALUES (?, ?, 0) ON CONFLICT (job) DO UPDATE SET"
                " turn = turn + (digest <> excluded.digest), digest = excluded.digest"
                " RETURNING turn",
                (job_id, digest),
            )
            return int(found.fetchone()["turn"])

    def get(self, job_id: str) -> Job:
        """Return one job."""
        with self.transaction("BEGIN") as connection:
            return self.read(connection, job_id)

    def study(self, job_id: str) -> dict[str, Any]:
        """Return the study of a job as ``Study.to_dict`` gave it."""
        with self.transaction("BEGIN") as connection:
            row = connection.execute("SELECT study FROM job WHERE id = ?", (job_id,)).fetchone()
            if row is None:
                raise unknown(job_id)
            return _content(row)

    def runs(self, job_id: str, limit: int = -1, offset: int = 0) -> list[str]:
        """Return the ids of a job's runs in the order of its cases, or one page of them."""
        page = "SELECT run FROM run WHERE job = ? AND position >= ? ORDER BY position LIMIT ?"
        return [row["run"] for row in self.rows(page, job_id, offset, limit)]

    def asked(self, job_id: str, runs: Collection[str], stage: str) -> None:
        """Add runs that a study has asked for, and write how far it is."""
        with self.transaction() as connection, suppress(NotFound):
            job = self.read(connection, job_id)
            rows = connection.execute("SELECT run FROM run WHERE job = ?", (job_id,))
            known = {row["run"] for row in rows}
            more = [run for run in runs if run not in known]
            connection.executemany(
                "INSERT INTO run VALUES (?, ?, ?)",
                ((job_id, position, run) for position, run in enumerate(more, len(known))),
            )
            put(connection, job, stage=stage)

    def searches(self) -> dict[str, str]:
        """Return, by id, the scene of each waiting or running job that chooses its runs."""
        choosing = "SELECT id, scene FROM job WHERE state IN (?, ?) AND stage <> ''"
        return dict(self.rows(choosing, StudyState.RUNNING, StudyState.ACCEPTED))

    def page(self, *, limit: int, offset: int, **which: Any) -> tuple[list[Job], int]:
        """Return a page of jobs, the latest first, and the number of all; filters: `wanted`."""
        where, values = wanted(**which)
        with self.transaction("BEGIN") as connection:
            (total,) = connection.execute(f"SELECT COUNT(*) FROM job {where}", values).fetchone()
            rows = connection.execute(
                f"SELECT {ALL} FROM job {where} ORDER BY turn DESC LIMIT ? OFFSET ?",
                (*values, limit, offset),
            )
            return [*map(job_of, rows)], total

    def ended(self) -> list[Job]:
        """Return the jobs that have ended, the oldest end first."""
        rows = self.rows(
            f"SELECT {ALL} FROM job WHERE finished IS NOT NULL ORDER BY finished, turn"
        )
        return [job for job in map(job_of, rows) if job.state.final]

    def states(self) -> dict[str, int]:
        """Return the number of jobs by state, without states that no job has."""
        return dict(self.rows("SELECT state, COUNT(*) FROM job GROUP BY state"))

    def promised(self, but: str) -> float:
        """Return what all studies but one will still write before they end [bytes].

        About half of a study are its runs; its data set is written at the end.
        """
        [(total,)] = self.rows(
            "SELECT TOTAL(bytes * (1 - progress / 200)) FROM job WHERE state IN (?, ?) AND id <> ?",
            StudyState.ACCEPTED, StudyState.RUNNING, but,
        )  # fmt: skip
        return float(total)

    def take(self, busy: Collection[str] = (), largest: int = sys.maxsize) -> Job | None:
        """Mark the next job as running, and return it; None if there is none.

        It has at most ``largest`` runs, and shares no run with ``busy``, the jobs that are being
        computed, so that common runs are computed once. Two that choose their runs in one scene
        may ask for the same ones: one of them waits.
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
                if any(connection.execute(each, (row["id"], others)).fetchone() for each in BOTH):
                    continue
                job = self.read(connection, row["id"])
                if job.state is StudyState.RUNNING:
                    return job
                return put(connection, job, **BEGUN, started=now())
            return None

    def resume(self, busy: Collection[str]) -> None:
        """Mark jobs as running, in a queue that was made again while processes work on them."""
        with self.transaction() as connection:
            for job_id in busy:
                with suppress(NotFound):
                    job = self.read(connection, job_id)
                    stood = str(job.state) if job.state.final else ""
                    put(connection, job, **BEGUN, stood=stood, progress=0.0, started=now())

    def waiting(self) -> dict[str, str]:
        """Return, by id, the reason for which running jobs wait, without those that do not."""
        waiting = "SELECT id, message FROM job WHERE state = ? AND message != ''"
        return dict(self.rows(waiting, StudyState.RUNNING))

    def finish(
        self,
        job_id: str,
        state: StudyState,
        message: str,
        standing: StudyState = StudyState.RUNNING,
    ) -> None:
        """Write the final state of a job; if it was dismissed meanwhile, it stays dismissed."""
        done = {"progress": 100.0} if state is StudyState.SUCCESSFUL else {}
        self._put_if(job_id, standing, state=state, message=message, finished=now(), **done)

    def note(self, job_id: str, progress: float, message: str = "") -> None:
        """Write the progress of a running job, and the reason for which it waits, if it does."""
        self._put_if(job_id, StudyState.RUNNING, message=message, progress=float(progress))

    def _put_if(self, job_id: str, standing: StudyState, **changes: Any) -> None:
        """Change a job that is in a state; one that is gone or in another state stays."""
        with self.transaction() as connection, suppress(NotFound):
            job = self.read(connection, job_id)
            if job.state is standing:
                put(connection, job, **changes)

    def dismiss(self, job_id: str) -> Job:
        """Request that the work on a job stops; a repeated request has no further effect.

        A study that was successful before its retry becomes successful again: its data set exists.
        Raise `Conflict` if it has ended already.
        """
        with self.transaction() as connection:
            job = self.read(connection, job_id)
            if job.state in (StudyState.SUCCESSFUL, StudyState.FAILED):
                raise Conflict(f"the study is {job.state} already: there is no work to stop")
            if job.state is StudyState.DISMISSED:
                return job
            stood = job.stood == StudyState.SUCCESSFUL
            state = StudyState.SUCCESSFUL if stood else StudyState.DISMISSED
            progress = 100.0 if stood else job.progress
            return put(connection, job, state=state, message="", progress=progress, finished=now())

    def retry(self, job_id: str, failed: bool = True) -> Job:
        """Put a job that has ended back into the queue, in the last place; else raise `Conflict`.

        Without ``failed`` only its missing runs are computed, and its data set is made again.
        """
        with self.transaction() as connection:
            job = self.read(connection, job_id)
            if not job.state.final:
                raise Conflict(f"the study is {job.state}: wait for its end or dismiss it first")
            return put(
                connection, job, stood=str(job.state), state=StudyState.ACCEPTED, message="",
                progress=0.0, since=time.time_ns() if failed else job.since, started=None,
                finished=None, turn=connection.execute(NEXT_TURN).fetchone()[0],
            )  # fmt: skip

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
    def read(connection: sqlite3.Connection, job_id: str) -> Job:
        """Return a job in the transaction of a connection; raise `NotFound`."""
        row = connection.execute(f"SELECT {ALL} FROM job WHERE id = ?", (job_id,)).fetchone()
        if row is None:
            raise unknown(job_id)
        return job_of(row)


def _prepare(connection: sqlite3.Connection, new: bool) -> None:
    """Create the tables of a new file; raise `WrongContent` if a file has not this form."""
    if new:
        for statement in TABLES:
            connection.execute(statement)
    (version,) = connection.execute("PRAGMA user_version").fetchone()
    if version != FORM:
        raise WrongContent(f"it has form {version}, not {FORM}")


def _check(connection: sqlite3.Connection) -> None:
    """Read the whole file; raise an error of the database if it is damaged."""
    connection.execute("SELECT 1 FROM job, run, told, layout LIMIT 1")
    check(connection)
    for row in connection.execute(f"SELECT {ALL}, study FROM job"):
        job_of(row)
        _content(row)


def _content(row: sqlite3.Row) -> dict[str, Any]:
    """Return the study of a row; raise `WrongContent` if its text is damaged."""
    try:
        study: dict[str, Any] = json.loads(row["study"])
    except ValueError as error:
        raise WrongContent(f"the text of a study is damaged: {error}") from None
    return study


def put(connection: sqlite3.Connection, job: Job, **changes: Any) -> Job:
    """Change a job in the transaction of a connection, and return it."""
    before, job = job, replace(job, **changes)
    if (job.state, job.message) != (before.state, before.message):
        tell(connection, job)
    connection.execute(f"UPDATE job SET ({ALL}) = ({MARKS}) WHERE id = ?", [*row_of(job), job.id])
    return job


def forget(connection: sqlite3.Connection, job_id: str) -> None:
    """Delete a job, and all that is known of it, in the transaction of a connection."""
    for table in ("run", "told", "layout"):
        connection.execute(f"DELETE FROM {table} WHERE job = ?", (job_id,))
    connection.execute("DELETE FROM job WHERE id = ?", (job_id,))


def tell(connection: sqlite3.Connection, job: Job) -> None:
    """Note the state of a job and the reason for it; the latest notes stay."""
    words = f"{job.state}: {job.message}" if job.message else str(job.state)
    connection.execute("INSERT INTO told VALUES (?, ?, ?)", (job.id, now(), words))
    connection.execute(
        "DELETE FROM told WHERE job = ? AND rowid NOT IN"
        " (SELECT rowid FROM told WHERE job = ? ORDER BY rowid DESC LIMIT ?)",
        (job.id, job.id, NOTES),
    )


def unknown(job_id: str) -> NotFound:
    """Return the error for an id that no study has."""
    return NotFound(f"no study has the id {job_id}")


def now() -> str:
    """Return the time in UTC as ISO 8601, to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds")
