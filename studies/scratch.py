"""Temporary folders that do not stay when their process is killed."""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_PREFIX = "residua-scratch-"
"""Of folders made here alone: another name could be that of somebody's results."""


@contextmanager
def scratch() -> Iterator[Path]:
    """Give an empty folder for temporary files; it is removed at the end of the context.

    The process holds a lock on the folder. Folders that a killed process has left are found by
    their free lock, and removed first.
    """
    remove_left()
    while True:
        folder = Path(tempfile.mkdtemp(prefix=_PREFIX))
        try:
            descriptor = os.open(folder, os.O_RDONLY)
        except FileNotFoundError:  # another process has removed it before it was opened
            continue
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        if folder.exists():  # else the same before it was locked
            break
        os.close(descriptor)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        os.close(descriptor)


def remove_left() -> None:
    """Remove the folders of this user that a killed process has left."""
    try:
        left = list(Path(tempfile.gettempdir()).glob(f"{_PREFIX}*"))
    except OSError:  # there is no folder for temporary files
        return
    for folder in left:
        with contextlib.suppress(OSError):  # of another user, in use, or gone
            descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
            try:
                if os.fstat(descriptor).st_uid == os.getuid():
                    fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    shutil.rmtree(folder, ignore_errors=True)
            finally:
                os.close(descriptor)
