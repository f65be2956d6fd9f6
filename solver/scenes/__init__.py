"""The named scenes: parameters in, records out.

A `Scene` is data: parameters, model, program, view and outputs. Runs that differ only in the
scene's ``branch`` parameter share the increments they have in common. A scene of the package names
the functions that compute it as text: they are imported when they are called.
"""

from __future__ import annotations

from solver.results.outputs import MODULES
from solver.results.quantities import DECLARING
from solver.scenes.effort import Effort
from solver.scenes.punch import PUNCH
from solver.scenes.raceway import RACEWAY
from solver.scenes.rolling import ROLLING
from solver.scenes.scene import Monitor, Scene
from solver.scenes.wheel_rail import WHEEL_RAIL

SCENES: dict[str, Scene] = {scene.name: scene for scene in (PUNCH, ROLLING, WHEEL_RAIL, RACEWAY)}

DECLARING += [
    *MODULES, "solver.results.named_places", "solver.scenes.driver", "solver.scenes.punch_setup",
    "solver.scenes.rolling_setup", "solver.scenes.wheel_rail_setup", "solver.scenes.raceway_setup",
]  # fmt: skip

__all__ = ["SCENES", "Effort", "Monitor", "Scene"]
