"""The lock of a directory: one process computes there at a time, and one service works there."""

from __future__ import annotations

import fcntl
import os
import time
from contextlib import suppress
from pathlib import Path

from solver.files import descriptor_of
from studies.errors import StoreBusy


def lock(path: Path, busy: str, patience: float = 0.0, shared: bool = False) -> int:
    """Return the descriptor of a lock, valid until its last copy is closed.

    Parameters
    ----------
    path : the lock file, which contains the id of the process
    busy : what another one does in the directory, and what helps, for the error
    patience : how long to wait for another owner of the lock [s]
    shared : whether others may have it at the same time, if they share it too

    Raises
    ------
    StoreBusy
        if the lock is not released; with the id of the process
    NoFile
        if it is no regular file
    """
    descriptor = descriptor_of(path, os.O_RDWR | os.O_CREAT)
    deadline = time.monotonic() + patience
    while True:
        try:
            fcntl.flock(descriptor, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() < deadline:
                time.sleep(0.1)
                continue
            number = os.read(descriptor, 20).decode(errors="replace").strip()
            os.close(descriptor)
            who = f"another process (id {number})" if number.isdecimal() else "another process"
            raise StoreBusy(f"{path.parent}: {who} {busy}") from None
        with suppress(OSError):  # a full disk is reported when results are written
            os.ftruncate(descriptor, 0)
            os.write(descriptor, f"{os.getpid()}\n".encode())
        return descriptor
