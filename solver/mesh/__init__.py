"""Meshes: graded grids, the elements that cells may be, and which meshes are refused."""

from __future__ import annotations

from solver.mesh.grids import graded, grid, mapped, merged, with_middle

__all__ = ["graded", "grid", "mapped", "merged", "with_middle"]
