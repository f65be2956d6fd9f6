"""One service for each data directory."""

from __future__ import annotations

import fcntl
import os
import time
from pathlib import Path


class DirectoryInUse(RuntimeError):
    """Another service, or a process it started, still uses the directory."""


def lock_directory(directory: Path, patience: float) -> int:
    """Return the descriptor of a lock on ``directory``, valid until its last copy is closed.

    Parameters
    ----------
    directory : the data directory; created if missing
    patience : how long to wait for another owner of the lock [s]

    Raises
    ------
    DirectoryInUse
        If the lock is not released.
    """
    directory.mkdir(parents=True, exist_ok=True)
    path = directory / "service.lock"
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    deadline = time.monotonic() + patience
    while True:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() >= deadline:
                os.close(descriptor)
                raise DirectoryInUse(
                    f"data = {str(directory)!r}: another service uses this directory; "
                    "stop it or name another one"
                ) from None
            time.sleep(0.1)
        else:
            return descriptor
