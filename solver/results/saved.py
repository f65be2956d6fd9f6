"""A solution as a file: the model and its states, from which everything else is made anew."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import TYPE_CHECKING, Any

from solver.errors import ModelError
from solver.version import __version__

if TYPE_CHECKING:
    from collections.abc import Mapping

_HEAD = b"residua solution "
"""What the file begins with; the version of the solver follows, and the end of the line."""


def write(path: Path, content: Mapping[str, Any]) -> None:
    """Write what a solution is made of.

    Raises
    ------
    ModelError : the file cannot be written, or the model holds something that cannot be stored,
        such as a function without a name
    """
    try:
        stored = pickle.dumps(dict(content))
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        allowed = f"must hold no lambda and no function within a function: {error}"
        raise ModelError("model", "", allowed) from None
    part = path.with_name(f"{path.name}.part")  # a file that is there stays until this is whole
    try:
        part.write_bytes(_HEAD + __version__.encode() + b"\n" + stored)
        part.replace(path)
    except OSError as error:
        allowed = f"cannot be written: {error.strerror}"
        raise ModelError("path", str(path), allowed) from None
    finally:
        part.unlink(missing_ok=True)


def read(path: Path) -> dict[str, Any]:
    """Return what `write` has written.

    Raises
    ------
    ModelError : it is no such file, or another version of the solver wrote it
    """
    try:
        head, _, stored = path.read_bytes().partition(b"\n")
    except OSError as error:
        raise ModelError("path", str(path), f"cannot be read: {error.strerror}") from None
    if not head.startswith(_HEAD):
        raise ModelError("path", str(path), "must be a file that Solution.save has written")
    written, here = head.removeprefix(_HEAD).decode(errors="replace"), __version__
    if written != here:
        allowed = f"is of version {written} of the solver, and this is {here}"
        raise ModelError("path", str(path), allowed)
    try:
        found: dict[str, Any] = pickle.loads(stored)
    except Exception as error:  # a damaged stream raises anything
        raise ModelError("path", str(path), f"is damaged: {error}") from None
    return found
