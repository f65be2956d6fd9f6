"""Meshes: graded grids, the elements that cells may be, and which meshes are refused."""

from __future__ import annotations

from solver.mesh.grids import graded, grid, mapped, merged, refined, with_middle
from solver.mesh.notches import without

__all__ = ["graded", "grid", "mapped", "merged", "refined", "with_middle", "without"]
