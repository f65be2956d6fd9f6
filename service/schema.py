"""Tables of the queue."""

from __future__ import annotations

import sqlite3

from studies.storage.database import WrongContent

VERSION = 5
"""Form of the tables; a queue of another form is set aside, and made again from the studies."""

TABLES = (
    """CREATE TABLE job (
    id TEXT PRIMARY KEY,
    name TEXT NOT NULL,
    scene TEXT NOT NULL,
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
    bytes REAL NOT NULL,
    stage TEXT NOT NULL,
    study TEXT NOT NULL
)""",
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
    f"PRAGMA user_version = {VERSION}",
)


def prepare(connection: sqlite3.Connection, new: bool) -> None:
    """Create the tables of a new file; raise `WrongContent` if a file has not this form."""
    if new:
        for statement in TABLES:
            connection.execute(statement)
    (version,) = connection.execute("PRAGMA user_version").fetchone()
    if version != VERSION:
        raise WrongContent(f"it has form {version}, not {VERSION}")
