"""The named scenes: parameters in, records out.

A `Scene` is data: parameters, model, program, view and outputs. Runs that differ only in the
scene's ``branch`` parameter share the increments they have in common.
"""

from __future__ import annotations

import solver.results.corner
import solver.results.increments
import solver.results.indentation
import solver.results.places
import solver.results.pressure_error
import solver.results.stick  # noqa: F401  (declare what scene files store)
from solver.scenes.effort import Effort
from solver.scenes.punch import PUNCH
from solver.scenes.raceway import RACEWAY
from solver.scenes.rolling import ROLLING
from solver.scenes.scene import Monitor, Scene
from solver.scenes.wheel_rail import WHEEL_RAIL

SCENES: dict[str, Scene] = {scene.name: scene for scene in (PUNCH, ROLLING, WHEEL_RAIL, RACEWAY)}

__all__ = ["SCENES", "Effort", "Monitor", "Scene"]
