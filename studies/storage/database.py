"""An SQLite file: damage is found, told by one error, and remembered until the file is mended."""

from __future__ import annotations

import sqlite3
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from solver.files import special
from studies.errors import StoreFull

_WAIT = 30.0
"""Seconds a connection waits for another one's lock."""
_FULL = (sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR_WRITE)
"""A write past a quota or past the allowed size of a file is an I/O error to SQLite."""
_DAMAGE = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_ERROR)
"""A plain error is unexpected content, such as text that is not JSON."""


class WrongContent(ValueError):
    """A table or a row is not what was written."""


class Database:
    """An SQLite file; safe to use from many threads and processes.

    Parameters
    ----------
    path : the file
    lost, busy : make the errors that are raised if the file is missing or damaged, and if another
        process locks it for too long; `StoreFull` is raised if the disk is full

    Attributes
    ----------
    damaged : whether damage has been found here, since the file was mended
    """

    def __init__(
        self, path: Path, lost: Callable[[str], Exception], busy: Callable[[str], Exception]
    ) -> None:
        self.path, self.damaged = path, False
        self._lost, self._busy = lost, busy

    @contextmanager
    def connection(self, begin: str, mode: str) -> Iterator[sqlite3.Connection]:
        """Give a connection for one transaction; the mode is ``memory`` or that of the file."""
        address = f"{self.path.resolve().as_uri()}?mode={mode}"
        try:
            for file in (self.path, self.path.with_name(f"{self.path.name}-journal")):
                if kind := special(file):  # SQLite would wait for a pipe
                    raise WrongContent(f"{file.name} is {kind}")
            with closing(
                sqlite3.connect(
                    ":memory:" if mode == "memory" else address,
                    uri=True,
                    timeout=_WAIT,
                    isolation_level=None,
                )
            ) as connection:
                connection.execute(begin)
                with connection:
                    yield connection
        except (sqlite3.ProgrammingError, sqlite3.IntegrityError):
            raise  # a programming error, not damage of the file
        except (sqlite3.DatabaseError, WrongContent) as error:
            raise self._translated(error, mode) from error

    def _translated(self, error: Exception, mode: str) -> Exception:
        code = getattr(error, "sqlite_errorcode", sqlite3.SQLITE_CORRUPT)
        if code in _FULL:
            return StoreFull(str(self.path.parent))
        to_create = mode == "rwc" and not self.path.exists()  # and it could not be created
        if code & 0xFF in _DAMAGE or not (to_create or self.path.is_file()):
            self.damaged = True
            return self._lost(f"{self.path.name} is missing or damaged ({error})")
        reason = f"{self.path.name} cannot be used now: {error}"
        busy = code & 0xFF in (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED)
        return self._busy(reason) if busy else OSError(reason)


def checksum(values: Sequence[Any]) -> int:
    """Return a checksum of the values of a row as SQLite gives them back; it has none itself."""
    return zlib.crc32(repr(list(values)).encode("utf-8", "backslashreplace"))


def check(connection: sqlite3.Connection) -> None:
    """Read the whole file; raise `WrongContent`, with the first finding, if it is damaged."""
    for (finding,) in connection.execute("PRAGMA integrity_check(1)"):
        if finding != "ok":
            raise WrongContent(finding)
