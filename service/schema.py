"""Tables of the queue, and the conversion of a queue of an earlier form."""

from __future__ import annotations

import sqlite3

from service.job import COLUMNS
from studies.errors import StudyError
from studies.storage.database import checksum

VERSION = 4

JOB = """CREATE TABLE job (
    id TEXT PRIMARY KEY,
    name TEXT NOT NULL,
    scene TEXT NOT NULL,
    study TEXT NOT NULL,
    size INTEGER NOT NULL,
    state TEXT NOT NULL,
    message TEXT NOT NULL,
    progress REAL NOT NULL,
    since INTEGER NOT NULL,
    stood TEXT NOT NULL,
    priority INTEGER NOT NULL,
    submitted TEXT NOT NULL,
    started TEXT,
    finished TEXT,
    turn INTEGER NOT NULL,
    digest INTEGER,
    bytes REAL NOT NULL,
    stage TEXT NOT NULL,
    checksum INTEGER
)"""
RUN = """CREATE TABLE IF NOT EXISTS run (
    job TEXT NOT NULL, position INTEGER NOT NULL, run TEXT NOT NULL,
    PRIMARY KEY (job, position)
) WITHOUT ROWID"""
TOLD = (
    "CREATE TABLE IF NOT EXISTS told (job TEXT NOT NULL, at TEXT NOT NULL, words TEXT NOT NULL)",
    "CREATE INDEX IF NOT EXISTS told_by_job ON told (job)",
)
"""What happened to studies."""
LAYOUT = """CREATE TABLE IF NOT EXISTS layout (
    job TEXT PRIMARY KEY, digest TEXT NOT NULL, turn INTEGER NOT NULL
)"""
"""The layout of the data set of a study that was shown last, and how many it had before."""
ADDED_TABLES = (*TOLD, LAYOUT)
"""A queue without them has the same form: they are added."""
REST = (
    "CREATE INDEX job_by_turn ON job (turn)",
    "CREATE INDEX job_by_state ON job (state, priority, turn)",
    "CREATE INDEX IF NOT EXISTS run_by_id ON run (run)",
    f"PRAGMA user_version = {VERSION}",
)

ADDED = {
    "name": "json_extract(study, '$.name')",
    "scene": "json_extract(study, '$.scene')",
    "since": "again * 1000000000 * CAST(strftime('%s', 'now') AS INTEGER)",
    "stood": "''",
    "priority": "0",
    "digest": "checksum(study)",
    "bytes": "0.0",
    "stage": "''",
}
"""Columns that earlier forms have not, and what takes their place. The first had no table of runs
but a text of all its runs in each row, and was the only one without ``since``."""


def prepare(connection: sqlite3.Connection, new: bool) -> None:
    """Create the tables of a new file; convert those of an older file to the current form.

    Raises
    ------
    sqlite3.DatabaseError
        If the file is damaged, empty, or not a queue.
    StudyError
        If a later version of the service has made it.
    """
    (version,) = connection.execute("PRAGMA user_version").fetchone()
    known = {row[0] for row in connection.execute("SELECT name FROM sqlite_master")}
    if version == VERSION and {"job", "run"} <= known:
        for statement in ADDED_TABLES:
            connection.execute(statement)
        return
    if version > VERSION:
        allowed = f"must be of form {VERSION}: a later version of the service has made it"
        raise StudyError("jobs.sqlite", f"form {version}", allowed)
    if not new and "job" not in known:
        raise sqlite3.DatabaseError("it holds no queue")
    statements = [JOB, RUN, *ADDED_TABLES, *REST]
    if "job" in known:
        statements = [
            "ALTER TABLE job RENAME TO old",
            JOB,
            RUN,
            *ADDED_TABLES,
            *_copied(connection),
            *REST,
        ]
    connection.create_function("checksum", -1, lambda *values: checksum(values))
    for statement in statements:
        connection.execute(statement)


def _copied(connection: sqlite3.Connection) -> list[str]:
    """Return what copies the rows of a table of an earlier form; a damaged row stays damaged."""
    there = [row["name"] for row in connection.execute("PRAGMA table_info(job)")]
    before = ", ".join(name for name in COLUMNS if name in there)
    values = ", ".join(name if name in there else ADDED[name] for name in COLUMNS)
    right = f"checksum({before}) = checksum" if "checksum" in there else "TRUE"
    names = ", ".join(COLUMNS)
    rows = f"INSERT INTO job ({names}, study, checksum) SELECT {values}, study, {right} FROM old"
    summed = f"UPDATE job SET checksum = checksum({names}) WHERE checksum = 1"
    runs = "INSERT INTO run SELECT old.id, each.key, each.value FROM old, json_each(runs) AS each"
    return [rows, summed, *([runs] if "runs" in there else []), "DROP TABLE old"]
