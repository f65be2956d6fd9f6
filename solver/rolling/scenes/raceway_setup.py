"""The bodies, the passes and the results of the raceway."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from solver.results.quantities import declare
from solver.results.run import FinishedRun, Values
from solver.results.view import ACROSS_TRACK, View
from solver.rolling.scenes.raceway_parameters import RacewayParameters
from solver.rolling.scenes.raceway_track import RacewayGeometry, RolledRaceway, geometry, section_of
from solver.rolling.scenes.rail_effort import effort_of
from solver.rolling.scenes.rail_outputs import sketched
from solver.rolling.scenes.rail_passes import by_passes
from solver.rolling.scenes.rolling_setup import AXLE_HEIGHT
from solver.scenes.effort import Effort
from solver.scenes.scene import Method
from solver.scenes.sketch import Sketch

HERTZ_PRESSURE = declare("hertz_pressure", "peak pressure p0 of the elastic Hertz contact", "MPa")
HERTZ_A = declare("hertz_a", "semi-axis along x of the elastic Hertz contact", "mm")
HERTZ_B = declare("hertz_b", "semi-axis along z of the elastic Hertz contact", "mm")
HERTZ_APPROACH = declare(
    "hertz_approach", "approach of the bodies in the elastic Hertz contact of half-spaces", "mm"
)
_ALONG, _ACROSS, _DOWN = 1.6, 2.0, 2.4
"""Half the length and half the width of maps over a and b, and their depth over
`RacewayParameters.below`."""
_PIXELS = 24
"""Positions of maps per semi-axis, and per `RacewayParameters.below` in depth."""


def method(parameters: RacewayParameters) -> Method:
    """Return the method of the passes."""
    del parameters

    return partial(by_passes, rolled=RolledRaceway)


def view(parameters: RacewayParameters) -> View:
    """Return the positions of results, which depend on the ellipse and not on the mesh."""
    a, b = parameters.size
    below, wide = parameters.below, _ACROSS * b
    along, across = round(_ALONG * _PIXELS), round(_ACROSS * _PIXELS)
    down = round(_DOWN * _PIXELS)
    return View(
        x=np.linspace(-_ALONG * a, _ALONG * a, 2 * along + 1),
        y=np.linspace(-_DOWN * below, 0.0, down + 1),
        z=np.linspace(-wide, wide, 2 * across + 1),
        depth=np.linspace(0.0, _DOWN * below, down + 1),
        station=b / 2 * np.array([-1.0, 0.0, 1.0]),
        s=np.zeros(0),
        profile_body="raceway",
        surfaces={"raceway": "running"},
        axis=ACROSS_TRACK,
    )


def sketch(parameters: RacewayParameters) -> Sketch:
    """Return the section of the raceway, and the ball or roller at first touch."""
    own, radius = geometry(parameters), parameters.across
    wide = own.block if own.groove is None else min(own.block, own.groove[1])
    z = min(0.95 * radius, wide) * np.linspace(-1.0, 1.0, 201)
    height = radius - np.sqrt(radius**2 - z**2)
    rolls = {"ball or roller": np.stack([z, height])}
    return sketched("raceway", section_of(own), parameters.material(), rolls)


def elastic(run: FinishedRun) -> Values:
    """Return the elastic Hertz contact, and the height of the ball or roller over first touch."""
    p: Any = run.parameters
    contact: Any = run.outcome.points[run.view.loaded].touching
    ellipse = p.ellipse
    return {
        HERTZ_PRESSURE: ellipse.peak_pressure,
        HERTZ_A: ellipse.a,
        HERTZ_B: ellipse.b,
        HERTZ_APPROACH: ellipse.approach,
        AXLE_HEIGHT: contact.height if p.load == "contact" else np.nan,
    }


def setup(parameters: RacewayParameters) -> RacewayGeometry:
    """Return the geometry of the raceway, which decides its set-up."""
    return geometry(parameters)


def effort(parameters: RacewayParameters, passes: Sequence[float]) -> Effort:
    """Return the work of so many passes; the section is meshed for it."""
    own = geometry(parameters)
    return effort_of(section_of(own), own.window.size, passes)
