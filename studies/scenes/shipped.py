"""The scene files of the package, in the folder ``files`` beside this module."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from solver.shipped import SCENES

SHIPPED: Mapping[str, Path] = {
    path.stem: path for path in sorted((Path(__file__).parent / "files").glob("*.toml"))
}
"""Name of a scene -> its file."""


def is_built_in(name: str) -> bool:
    """Tell whether a scene of the package has this name."""
    return name in SCENES or name in SHIPPED
