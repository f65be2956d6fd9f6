"""Scenes: parameters in, records out.

A `Scene` is data: parameters, model, program, view and outputs. Runs that differ only in the
scene's ``branch`` parameter share the increments they have in common. A scene of the package names
the functions that compute it as text: they are imported when they are called.
"""

from __future__ import annotations

from solver.scenes.scene import Effort, Monitor, Scene

__all__ = ["Effort", "Monitor", "Scene"]
