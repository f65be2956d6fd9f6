"""Files of solutions: model and states, from which all results are computed again."""

from __future__ import annotations

import pickle
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from solver.errors import ModelError
from solver.files import appearing, opened
from solver.version import __version__

_HEAD = b"residua solution "
"""Start of the first line; the version of the solver follows."""
_LONGEST = 100
"""Largest length of the first line [bytes]."""


def write(path: Path, content: Mapping[str, Any]) -> None:
    """Write the content of a solution.

    Raises
    ------
    ModelError
        if the file cannot be written, or the model contains an object that cannot be pickled, such
        as a lambda
    """
    try:
        stored = pickle.dumps(dict(content))
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        allowed = f"must hold no lambda and no function within a function: {error}"
        raise ModelError("model", "", allowed) from None
    try:
        with appearing(path) as part:
            part.write_bytes(_HEAD + __version__.encode() + b"\n" + stored)
    except OSError as error:
        allowed = f"cannot be written: {error.strerror}"
        raise ModelError("path", str(path), allowed) from None


def read(path: Path) -> dict[str, Any]:
    """Return the content that `write` has written.

    Raises
    ------
    ModelError
        if the file cannot be read, is no saved solution, or was written by another version
    """
    try:
        with opened(path) as file:
            head, stored = file.readline(_LONGEST).removesuffix(b"\n"), file.read()
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
    except (AttributeError, ModuleNotFoundError) as error:
        allowed = f"is of a model that this version of the solver, or your own files, lack: {error}"
        raise ModelError("path", str(path), allowed) from None
    except Exception as error:  # a damaged file can raise any exception
        raise ModelError("path", str(path), f"is damaged: {error}") from None
    return found
