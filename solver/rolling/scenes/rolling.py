"""Elastic cylinder rolling on an elastic-plastic half-space.

Plane strain. The wheel is elastic, condensed to its rim, and turns by finite angles; its axle
carries a vertical force, advances over the track and carries the moment that makes the
longitudinal force. With ``load = "hertz"`` there is no wheel: a Hertz pressure with
proportional shear is translated instead.

The vertical force is that of an elastic Hertz contact with peak pressure
``load_ratio * yield_stress`` on the given radius: ``P = pi R p0^2 / E*`` per unit width,
``E* = E / (2 (1 - nu^2))`` for equal bodies. A positive ``traction`` brakes.

P. Marek, PhD thesis, Warsaw University of Technology (1995), section 5.2.
"""

from __future__ import annotations

import math

from solver.late import late
from solver.rolling.scenes.rolling_parameters import RollingParameters
from solver.scenes.scene import Scene

_method, _program, _view, _refinement, _warnings, _advice = late(
    "rolling.scenes.rolling_setup", "method", "program", "view", "refinement", "warnings", "advice"
)
_model, _sketch, _effort = late("rolling.scenes.rolling_model", "model", "sketch", "effort")
(_trace,) = late("rolling.scenes.passes", "Trace.of")

ROLLING = Scene(
    name="rolling",
    summary="elastic cylinder rolling on an elastic-plastic half-space, pass after pass",
    parameters=RollingParameters,
    branch="passes",
    method=_method,
    model=_model,
    sketch=_sketch,
    program=_program,
    view=_view,
    outputs=(
        *late("results.maps", "maps", "surfaces"),
        *late("results.extremes", "residual_extremes"),
        *late("rolling.scenes.rolling_setup", "profile_figures", "surface"),
        *late("results.contact", "contact"),
        *late("results.figures", "extremes"),
        *late("rolling.scenes.rolling_setup", "wheel", "cycles"),
    ),
    costs=(*late("results.figures", "cost"), *late("rolling.scenes.rolling_setup", "progress")),
    trace=_trace,
    refinement=_refinement,
    increment_error=math.inf,  # increments are those of `advance_step`, see `refinement`
    effort=_effort,
    warnings=_warnings,
    advice=_advice,
)  # fmt: skip
