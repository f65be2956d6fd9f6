"""Reading of regular files up to a size, and writing of files that appear when complete.

Devices and pipes, and links to them, are refused: reading could wait, or never end.
"""

from __future__ import annotations

import os
import stat
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from itertools import islice
from pathlib import Path
from typing import BinaryIO

LARGEST = 50_000_000
"""Largest size of a file that is read as a whole, by default [bytes]."""

_PIECE = 1 << 20
_KINDS = {
    stat.S_IFDIR: "a folder", stat.S_IFLNK: "a link", stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket", stat.S_IFCHR: "a device", stat.S_IFBLK: "a device",
}  # fmt: skip


class NoFile(OSError):
    """A path is not a regular file, or the file is too large; `strerror` is the reason."""

    def __init__(self, path: Path | str, reason: str) -> None:
        super().__init__(0, reason, str(path))

    def __str__(self) -> str:
        return f"{self.filename}: {self.strerror}"

    def __reduce__(self) -> tuple[type[NoFile], tuple[str, str]]:
        return type(self), (self.filename, str(self.strerror))


def number_of(text: str) -> float:
    """Return the number that a cell of a file is, with the digits 0 to 9 as in TOML and JSON.

    Raises
    ------
    ValueError
        if it is none
    """
    if not text.isascii() or "_" in text:
        raise ValueError(f"could not convert string to float: {text!r}")
    return float(text)


def special(path: Path, links: bool = True) -> str:
    """Return the kind of a path that is not a regular file, such as "a pipe"; otherwise empty.

    It is empty also if nothing has this path. If ``links``, links are followed.
    """
    try:
        return _kind(path.stat(follow_symlinks=links).st_mode)
    except FileNotFoundError:
        return ""


def descriptor_of(path: Path | str, flags: int = os.O_RDONLY) -> int:
    """Return the descriptor of a regular file, opened without waiting.

    Raises
    ------
    NoFile
        if it is not a regular file
    OSError
        if it cannot be opened
    """
    try:
        descriptor = os.open(path, flags | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC, 0o644)
    except OSError:
        if kind := special(Path(path)):  # a socket, for example, cannot be opened
            raise NoFile(path, f"it is {kind}") from None
        raise
    if kind := _kind(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise NoFile(path, f"it is {kind}")
    return descriptor


def opened(path: Path | str) -> BinaryIO:
    """Return a regular file opened for reading; errors as of `descriptor_of`."""
    return os.fdopen(descriptor_of(path), "rb")


def read_file(path: Path | str, largest: int = LARGEST) -> bytes:
    """Return the content of a regular file of at most ``largest`` bytes.

    Raises
    ------
    NoFile
        if it is not a regular file, or larger
    OSError
        if it cannot be read
    """
    with opened(path) as file:  # in pieces: the file may grow meanwhile
        pieces = islice(iter(partial(file.read, _PIECE), b""), largest // _PIECE + 1)
        content = b"".join(pieces)
    if len(content) > largest:
        raise NoFile(path, f"it has more than {largest} bytes")
    return content


@contextmanager
def appearing(path: Path) -> Iterator[Path]:
    """Yield a temporary path to write to; at the end the file is renamed to ``path``.

    It replaces a regular file. Raises `NoFile` if ``path`` is something else, such as a link.
    """
    if kind := special(path, links=False):
        raise NoFile(path, f"it is {kind}, and only files are replaced")
    part = path.with_name(f"{path.name}.{uuid.uuid4().hex}.part")
    try:
        yield part
        with opened(part) as written:
            os.fsync(written.fileno())
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def _kind(mode: int) -> str:
    return "" if stat.S_ISREG(mode) else _KINDS.get(stat.S_IFMT(mode), "no file")
