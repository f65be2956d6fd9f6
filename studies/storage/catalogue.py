"""The catalogue: every run of a directory in one table that can be queried.

The process that computes is the only writer. Readers, in other threads or processes, open
their own short connections. They may write, for one reason: the first to come after a writer was
killed undoes what that left half done. The journal is SQLite's rollback journal: unlike the
write-ahead log it needs no memory shared between machines, so the directory may lie on a network
volume.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

_COLUMNS = (
    "id", "scene", "status", "message", "parameters", "scalars", "path", "created",
    "cpu_seconds", "solver_source",
)  # fmt: skip
_JSON = ("parameters", "scalars")
_WAIT = 30.0
"""Seconds a connection waits for another one's lock."""

_TABLE = """runs (
    id TEXT PRIMARY KEY, scene TEXT NOT NULL, status TEXT NOT NULL, message TEXT NOT NULL,
    parameters TEXT NOT NULL, scalars TEXT NOT NULL, path TEXT NOT NULL, created TEXT NOT NULL,
    cpu_seconds REAL, solver_source TEXT NOT NULL
)"""

Row = dict[str, Any]


class Catalogue:
    """Rows of runs in an SQLite file.

    Parameters
    ----------
    path : the file; it is made by the first write
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
                f"{where} ORDER BY created, id LIMIT ? OFFSET ?",
                [*values, limit, offset],
            )
        return page, total

    def rows(self, run_ids: Iterable[str]) -> dict[str, Row]:
        """Return, by id, the rows of those of `run_ids` that are known."""
        wanted = json.dumps(list(run_ids))
        with self._reading() as connection:
            found = _select(connection, "WHERE id IN (SELECT value FROM json_each(?))", [wanted])
        return {row["id"]: row for row in found}

    def having(self, status: str, run_ids: Iterable[str]) -> set[str]:
        """Return those of `run_ids` that have this status."""
        wanted = json.dumps(list(run_ids))
        with self._reading() as connection:
            found = connection.execute(
                "SELECT id FROM runs WHERE id IN (SELECT value FROM json_each(?)) AND status = ?",
                [wanted, status],
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
        marks = ", ".join("?" for _ in _COLUMNS)
        values = [[_stored(row, column) for column in _COLUMNS] for row in rows]
        with self._writing() as connection:
            connection.executemany(f"INSERT OR REPLACE INTO runs VALUES ({marks})", values)

    def remove(self, run_ids: Iterable[str]) -> None:
        """Forget runs."""
        with self._writing() as connection:
            connection.executemany("DELETE FROM runs WHERE id = ?", [[each] for each in run_ids])

    def ids(self) -> set[str]:
        """Return the ids of all runs."""
        with self._reading() as connection:
            return {row[0] for row in connection.execute("SELECT id FROM runs")}

    @contextmanager
    def _reading(self) -> Iterator[sqlite3.Connection]:
        """Give a connection that sees one state; nothing written yet is a table without rows."""
        there = self.path.exists()
        address = f"{self.path.resolve().as_uri()}?mode=rw" if there else ":memory:"
        with _connection(address, "BEGIN") as connection:
            tables = connection.execute("SELECT 1 FROM sqlite_master WHERE name = 'runs'")
            if tables.fetchone() is None:
                connection.execute(f"CREATE TEMP TABLE {_TABLE}")
            yield connection

    @contextmanager
    def _writing(self) -> Iterator[sqlite3.Connection]:
        """Give a connection whose changes, the table itself included, come at once or never."""
        with _connection(self.path.resolve().as_uri(), "BEGIN IMMEDIATE") as connection, connection:
            connection.execute(f"CREATE TABLE IF NOT EXISTS {_TABLE}")
            connection.execute("CREATE INDEX IF NOT EXISTS runs_by_scene ON runs (scene, status)")
            yield connection


@contextmanager
def _connection(address: str, begin: str) -> Iterator[sqlite3.Connection]:
    connection = sqlite3.connect(address, uri=True, timeout=_WAIT, isolation_level=None)
    with closing(connection):
        connection.execute(begin)
        yield connection


def _select(connection: sqlite3.Connection, rest: str, values: list[Any]) -> list[Row]:
    found = connection.execute(f"SELECT {', '.join(_COLUMNS)} FROM runs {rest}", values)
    return [_row(row) for row in found]


def _stored(row: Mapping[str, Any], column: str) -> Any:
    return json.dumps(row[column]) if column in _JSON else row[column]


def _row(values: tuple[Any, ...]) -> Row:
    row = dict(zip(_COLUMNS, values, strict=True))
    return row | {column: json.loads(row[column]) for column in _JSON}
