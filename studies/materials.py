"""Materials by name in studies and scene files: a name stands for parameters, a file may have more.

A material is a name of the package, or a table of parameters with the entry ``name``, which
``"steels.toml#40Cr"`` becomes once the file is read.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from solver.materials.library import SOURCE, library, named
from studies.errors import StudyError, one_of
from studies.toml import read_toml

MATERIAL = "material"
"""Key of settings, and name of an axis, whose values are materials."""
NAME = "name"
"""Entry of a material from a file: its name there."""

_IN_FILE = re.compile(r"(?P<file>.+\.toml)#(?P<name>.+)")


def parameters_in(material: Any) -> dict[str, Any]:
    """Return the parameters that a material stands for.

    Raises
    ------
    StudyError
        without a field, if it is none
    """
    if isinstance(material, Mapping):
        return {str(key): each for key, each in material.items() if key not in (NAME, SOURCE)}
    if isinstance(material, str) and _IN_FILE.fullmatch(material):
        allowed = "names a file, which only a study or scene file can: give a table of parameters"
        raise StudyError("", material, allowed)
    if material not in [*library()]:
        raise StudyError("", material, one_of(material, [*library(), "FILE.toml#NAME", "a table"]))
    return named(material)


def name_in(material: Any) -> Any:
    """Return the name of a material."""
    return material.get(NAME) if isinstance(material, Mapping) else material


def read_material(text: str, folder: Path, field: str) -> Any:
    """Return the table of ``"steels.toml#40Cr"`` in a folder, with its name; other texts stay.

    Raises
    ------
    StudyError
        naming ``field``, if the file cannot be read or has no such table
    """
    if not (found := _IN_FILE.fullmatch(text)):
        return text
    tables = read_toml(folder / found["file"], field)
    if not isinstance(table := tables.get(found["name"]), Mapping):
        raise StudyError(field, text, one_of(found["name"], tables))
    return {NAME: found["name"], **table}
