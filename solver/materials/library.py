"""Materials by name: values of the parameters of a law, and where they are published."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from solver.errors import ModelError
from solver.files import read_file

SOURCE = "source"
"""Entry of a material that is no parameter: where its values are published."""


@cache
def library() -> Mapping[str, Mapping[str, Any]]:
    """Return the materials of the package by name: parameters, and the entry `SOURCE`."""
    return tomllib.loads(read_file(Path(__file__).with_name("library.toml")).decode())


def named(name: str) -> dict[str, Any]:
    """Return the parameters of a material of the package; stresses in MPa.

    Raises
    ------
    ModelError
        with the names that exist
    """
    if name not in library():
        raise ModelError("material", name, f"must be one of {', '.join(library())}")
    return {entry: value for entry, value in library()[name].items() if entry != SOURCE}
