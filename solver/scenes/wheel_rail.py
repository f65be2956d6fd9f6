"""Railway wheel rolling along a rail, in three dimensions.

The rail is a 60E1, elastic-plastic in a zone under the contact, without ends, on an elastic
foundation. The wheel is an elastic half-space with the shape of its profile. Passes are steady: in
the frame of the wheel nothing changes. Coordinates are x along the rail, y up from the top of the
rail, z across it to the outside of the track; x = 0 is at the wheel. A positive ``traction``
brakes.

P. Marek, PhD thesis, Warsaw University of Technology (1995), chapter 6.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from solver.results.extremes import residual_extremes
from solver.results.figures import cost, extremes
from solver.results.maps import maps, profiles
from solver.results.record import Status
from solver.results.view import ACROSS_TRACK, View
from solver.scenes.effort import effort_of
from solver.scenes.prism_outputs import cycles, patch, section
from solver.scenes.rolling import AXLE_HEIGHT
from solver.scenes.scene import Method, Scene
from solver.scenes.wheel_rail_parameters import WheelRailParameters

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.results.run import FinishedRun, Values
    from solver.scenes.effort import Effort

    Array = NDArray[np.float64]

_HALF_HEAD, _MAPPED, _ALONG = 36.0, 16.0, 20.0
"""Half the width of maps, their depth, and half their length along the rail [mm]."""
_PIXEL = 0.5
"""Distance of positions of maps across and along [mm]; in depth it is half of that."""


def method(parameters: WheelRailParameters) -> Method:
    """Return the method of the passes."""
    del parameters
    from solver.scenes.prism_passes import by_passes  # loads scipy
    from solver.scenes.wheel_rail_track import RolledRail

    return partial(by_passes, rolled=RolledRail)


def view(parameters: WheelRailParameters) -> View:
    """Return the positions of results: the head of the rail, and profiles under the contact."""
    from solver.scenes.wheel_rail_track import expected_contact  # loads scikit-fem

    contact = expected_contact(parameters)
    beside = round(contact.across) / 2
    across, along = round(2 * _HALF_HEAD / _PIXEL), round(2 * _ALONG / _PIXEL)
    down = round(2 * _MAPPED / _PIXEL)
    return View(
        x=np.linspace(-_ALONG, _ALONG, along + 1),
        y=np.linspace(-_MAPPED, 0.0, down + 1),
        z=np.linspace(-_HALF_HEAD, _HALF_HEAD, across + 1),
        depth=np.linspace(0.0, _MAPPED, down + 1),
        station=contact.middle + beside * np.array([-1.0, 0.0, 1.0]),
        s=np.zeros(0),
        profile_body="rail",
        surfaces={"rail": "running"},
        axis=ACROSS_TRACK,
    )


def axle(run: FinishedRun) -> Values:
    """Return the height of the axle over that at which the undeformed bodies touch."""
    from solver.scenes.wheel_rail_track import expected_contact

    contact: Any = run.outcome.points[run.view.loaded].touching
    return {AXLE_HEIGHT: contact.height + expected_contact(run.parameters).gap}


def effort(parameters: WheelRailParameters, passes: Sequence[float]) -> Effort:
    """Return the work of so many passes; the section is meshed for it."""
    from solver.scenes.wheel_rail_track import geometry, section_of

    return effort_of(section_of(geometry(parameters)), passes)


WHEEL_RAIL = Scene(
    name="wheel_rail",
    summary="railway wheel rolling along an elastic-plastic rail, in three dimensions",
    parameters=WheelRailParameters,
    branch="passes",
    method=method,
    view=view,
    outputs=(maps, profiles, residual_extremes, extremes, patch, section, cycles, axle),
    costs=(cost,),
    effort=effort,
    advice={
        Status.LIMIT_LOAD: "lower load or traction, or let the material harden",
        Status.NOT_CONVERGED: "lower load or traction, or choose another accuracy or position",
    },
)
