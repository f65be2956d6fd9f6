"""Meshes: graded grids, shapes, element types, and the check that refuses bad meshes."""

from __future__ import annotations

from importlib import import_module
from typing import Any

_HOMES = {
    "Near": "shapes",
    "ball": "shapes",
    "disc": "shapes",
    "fillet": "shapes",
    "graded": "lines",
    "grid": "grids",
    "half_plane": "shapes",
    "mapped": "grids",
    "marked": "grids",
    "merged": "grids",
    "pad": "shapes",
    "rectangle": "shapes",
    "refined": "lines",
    "ring": "shapes",
    "within": "grids",
    "without": "grids",
}

__all__ = list(_HOMES)


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used: grid lines need no mesh."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
