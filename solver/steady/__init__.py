"""Steady passes: rolling on a track without ends, solved in the frame of the load.

A long track under a constant load is steady in the frame of the load. There are no increments:
material flows along rows of integration points through a fixed mesh, and each pass is the solution
of one nonlinear system. Before and after a pass the state is a function of depth alone.
"""

from solver.steady.layers import Layers
from solver.steady.passing import Pass
from solver.steady.rim import Rim
from solver.steady.rolling import rolling
from solver.steady.touching import RollingContact
from solver.steady.track import Track, standing_pressure, track_of
from solver.steady.wheel import RollingWheel

__all__ = [
    "Layers",
    "Pass",
    "Rim",
    "RollingContact",
    "RollingWheel",
    "Track",
    "rolling",
    "standing_pressure",
    "track_of",
]
