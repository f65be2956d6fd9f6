"""Names made from content: the same parameters and the same solver give the same id.

A change of the solver that may change a number, a name or a unit changes every id, so that no old
run is taken for a new one. A change of words alone changes none: `studies.definition.meaning` says
what words are.
"""

from __future__ import annotations

import hashlib
import json
import re
from functools import cache
from pathlib import Path
from typing import Any

import solver

ID_PATTERN = re.compile(r"[0-9a-f]{32}")


def canonical(value: Any) -> str:
    """Return JSON that is equal for equal content (key order, ``-0.0`` and spacing apart)."""
    return json.dumps(
        _normalised(value),
        sort_keys=True,
        separators=(",", ":"),
        ensure_ascii=False,
        allow_nan=False,
    )


def content_id(*parts: Any) -> str:
    """Return 32 hexadecimal digits that depend on `parts` and on what the solver computes."""
    return _digest(canonical([*parts, solver_hash()]).encode())


def is_id(text: str) -> bool:
    """Tell whether `text` has the form of a content id."""
    return ID_PATTERN.fullmatch(text) is not None


FORM = (
    "definition/cases.py",
    "definition/parameters.py",
    "definition/vocabulary.py",
    "storage/dataset.py",
    "storage/provenance.py",
)
"""Modules of this package that lay records out: names, units, dimensions, attributes."""


@cache
def solver_hash() -> str:
    """Return the digest of all that decides what a run's file holds, but for its words.

    These are the sources of the solver, and the modules that lay its records out as data sets,
    each with its place: to move a file changes the digest.
    """
    from studies.definition.meaning import meaning  # `residua --help` makes no id

    root, here = Path(solver.__file__).parent, Path(__file__).parents[1]
    files = {f"solver/{path.relative_to(root).as_posix()}": path for path in root.rglob("*.py")}
    files |= {f"studies/{name}": here / name for name in FORM}
    digests = {name: _digest(meaning(path.read_bytes()).encode()) for name, path in files.items()}
    return _digest(json.dumps(digests, sort_keys=True).encode())


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:32]


def _normalised(value: Any) -> Any:
    if isinstance(value, float):
        return value + 0.0  # -0.0 becomes 0.0
    if isinstance(value, dict):
        return {key: _normalised(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_normalised(item) for item in value]
    return value
