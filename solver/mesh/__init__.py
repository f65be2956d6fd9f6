"""Meshes: graded grids, shapes, element types, and the check that refuses bad meshes."""

from __future__ import annotations

from solver.late import front

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
    "opened": "opening",
    "pad": "shapes",
    "rectangle": "shapes",
    "refined": "lines",
    "ring": "shapes",
    "within": "grids",
    "without": "grids",
}

__all__ = list(_HOMES)

# A public name is imported when it is first used.
__getattr__ = front(__name__, _HOMES)
