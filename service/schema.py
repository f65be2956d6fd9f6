"""Tables of the queue, and the conversion of a queue of an earlier form."""

from __future__ import annotations

import sqlite3

from service.job import COLUMNS
from studies.errors import StudyError
from studies.storage.database import checksum

VERSION = 3

TABLES = (
    """CREATE TABLE job (
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
        stage TEXT NOT NULL DEFAULT '',
        checksum INTEGER
    )""",
    "CREATE INDEX job_by_turn ON job (turn)",
    "CREATE INDEX job_by_state ON job (state, priority, turn)",
    """CREATE TABLE run (
        job TEXT NOT NULL, position INTEGER NOT NULL, run TEXT NOT NULL,
        PRIMARY KEY (job, position)
    ) WITHOUT ROWID""",
    "CREATE INDEX run_by_id ON run (run)",
    f"PRAGMA user_version = {VERSION}",
)

FIRST_FORM = (
    """INSERT INTO job SELECT id, json_extract(study, '$.name'), json_extract(study, '$.scene'),
        study, size, state, message, progress, again * 1000000000
        * CAST(strftime('%s', 'now') AS INTEGER), '', 0, submitted, started, finished, turn,
        NULL, '', NULL FROM first""",
    """INSERT INTO run SELECT first.id, each.key, each.value
        FROM first, json_each(first.runs) AS each""",
    "DROP TABLE first",
)
"""Copies the rows of the first form, in which a row held all its runs as one text."""


SECOND_FORM = (
    "ALTER TABLE job ADD COLUMN digest INTEGER",
    "ALTER TABLE job ADD COLUMN checksum INTEGER",
)
"""Adds the columns that the second form, the first with rows of runs, has not."""

STAGE = "ALTER TABLE job ADD COLUMN stage TEXT NOT NULL DEFAULT ''"
"""Adds the column that the third form has not."""

CHECKSUMS = (
    "UPDATE job SET digest = checksum(study)",
    f"UPDATE job SET checksum = checksum({', '.join(COLUMNS)})",
)

THIRD_FORM = (
    STAGE,
    f"""UPDATE job SET checksum = checksum({", ".join(COLUMNS)})
        WHERE checksum = checksum({", ".join(each for each in COLUMNS if each != "stage")})""",
)
"""Adds it; a row that was damaged stays so."""


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
        return
    if version > VERSION:
        allowed = f"must be of form {VERSION}: a later version of the service has made it"
        raise StudyError("jobs.sqlite", f"form {version}", allowed)
    if not new and "job" not in known:
        raise sqlite3.DatabaseError("it holds no queue")
    connection.create_function("checksum", -1, lambda *values: checksum(values))
    if version == 2:
        statements: tuple[str, ...] = (*THIRD_FORM, TABLES[-1])
    elif "run" in known:
        statements = (*SECOND_FORM, STAGE, TABLES[-1], *CHECKSUMS)
    elif "job" in known:
        statements = ("ALTER TABLE job RENAME TO first", *TABLES, *FIRST_FORM, *CHECKSUMS)
    else:
        statements = TABLES
    for statement in statements:
        connection.execute(statement)
