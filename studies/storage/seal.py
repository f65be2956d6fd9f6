"""What is stored says what it is and has a digest, and both are checked whenever it is read.

The last line of a file is its seal: a name, such as ``run <id>``, and the SHA-256 of all before the
digest. It is after the end of the HDF5 data, so that every netCDF reader can open the file; in JSON
it is the last entry, ``seal``. HDF5's own checksums, which arrays also have, do not cover names,
attributes and texts, and HDF5 may end the process when it reads damaged ones.

A result is kept until inode, length or a time of the file changes. `Store` moves a file that fails
to ``unreadable/``.
"""

from __future__ import annotations

import errno
import hashlib
import io
import json
import os
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any, BinaryIO

from solver.files import LARGEST, NoFile, opened, read_file
from studies.errors import FileDamaged
from studies.toml import check_depth

SEALED = {"checksum": "SHA-256 in the last line, after the end of HDF5"}
"""Attribute of netCDF files that have the line."""

NO_SEAL = "it has no seal"

_LINE = re.compile(rb'([a-z]+ [\w.-]+) sha256 ([0-9a-f]{64})(?:"\n\})?\n\Z')
_LONGEST = 256
"""Length of the end of a file in which the line is searched [bytes]."""
_NO_FILE = frozenset({errno.ENOENT, errno.ENOTDIR, errno.EISDIR, errno.ELOOP})
"""Errors of the system that tell that there is no such file; others say nothing about it."""

State = tuple[int, int, int, int]


def sealed(name: str, content: bytes) -> bytes:
    """Return the content of a file with its seal."""
    begun = content + f"\n{name} sha256 ".encode()
    return begun + digest_of(begun).encode() + b"\n"


def sealed_json(name: str, content: Mapping[str, Any]) -> bytes:
    """Return the text of a JSON object with its seal."""
    entries = {**content, "seal": f"{name} sha256 "}
    begun = json.dumps(entries, indent=2).removesuffix('"\n}').encode()
    return begun + digest_of(begun).encode() + b'"\n}\n'


def seal(path: Path, name: str) -> None:
    """Write the seal at the end of a file."""
    line = f"\n{name} sha256 ".encode()
    with path.open("r+b") as file:
        whole = hashlib.file_digest(file, "sha256")
        whole.update(line)
        file.write(line + whole.hexdigest().encode() + b"\n")


def state_of(path: Path) -> State | None:
    """Return inode, length and times of change [ns] of a path; None if there is nothing."""
    try:
        found = path.stat()
    except OSError as error:
        if error.errno not in _NO_FILE:
            raise
        return None
    return found.st_ino, found.st_size, found.st_mtime_ns, found.st_ctime_ns


def check(path: Path, name: str = "") -> None:
    """Raise `FileDamaged` unless a file is sealed and has not changed since.

    Parameters
    ----------
    path : of the file
    name : what it must be, such as ``run <id>``; empty for a file outside of its place
    """
    found, reason, _ = _looked(path, name)
    if reason or found != (name or found):
        raise FileDamaged(path, name, reason or f"it is the {found}", state_of(path))


def check_content(content: bytes) -> None:
    """Raise `ValueError` unless the content of a file is sealed and has not changed since."""
    if reason := _examined(io.BytesIO(content))[1]:
        raise ValueError(reason)


def digest(path: Path) -> str:
    """Return the SHA-256 of a whole file; empty if there is no such file."""
    try:
        return _looked(path, path.name)[2]
    except FileDamaged:
        return ""


def content_of(path: Path, name: str = "", largest: int = LARGEST) -> dict[str, Any]:
    """Return the object in a JSON file, without its seal; its name as in `check`.

    One without a seal is of an earlier version; the caller compares its content with the name.

    Raises
    ------
    FileDamaged
        if the file is missing, larger than `largest` bytes, no JSON object, or not what was sealed
    """
    text, state = bytes_of(path, name, largest)
    try:
        check_depth(text.decode())
        content = json.loads(text)
        if not isinstance(content, dict):
            raise ValueError("it is no JSON object")
        if content.pop("seal", None) is not None or _looked(path, name)[1] != NO_SEAL:
            check(path, name)
    except ValueError as error:
        raise FileDamaged(path, name, f"{error}", state) from None
    return content


def bytes_of(path: Path, name: str, largest: int = LARGEST) -> tuple[bytes, State | None]:
    """Return the bytes of a file and its state.

    Raises
    ------
    FileDamaged
        if it is missing, no regular file, or larger than `largest` bytes
    """
    state = state_of(path)
    with _no_file_is_damage(path, name, state):
        return read_file(path, largest), state


def _looked(path: Path, name: str) -> tuple[str, str, str]:
    """Return the name in the seal of a file, what is wrong, and the digest of the whole file."""
    state = state_of(path)
    with _no_file_is_damage(path, name, state, errno.EIO):  # a sector of the disk is damaged
        return _read(path, state)


@contextmanager
def _no_file_is_damage(path: Path, name: str, state: State | None, *also: int) -> Iterator[None]:
    """Raise `FileDamaged` if there is no file; other errors of the system, but `also`, may pass."""
    try:
        yield
    except OSError as error:
        if not isinstance(error, NoFile) and error.errno not in {*_NO_FILE, *also}:
            raise
        raise FileDamaged(path, name, str(error.strerror), state) from None


@lru_cache(maxsize=4096)
def _read(path: Path, state: State | None) -> tuple[str, str, str]:
    with opened(path) as file:
        return _examined(file)


def _examined(file: BinaryIO) -> tuple[str, str, str]:
    """Return what `_looked` does."""
    size = file.seek(0, os.SEEK_END)
    file.seek(max(size - _LONGEST, 0))
    end = file.read()
    line = _LINE.search(end)
    file.seek(0)
    covered = _fed(hashlib.sha256(), file, size - len(end) + line.start(2) if line else 0)
    whole = _fed(covered.copy(), file, size)
    if line is None:
        return "", NO_SEAL, whole.hexdigest()
    wrong = "" if covered.hexdigest() == line[2].decode() else "its checksum is wrong"
    return line[1].decode(), wrong, whole.hexdigest()


def _fed(digest: Any, file: BinaryIO, up_to: int) -> Any:
    """Feed a digest with a file up to a place."""
    while piece := file.read(min(max(up_to - file.tell(), 0), 1 << 20)):
        digest.update(piece)
    return digest


def digest_of(content: bytes) -> str:
    """Return the SHA-256 of the content of a file."""
    return hashlib.sha256(content).hexdigest()
