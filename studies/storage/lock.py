"""The lock of a directory: one process writes there at a time."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TextIO

from studies.errors import StoreBusy


@contextmanager
def locked(directory: Path, file: TextIO) -> Iterator[None]:
    """Lock a directory by its lock file, which contains the id of the process.

    Raises
    ------
    StoreBusy
        if another process has the lock; with its process id
    """
    with file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            file.seek(0)
            number = file.read(20).strip()
            who = f"another process (id {number})" if number.isdecimal() else "another process"
            raise StoreBusy(
                f"{directory}: {who} computes here; "
                "wait until it has ended, or name another directory"
            ) from None
        with suppress(OSError):  # a full disk is reported when results are written
            os.ftruncate(file.fileno(), 0)
            os.write(file.fileno(), f"{os.getpid()}\n".encode())
        yield
