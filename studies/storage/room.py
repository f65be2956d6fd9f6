"""A full disk, distinguished from other failures, and kept away from the HDF5 library."""

from __future__ import annotations

import errno
import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from studies.errors import StoreFull

FULL = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG})
"""What the system says when a device, a quota or the allowed size of a file is used up."""


@contextmanager
def needs_room(directory: Path) -> Iterator[None]:
    """Raise `StoreFull`, which names `directory`, where a call finds no room left."""
    try:
        yield
    except OSError as error:
        if error.errno in FULL:
            raise StoreFull(str(directory)) from None
        raise


class Reservoir(io.FileIO):
    """A new file for HDF5 to write to; what finds no room on the disk is held in memory.

    HDF5 does not survive a write that fails: closing the file afterwards ends the process. So
    every write succeeds here, and `check` tells in between whether it has reached the disk.

    Parameters
    ----------
    path : of the file
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path, "w+b")
        self._held: list[tuple[int, bytes]] = []
        self._reason: OSError | None = None

    def check(self) -> None:
        """Raise the `OSError` of the first write that found no room."""
        if self._reason is not None:
            raise self._reason

    def write(self, data: bytes | bytearray | memoryview) -> int:  # type: ignore[override]
        """Write all of `data`, to memory from the first failure on."""
        content = bytes(data)
        at = self.tell()
        done = 0
        try:
            while self._reason is None and done < len(content):
                done += super().write(content[done:]) or 0
        except OSError as error:
            if error.errno not in FULL:
                raise
            self._reason = error
        if done < len(content):
            self._held.append((at + done, content[done:]))
            self.seek(at + len(content))
        return len(content)

    def readinto(self, buffer: bytearray | memoryview) -> int:  # type: ignore[override]
        """Fill `buffer` with what was written here, zeros beyond the end of the file."""
        at = self.tell()
        content = bytearray((super().read(len(buffer)) or b"").ljust(len(buffer), b"\0"))
        for start, held in self._held:
            first, last = max(start, at), min(start + len(held), at + len(content))
            if first < last:
                content[first - at : last - at] = held[first - start : last - start]
        memoryview(buffer)[:] = content
        self.seek(at + len(content))
        return len(content)

    def truncate(self, size: int | None = None) -> int:
        """Set the length of the file; one that lacks content is of no use."""
        return super().truncate(size) if self._reason is None else self.tell()
