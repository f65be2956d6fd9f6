"""Railway wheel rolling along a rail, in three dimensions.

The rail is a 60E1, elastic-plastic in a zone under the contact, without ends, on an elastic
foundation. The wheel is an elastic half-space with the shape of its profile. Passes are steady: in
the frame of the wheel nothing changes. Coordinates are x along the rail, y up from the top of the
rail, z across it to the outside of the track; x = 0 is at the wheel. A positive ``traction``
brakes.

P. Marek, PhD thesis, Warsaw University of Technology (1995), chapter 6.
"""

from __future__ import annotations

from solver.late import late
from solver.rolling.scenes.rail_scene import rail_scene
from solver.rolling.scenes.wheel_rail_parameters import WheelRailParameters

(_geometry,) = late("rolling.scenes.wheel_rail_track", "geometry")

WHEEL_RAIL = rail_scene(
    "wheel_rail",
    "railway wheel rolling along an elastic-plastic rail, in three dimensions",
    WheelRailParameters,
    geometry=_geometry,
    outputs=late("rolling.scenes.wheel_rail_setup", "traffic", "wheel"),
    advice="choose a finer accuracy, above all at the gauge corner, or another "
    "position; or lower load or traction",
)
