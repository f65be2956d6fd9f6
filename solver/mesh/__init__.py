"""Meshes: graded grids, shapes, element types, and the check that refuses bad meshes."""

from __future__ import annotations

from solver.mesh.grids import grid, mapped, marked, merged, within, without
from solver.mesh.lines import graded, refined
from solver.mesh.shapes import Near, ball, disc, fillet, half_plane, pad, rectangle, ring

__all__ = [
    "Near",
    "ball",
    "disc",
    "fillet",
    "graded",
    "grid",
    "half_plane",
    "mapped",
    "marked",
    "merged",
    "pad",
    "rectangle",
    "refined",
    "ring",
    "within",
    "without",
]
