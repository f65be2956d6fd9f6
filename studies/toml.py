"""Read TOML files of studies and scenes."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

from studies.errors import StudyError


def read_toml(path: Path | str, field: str) -> dict[str, Any]:
    """Return the tables of a TOML file.

    Raises
    ------
    StudyError
        for ``field``, when the file cannot be read or is no TOML
    """
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise StudyError(field, str(path), f"cannot be read: {error.strerror}") from None
    return toml_of(data, field, str(path))


def toml_of(data: bytes, field: str, name: str) -> dict[str, Any]:
    """Return the tables of a TOML text; a date is text.

    Raises
    ------
    StudyError
        for ``field`` with the value ``name``, if the text is not TOML
    """
    try:
        tables = tomllib.loads(data.decode("utf-8-sig"))
        plain: dict[str, Any] = json.loads(json.dumps(tables, default=str))
    except (ValueError, RecursionError) as error:
        raise StudyError(field, name, f"must be valid TOML: {error}") from None
    return plain
