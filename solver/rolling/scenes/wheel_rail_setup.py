"""The bodies, the passes and the results of wheel and rail."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any, cast

import numpy as np

from solver.errors import WindowTooSmall
from solver.results.quantities import declare
from solver.results.run import FinishedRun, Values
from solver.results.view import ACROSS_TRACK, View
from solver.rolling.rail.patch import RollingPatch
from solver.rolling.rail.patch_contact import PatchContact
from solver.rolling.rail.track import PrismTrack
from solver.rolling.scenes.rail_outputs import cycles, remedies, sketched
from solver.rolling.scenes.rail_passes import by_rail_passes, effort_of
from solver.rolling.scenes.rolling_setup import AXLE_HEIGHT
from solver.rolling.scenes.wheel_rail import WheelRailParameters
from solver.rolling.scenes.wheel_rail_contact import expected_contact, rail_of, upper, wheel_of
from solver.rolling.scenes.wheel_rail_track import geometry, meshed, stressed_track
from solver.scenes.scene import Advice, Effort, Method
from solver.scenes.sketch import Sketch
from solver.typing import Array

AXLE_LATERAL_CREEPAGE = declare(
    "axle_lateral_creepage", "velocity of the axle along z over that along x", "1"
)
SPIN_MOMENT = declare(
    "spin_moment",
    "moment of the contact on the rail about the downward vertical through the running circle",
    "N mm",
)
WHEEL_SURFACE = declare(
    "wheel_surface", "height of the undeformed wheel when it first touches the rail", "mm",
    dims=("z",),
)  # fmt: skip
PASS_LOAD = declare("pass_load", "vertical force on the wheel of a pass", "N", dims=("pass",))
PASS_LATERAL_POSITION = declare(
    "pass_lateral_position", "position z of the running circle of a pass", "mm", dims=("pass",)
)
PASS_TRACTION = declare(
    "pass_traction", "ratio of longitudinal force to that of full slip, of a pass", dims=("pass",)
)
_HALF_HEAD, _MAPPED, _ALONG = 36.0, 16.0, 20.0
"""Half the width of maps, their depth, and half their length along the rail [mm]."""
_PIXEL = 0.5
"""Distance of positions of maps across and along [mm]; in depth it is half of that."""


def prism(parameters: WheelRailParameters, reach: float) -> PrismTrack:
    """Return the rail; errors as of `geometry` and `meshed`."""
    p, own = parameters, geometry(parameters, reach)
    meshed(p, own)
    return stressed_track(own, p.rail_stress, p.thermal_strain)


def load_on(track: PrismTrack, own: WheelRailParameters, last: Any = None) -> RollingPatch:
    """Return the load of a pass; it shares the influences of tractions with that of another one."""
    rolls = {"wheel": wheel_of(own), "load": own.under(own.load), **own.rubbing}
    if last is not None:
        return cast("RollingPatch", last.changed(**rolls))
    return RollingPatch(grid=track.grid, compliance=track.compliance, **rolls)


def method(parameters: WheelRailParameters) -> Method:
    """Return the method of the passes."""
    return partial(by_rail_passes, prism=prism, load_on=load_on)


def view(parameters: WheelRailParameters) -> View:
    """Return the positions of results: the head of the rail, and profiles under the contact."""
    contact = expected_contact(parameters)
    beside = round(contact.across) / 2
    across, along = round(2 * _HALF_HEAD / _PIXEL), round(2 * _ALONG / _PIXEL)
    down, section = round(2 * _MAPPED / _PIXEL), rail_of(parameters)
    z, y = section.outline.at(np.linspace(*upper(section), 2001))
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
        top=np.stack([z, y])[:, np.argsort(z)],
    )


def sketch(parameters: WheelRailParameters) -> Sketch:
    """Return the section of the rail, and the wheel of the last pass at first touch."""
    z = np.linspace(-_HALF_HEAD, _HALF_HEAD, 20 * round(_HALF_HEAD) + 1)
    height = _at_first_touch(parameters.each_pass()[-1], z)
    there = np.isfinite(height)
    own, wheel = meshed(parameters, geometry(parameters)), np.stack([z[there], height[there]])
    return sketched("rail", own, parameters.material(), {"wheel": wheel})


def traffic(run: FinishedRun) -> Values:
    """Return the figures of every pass, with its load, position and traction."""
    each = run.parameters.each_pass()
    return {
        **cycles(run, run.parameters.cycle),
        PASS_LOAD: np.array([own.load for own in each]),
        PASS_LATERAL_POSITION: np.array([own.lateral_position for own in each]),
        PASS_TRACTION: np.array([own.traction for own in each]),
    }


def wheel(run: FinishedRun) -> Values:
    """Return the wheel of the last pass: its profile at first touch, its height, and its slip.

    The height is that of the axle over the one at which the undeformed bodies touch; the moment is
    that about the vertical through the running circle.
    """
    contact = cast("PatchContact", run.outcome.points[run.view.loaded].touching)
    p = run.parameters.each_pass()[-1]
    return {
        AXLE_HEIGHT: contact.height + expected_contact(p).gap,
        AXLE_LATERAL_CREEPAGE: contact.lateral_creepage,
        SPIN_MOMENT: contact.spin_moment + p.lateral_position * float(contact.force[0]),
        WHEEL_SURFACE: _at_first_touch(p, run.view.z),
    }


def _at_first_touch(p: WheelRailParameters, z: Array) -> Array:
    """Return the height of the undeformed wheel where it first touches, inf where it is not."""
    own = wheel_of(p)
    return own.surface(own.lowest(z), z) - expected_contact(p).gap


def effort(parameters: WheelRailParameters, passes: Sequence[float]) -> Effort:
    """Return the work of so many passes; the section is meshed for it."""

    def work(p: WheelRailParameters) -> Effort:
        own, turns = geometry(p), len({id(each) for each in p.block})
        return own.effort(meshed(p, own), passes, turns, scattered=p.scattered)

    return effort_of(work, parameters)


def advice(parameters: WheelRailParameters) -> Advice:
    """Return what the user can do."""
    contact = expected_contact(parameters)
    pressure = 1.5 * parameters.load / (np.pi * contact.widest * contact.along)
    found = remedies(parameters, pressure)
    if parameters.wheel_distance == "alone":
        return found
    return {**found, WindowTooSmall: "lower the load, or enlarge wheel_distance"}
