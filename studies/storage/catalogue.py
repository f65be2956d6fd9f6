"""The catalogue: every run of a directory in one table that can be queried.

The process that computes is the only writer. Readers, in other threads or processes, open their own
short connections. They write only in one case: after a writer was killed, the first reader rolls
its unfinished transaction back. The journal is SQLite's rollback journal: unlike the write-ahead
log it needs no memory shared between machines, so the directory may be on a network volume. SQLite
has no checksums, so each row has its own.
"""

from __future__ import annotations

import json
import os
import sqlite3
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from studies.errors import CatalogueDamaged, StoreBusy, StoreFull

_COLUMNS = (
    "id", "scene", "status", "message", "parameters", "scalars", "path", "created",
    "cpu_seconds", "solver_source", "keep", "size", "modified",
)  # fmt: skip
_ALL = ", ".join((*_COLUMNS, "checksum"))
_JSON = ("parameters", "scalars")
_WAIT = 30.0
"""Seconds a connection waits for another one's lock."""

_TABLE = """runs (
    id TEXT PRIMARY KEY, scene TEXT NOT NULL, status TEXT NOT NULL, message TEXT NOT NULL,
    parameters TEXT NOT NULL, scalars TEXT NOT NULL, path TEXT NOT NULL, created TEXT NOT NULL,
    cpu_seconds REAL, solver_source TEXT NOT NULL, keep TEXT NOT NULL, size INTEGER,
    modified INTEGER, checksum INTEGER NOT NULL
)"""
_INDICES = {"runs_by_time": "created, id", "runs_by_scene": "scene, status"}

Row = dict[str, Any]


class Catalogue:
    """Rows of runs in an SQLite file.

    Every method raises `CatalogueDamaged` if the file is damaged, `StoreFull` if the disk is full,
    and `StoreBusy` if another process locks the file for too long.

    Parameters
    ----------
    path : the file; the first write creates it
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    def run(self, run_id: str) -> Row | None:
        """Return the row of one run, or None."""
        return self.rows([run_id]).get(run_id)

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

    def changes(self) -> tuple[int, int]:
        """Return a value that changes with every change of the catalogue: file and change counter.

        SQLite counts the transactions in the head of its file: https://sqlite.org/fileformat.html,
        section 1.3.7.
        """
        try:
            with self.path.open("rb") as file:
                file.seek(24)
                return os.fstat(file.fileno()).st_ino, int.from_bytes(file.read(4))
        except OSError:
            return 0, 0

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

    def ids(self) -> set[str]:
        """Return the ids of all runs."""
        with self._reading() as connection:
            return {row[0] for row in connection.execute("SELECT id FROM runs")}

    def stamps(self) -> dict[str, tuple[int | None, int | None]]:
        """Return, by id, the recorded length and time of change [ns] of each run's file.

        The whole catalogue is read and compared with its checksums, which detects damage.
        """
        with self._reading() as connection:
            for (finding,) in connection.execute("PRAGMA integrity_check(1)"):
                if finding != "ok":
                    raise CatalogueDamaged(f"{self.path.name} is damaged: {finding}")
            every = map(_values, connection.execute(f"SELECT {_ALL} FROM runs"))
            return {values[0]: (values[-2], values[-1]) for values in every}

    @contextmanager
    def _reading(self) -> Iterator[sqlite3.Connection]:
        """Give a connection that sees one state; without a file the table is empty."""
        there = self.path.exists()
        address = f"{self.path.resolve().as_uri()}?mode=rw" if there else ":memory:"
        with self._connection(address, "BEGIN") as connection:
            if not self._made(connection):
                connection.execute(f"CREATE TEMP TABLE {_TABLE}")
            yield connection

    @contextmanager
    def _writing(self) -> Iterator[sqlite3.Connection]:
        """Give a connection for one transaction, which creates the table if needed."""
        address = self.path.resolve().as_uri()
        with self._connection(address, "BEGIN IMMEDIATE") as connection, connection:
            if not self._made(connection):
                connection.execute(f"CREATE TABLE {_TABLE}")
            for name, columns in _INDICES.items():
                connection.execute(f"CREATE INDEX IF NOT EXISTS {name} ON runs ({columns})")
            yield connection

    def _made(self, connection: sqlite3.Connection) -> bool:
        """Whether there is a table; raise `CatalogueDamaged` for one of another version."""
        found = connection.execute("SELECT sql FROM sqlite_master WHERE name = 'runs'").fetchone()
        if found and found[0] != f"CREATE TABLE {_TABLE}":
            raise CatalogueDamaged(f"{self.path.name} has the columns of another version")
        return bool(found)

    @contextmanager
    def _connection(self, address: str, begin: str) -> Iterator[sqlite3.Connection]:
        try:
            connection = sqlite3.connect(address, uri=True, timeout=_WAIT, isolation_level=None)
            with closing(connection):
                connection.execute(begin)
                yield connection
        except (sqlite3.ProgrammingError, sqlite3.IntegrityError):
            raise  # a programming error, not damage of the file
        except (sqlite3.DatabaseError, _WrongRow) as error:
            raise self._translated(error) from error

    def _translated(self, error: Exception) -> Exception:
        """Return the error of this package for an error of SQLite."""
        reason = f"{self.path.name} cannot be used: {error}"
        # A write past a quota or past the allowed size of a file is an I/O error to SQLite.
        full = {sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR_WRITE}
        code = getattr(error, "sqlite_errorcode", sqlite3.SQLITE_CORRUPT)
        if code in full:
            return StoreFull(str(self.path.parent))
        if code & 0xFF in (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED):
            return StoreBusy(f"{reason}; another process holds it")
        # A plain error is unexpected content, such as text that is not JSON.
        damaged = {sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_ERROR}
        if code & 0xFF in damaged or self.path.is_dir():
            return CatalogueDamaged(f"{reason}; it is made again when a study is computed here")
        return OSError(reason)


class _WrongRow(ValueError):
    """A row does not agree with its checksum."""


def _select(connection: sqlite3.Connection, rest: str, values: list[Any]) -> list[Row]:
    return [_row(row) for row in connection.execute(f"SELECT {_ALL} FROM runs {rest}", values)]


def _stored(row: Mapping[str, Any]) -> list[Any]:
    """Return the values of a row as SQLite gives them back, and their checksum."""
    seconds = row["cpu_seconds"]
    plain = {"cpu_seconds": seconds if seconds is None else float(seconds)}
    texts = {column: json.dumps(row[column]) for column in _JSON}
    values = [(dict(row) | plain | texts).get(column) for column in _COLUMNS]
    return [*values, _checksum(values)]


def _row(stored: Sequence[Any]) -> Row:
    row = dict(zip(_COLUMNS, _values(stored), strict=True))
    return row | {column: json.loads(row[column]) for column in _JSON}


def _values(stored: Sequence[Any]) -> list[Any]:
    """Return the values of a row that agree with their checksum."""
    *values, checksum = stored
    if _checksum(values) != checksum:
        raise _WrongRow(f"the row of run {values[0]!r} is damaged")
    return values


def _checksum(values: Sequence[Any]) -> int:
    return zlib.crc32(repr(values).encode("utf-8", "backslashreplace"))
