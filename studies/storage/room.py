"""Handling of a full disk: recognised among other errors, and hidden from the HDF5 library."""

from __future__ import annotations

import errno
import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from studies.errors import StoreFull

FULL = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG})
"""Error numbers for a full device, an exhausted quota, and the largest size of a file."""


@contextmanager
def needs_room(directory: Path) -> Iterator[None]:
    """Raise `StoreFull`, which names `directory`, if a call fails because the disk is full."""
    try:
        yield
    except OSError as error:
        if error.errno in FULL:
            raise StoreFull(str(directory)) from None
        raise


class Reservoir(io.FileIO):
    """A new file for HDF5 to write to; data that does not fit on the disk is kept in memory.

    HDF5 does not survive a failed write: closing the file afterwards ends the process. Therefore
    every write succeeds here, and `check` reports in between whether the disk was full.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path, "w+b")
        self._held: list[tuple[int, bytes]] = []
        self._reason: OSError | None = None

    def check(self) -> None:
        """Raise the `OSError` of the first write that failed, if one did."""
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
        """Fill `buffer` with the data written here, zeros beyond the end of the file."""
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
        """Set the length of the file; after a failed write the file is not used."""
        return super().truncate(size) if self._reason is None else self.tell()
