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
from solver.results.record import Status
from solver.rolling.scenes.wheel_rail_parameters import WheelRailParameters
from solver.scenes.scene import Scene

_method, _view, _sketch, _effort, _setup = late(
    "rolling.scenes.wheel_rail_setup", "method", "view", "sketch", "effort", "setup"
)

WHEEL_RAIL = Scene(
    name="wheel_rail",
    summary="railway wheel rolling along an elastic-plastic rail, in three dimensions",
    parameters=WheelRailParameters,
    branch="passes",
    method=_method,
    view=_view,
    sketch=_sketch,
    outputs=(
        *late("results.maps", "maps", "profiles"),
        *late("results.extremes", "residual_extremes"),
        *late("results.figures", "extremes"),
        *late("rolling.scenes.rail_outputs", "patch", "section"),
        *late("rolling.scenes.wheel_rail_setup", "traffic", "wheel"),
    ),
    costs=late("results.figures", "cost"),
    effort=_effort,
    setup=_setup,
    advice={
        Status.LIMIT_LOAD: "lower load or traction, or let the material harden",
        Status.NOT_CONVERGED: "choose a finer accuracy, above all at the gauge corner, or another "
        "position; or lower load or traction",
    },
)
