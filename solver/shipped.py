"""The scenes of the package, by name."""

from __future__ import annotations

from solver.results.outputs import MODULES
from solver.results.quantities import DECLARING
from solver.rolling.scenes.raceway import RACEWAY
from solver.rolling.scenes.rolling import ROLLING
from solver.rolling.scenes.wheel_rail import WHEEL_RAIL
from solver.scenes.punch import PUNCH
from solver.scenes.scene import Scene

SCENES: dict[str, Scene] = {scene.name: scene for scene in (PUNCH, ROLLING, WHEEL_RAIL, RACEWAY)}

DECLARING += [
    *MODULES,
    "solver.results.named_places",
    "solver.scenes.driver",
    "solver.scenes.punch_setup",
    "solver.rolling.scenes.rolling_setup",
    "solver.rolling.scenes.wheel_rail_setup",
    "solver.rolling.scenes.raceway_setup",
]
