"""The catalogue: every run of a directory in one table that can be queried.

The process that computes is the only writer. Readers, in other threads or processes, open their own
short connections. They write only in one case: after a writer was killed, the first reader rolls
its unfinished transaction back. The journal is SQLite's rollback journal: unlike the write-ahead
log it needs no memory shared between machines, so the directory may be on a network volume. SQLite
has no checksums, so each row has its own.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import Any

from studies.errors import CatalogueDamaged, StoreBusy
from studies.storage.database import Database, WrongContent, check, checksum

_COLUMNS = (
    "id", "scene", "status", "message", "parameters", "scalars", "path", "created",
    "cpu_seconds", "solver_source", "keep", "size", "modified",
)  # fmt: skip
_ALL = ", ".join((*_COLUMNS, "checksum"))
_JSON = ("parameters", "scalars")

_TABLE = """runs (
    id TEXT PRIMARY KEY, scene TEXT NOT NULL, status TEXT NOT NULL, message TEXT NOT NULL,
    parameters TEXT NOT NULL, scalars TEXT NOT NULL, path TEXT NOT NULL, created TEXT NOT NULL,
    cpu_seconds REAL, solver_source TEXT NOT NULL, keep TEXT NOT NULL, size INTEGER,
    modified INTEGER, checksum INTEGER NOT NULL
)"""
_INDICES = {"runs_by_time": "created, id", "runs_by_scene": "scene, status"}

BATCH = 500
"""Number of runs whose rows are in memory, or are written, at a time."""

Row = dict[str, Any]


class Catalogue(Database):
    """Rows of runs in an SQLite file.

    Every method raises `CatalogueDamaged` if the file is damaged, `StoreFull` if the disk is full,
    and `StoreBusy` if another process locks the file for too long.

    Parameters
    ----------
    path : the file; the first write creates it
    of : directory of the files it lists: where there are some, a missing catalogue is damage
    """

    def __init__(self, path: Path, of: Path | None = None) -> None:
        again = "it is made again by the service, or when a study is computed here"
        super().__init__(path, lambda reason: CatalogueDamaged(f"{reason}; {again}"), StoreBusy)
        self.of = of

    def runs(
        self,
        scene: str | None = None,
        status: str | None = None,
        limit: int = 100,
        offset: int = 0,
        **parameters: Any,
    ) -> tuple[list[Row], int]:
        """Return one page of the runs that match, and how many match in all.

        Parameters
        ----------
        scene, status : wanted values; None for any
        limit, offset : the page, in order of creation
        **parameters : wanted parameter values, such as ``friction=0.3``
        """
        conditions = {"scene = ?": scene, "status = ?": status}
        clauses = [clause for clause, value in conditions.items() if value is not None]
        values = [value for value in conditions.values() if value is not None]
        for name, value in parameters.items():
            clauses.append("json_extract(parameters, ?) = ?")
            values += [f"$.{json.dumps(name)}", value]
        where = f"WHERE {' AND '.join(clauses)}" if clauses else ""
        with self._reading() as connection:
            (total,) = connection.execute(f"SELECT count(*) FROM runs {where}", values).fetchone()
            page = _select(
                connection,
                f"WHERE rowid IN (SELECT rowid FROM runs {where} ORDER BY created, id "
                "LIMIT ? OFFSET ?) ORDER BY created, id",
                [*values, limit, offset],
            )
        return page, total

    def rows(self, run_ids: Iterable[str]) -> dict[str, Row]:
        """Return, by id, the rows of those `run_ids` that the catalogue has."""
        wanted = json.dumps(list(run_ids))
        with self._reading() as connection:
            found = _select(connection, "WHERE id IN (SELECT value FROM json_each(?))", [wanted])
        return {row["id"]: row for row in found}

    def each(self, run_ids: Iterable[str]) -> Iterator[tuple[str, Row | None]]:
        """Yield ids of runs with their rows, None for one that the catalogue has not."""
        ids = iter(run_ids)
        while some := list(islice(ids, BATCH)):
            rows = self.rows(some)
            yield from ((run_id, rows.get(run_id)) for run_id in some)

    def counts(self, run_ids: Iterable[str] | None = None) -> dict[str, int]:
        """Return the number of runs by status, of all or of `run_ids`."""
        where, values = "", []
        if run_ids is not None:
            where, values = "WHERE id IN (SELECT value FROM json_each(?))", [list(run_ids)]
        with self._reading() as connection:
            found = connection.execute(
                f"SELECT status, count(*) FROM runs {where} GROUP BY status",
                [json.dumps(each) for each in values],
            )
            return dict(found.fetchall())

    def having(self, statuses: Iterable[str], run_ids: Iterable[str], keep: str = "") -> set[str]:
        """Return those `run_ids` with one of the `statuses` and this value of ``keep``."""
        wanted, these = json.dumps(list(run_ids)), json.dumps(list(statuses))
        with self._reading() as connection:
            found = connection.execute(
                "SELECT id FROM runs WHERE id IN (SELECT value FROM json_each(?)) "
                "AND status IN (SELECT value FROM json_each(?)) AND ? IN ('', keep)",
                [wanted, these, keep],
            )
            return {row[0] for row in found}

    def figures(
        self, scene: str, status: str, names: Sequence[str], limit: int
    ) -> list[tuple[Any, ...]]:
        """Return figures of the last runs of a scene, a row each; None for an absent one."""
        columns = ", ".join("json_extract(scalars, ?)" for _ in names)
        with self._reading() as connection:
            return connection.execute(
                f"SELECT {columns} FROM runs WHERE scene = ? AND status = ? "
                "ORDER BY rowid DESC LIMIT ?",
                [*(f"$.{name}" for name in names), scene, status, limit],
            ).fetchall()

    def put(self, rows: Iterable[Mapping[str, Any]]) -> None:
        """Insert or replace rows in one transaction."""
        marks = ", ".join("?" for _ in (*_COLUMNS, "checksum"))
        values = [_stored(row) for row in rows]
        with self._writing() as connection:
            connection.executemany(f"INSERT OR REPLACE INTO runs VALUES ({marks})", values)

    def remove(self, run_ids: Iterable[str]) -> None:
        """Delete the rows of runs."""
        with self._writing() as connection:
            connection.executemany("DELETE FROM runs WHERE id = ?", [[each] for each in run_ids])

    def stamps(self) -> dict[str, tuple[int | None, int | None]]:
        """Return, by id, the recorded length and time of change [ns] of each run's file.

        The whole catalogue is read and compared with its checksums, which detects damage.
        """
        with self._reading() as connection:
            check(connection)
            every = map(_values, connection.execute(f"SELECT {_ALL} FROM runs"))
            return {values[0]: (values[-2], values[-1]) for values in every}

    @contextmanager
    def _reading(self) -> Iterator[sqlite3.Connection]:
        """Give a connection that sees one state; without a file the table is empty."""
        mode = "rw" if self.path.exists() else "memory"
        with self.connection("BEGIN", mode) as connection:
            if not self._made(connection):
                connection.execute(f"CREATE TEMP TABLE {_TABLE}")
            yield connection

    @contextmanager
    def _writing(self) -> Iterator[sqlite3.Connection]:
        """Give a connection for one transaction, which creates the table if needed."""
        with self.connection("BEGIN IMMEDIATE", "rwc") as connection:
            if not self._made(connection):
                connection.execute(f"CREATE TABLE {_TABLE}")
            for name, columns in _INDICES.items():
                connection.execute(f"CREATE INDEX IF NOT EXISTS {name} ON runs ({columns})")
            yield connection

    def _made(self, connection: sqlite3.Connection) -> bool:
        """Whether there is a table; raise `WrongContent` if it is lost, or of another version."""
        found = connection.execute("SELECT sql FROM sqlite_master WHERE name = 'runs'").fetchone()
        if found and found[0] != f"CREATE TABLE {_TABLE}":
            raise WrongContent("it has the columns of another version")
        if not found and self.of and any(self.of.glob("*.nc")):
            raise WrongContent("it is missing")
        return bool(found)


def _select(connection: sqlite3.Connection, rest: str, values: list[Any]) -> list[Row]:
    return [_row(row) for row in connection.execute(f"SELECT {_ALL} FROM runs {rest}", values)]


def _stored(row: Mapping[str, Any]) -> list[Any]:
    """Return the values of a row as SQLite gives them back, and their checksum."""
    seconds = row["cpu_seconds"]
    plain = {"cpu_seconds": seconds if seconds is None else float(seconds)}
    texts = {column: json.dumps(row[column]) for column in _JSON}
    values = [(dict(row) | plain | texts).get(column) for column in _COLUMNS]
    return [*values, checksum(values)]


def _row(stored: Sequence[Any]) -> Row:
    row = dict(zip(_COLUMNS, _values(stored), strict=True))
    return row | {column: json.loads(row[column]) for column in _JSON}


def _values(stored: Sequence[Any]) -> list[Any]:
    """Return the values of a row that agree with their checksum."""
    *values, known = stored
    if checksum(values) != known:
        raise WrongContent(f"the row of run {values[0]!r} is damaged")
    return values
