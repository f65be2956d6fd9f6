"""Railway wheel rolling along a rail, in three dimensions.

The rail is a 60E1, elastic-plastic in a zone under the contact, without ends, on an elastic
foundation. The wheel is an elastic half-space with the shape of its profile. Passes are steady: in
the frame of the wheel nothing changes. Coordinates are x along the rail, y up from the top of the
rail, z across it to the outside of the track; x = 0 is at the wheel. A positive ``traction``
brakes.

P. Marek, PhD thesis, Warsaw University of Technology (1995), chapter 6.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from solver.results.extremes import residual_extremes
from solver.results.figures import cost, extremes
from solver.results.maps import maps, profiles
from solver.results.quantities import declare
from solver.results.record import Status
from solver.results.shakedown import classify
from solver.results.view import ACROSS_TRACK, View
from solver.scenes.effort import Effort
from solver.scenes.passes import (
    PASS,
    PASS_CREEPAGE,
    PASS_MAX_PLASTIC_STRAIN,
    PASS_NET_INCREMENT,
    PASS_PLASTIC_INCREMENT,
    PASS_SURFACE_ADVANCE,
)
from solver.scenes.rolling import (
    AXLE_HEIGHT,
    CREEPAGE,
    LONGITUDINAL_FORCE,
    SHAKEDOWN_STATE,
    STEADY_NET_INCREMENT,
    STEADY_PLASTIC_INCREMENT,
)
from solver.scenes.scene import Method, Scene
from solver.scenes.wheel_rail_parameters import WheelRailParameters

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.results.run import FinishedRun, Values

    Array = NDArray[np.float64]

_HALF_HEAD, _MAPPED, _ALONG = 36.0, 16.0, 20.0
"""Half the width of maps, their depth, and half their length along the rail [mm]."""
_PIXEL = 0.5
"""Distance of positions of maps across and along [mm]; in depth it is half of that."""

_PATCH = ("x", "z")
PATCH_PRESSURE = declare(
    "patch_pressure", "contact pressure of the wheel on the rail", "MPa", dims=_PATCH
)
PATCH_SHEAR = {
    "x": declare("patch_shear_x", "contact shear on the rail along x", "MPa", dims=_PATCH),
    "z": declare("patch_shear_z", "contact shear on the rail across it", "MPa", dims=_PATCH),
}
PEAK_PATCH_PRESSURE = declare("peak_patch_pressure", "largest contact pressure on the rail", "MPa")
PEAK_PATCH_PRESSURE_Z = declare(
    "peak_patch_pressure_z", "position across the rail of the largest contact pressure", "mm"
)
PATCH_AREA = declare("patch_area", "area of the contact of wheel and rail", "mm2")
PATCH_LEFT = declare("patch_left", "smallest z of the contact", "mm")
PATCH_RIGHT = declare("patch_right", "largest z of the contact", "mm")
LATERAL_FORCE = declare("lateral_force", "force of the wheel on the rail along z", "N")
RUNNING_SURFACE_RESIDUAL = declare(
    "running_surface_residual", "residual stress at the running surface, at its nodes, over z",
    "MPa", dims=("component", "z"),
)  # fmt: skip
LOWEST_LOADED = declare(
    "lowest_loaded", "smallest stress around the wheel, at integration points", "MPa",
    dims=("component",),
)  # fmt: skip
HIGHEST_MISES = declare("highest_mises", "largest von Mises stress at x = 0 under the wheel", "MPa")
HIGHEST_MISES_DEPTH = declare(
    "highest_mises_depth", "depth below the top of the largest von Mises stress", "mm"
)
MOST_STRAINED_Z = declare(
    "most_strained_z", "position across the rail of the largest plastic strain", "mm"
)
LEAST_YIELDED_DEPTH = declare(
    "least_yielded_depth", "depth below the top of the highest point that has yielded", "mm"
)
MOST_YIELDED_DEPTH = declare(
    "most_yielded_depth", "depth below the top of the deepest point that has yielded", "mm"
)
_YIELDED = 1e-6
"""Plastic strain above which a point counts as yielded."""


def method(parameters: WheelRailParameters) -> Method:
    """Return the method of the passes."""
    del parameters
    from solver.scenes.wheel_rail_passes import by_passes  # loads scipy

    return by_passes


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


def patch(run: FinishedRun) -> Values:
    """Return pressure and shear on the contact, its forces, its size, and the creepage."""
    from scipy.interpolate import RegularGridInterpolator

    contact: Any = run.outcome.points[run.view.loaded].touching
    grid, pressure = contact.grid, contact.pressure
    X, Z = np.meshgrid(run.view.x, run.view.z, indexing="ij")

    def sampled(values: Array) -> Array:
        at = RegularGridInterpolator(
            (grid.x[::-1], grid.z), values[::-1], bounds_error=False, fill_value=0.0
        )
        return np.asarray(at((X, Z)))

    closed = contact.status != 0
    touched = grid.z[closed.any(axis=0)]
    force = contact.force
    return {
        PATCH_PRESSURE: sampled(pressure),
        PATCH_SHEAR["x"]: sampled(contact.shear[..., 0]),
        PATCH_SHEAR["z"]: sampled(contact.shear[..., 1]),
        PEAK_PATCH_PRESSURE: float(pressure.max()),
        PEAK_PATCH_PRESSURE_Z: float(grid.z[pressure.max(axis=0).argmax()]),
        PATCH_AREA: float((closed * grid.area).sum()),
        PATCH_LEFT: float(touched[0]),
        PATCH_RIGHT: float(touched[-1]),
        CREEPAGE: contact.creepage,
        LONGITUDINAL_FORCE: float(force[0]),
        LATERAL_FORCE: float(force[2]),
        AXLE_HEIGHT: contact.height + _touching(run.parameters),
    }


def _touching(parameters: WheelRailParameters) -> float:
    """Return the gap of the undeformed bodies at height 0 [mm]."""
    from solver.scenes.wheel_rail_track import expected_contact

    return expected_contact(parameters).gap


def section(run: FinishedRun) -> Values:
    """Return stress under the load, residual stress at the surface, and where the rail yielded."""
    name = run.view.profile_body
    body = run.system.full(name)
    nodes = body.boundary_nodes(run.view.surfaces[name])
    nodes = nodes[np.argsort(body.X[2, nodes])]
    stress = run.samples.fields.at_nodes(run.unloaded, name).stress[:, nodes]
    at_surface = [
        np.interp(run.view.z, body.X[2, nodes], each, left=np.nan, right=np.nan) for each in stress
    ]
    X, mises, _ = run.samples.fields.at_points(run.loaded, name)
    accumulated = run.samples.fields.at_points(run.unloaded, name)[2]
    loaded: Any = run.loaded
    yielded = -X[1, accumulated > _YIELDED]
    most = int(np.nanargmax(mises))
    return {
        RUNNING_SURFACE_RESIDUAL: np.stack(at_surface),
        LOWEST_LOADED: loaded.lowest,
        HIGHEST_MISES: float(mises[most]),
        HIGHEST_MISES_DEPTH: float(-X[1, most]),
        MOST_STRAINED_Z: float(X[2, accumulated.argmax()]) if len(yielded) else np.nan,
        LEAST_YIELDED_DEPTH: float(yielded.min()) if len(yielded) else np.nan,
        MOST_YIELDED_DEPTH: float(yielded.max()) if len(yielded) else np.nan,
    }


def cycles(run: FinishedRun) -> Values:
    """Return the figures of every pass, and the shakedown state that the passes tend to."""
    p, traces = run.parameters, run.outcome.traces
    nothing = np.zeros_like(traces[0].accumulated), np.zeros_like(traces[0].plastic_strain)
    accumulated = np.diff(np.stack([nothing[0], *(t.accumulated for t in traces)]), axis=0)
    flow = np.diff(np.stack([nothing[1], *(t.plastic_strain for t in traces)]), axis=0)
    net = np.sqrt(2 / 3 * (flow**2).sum(axis=2))
    material = p.material()
    yield_strain = p.yield_stress / p.youngs_modulus
    found = classify(accumulated, net, yield_strain, hardens=material.hardens)
    return {
        PASS: np.arange(1, len(traces) + 1),
        PASS_CREEPAGE: np.array([t.creepage for t in traces]),
        PASS_MAX_PLASTIC_STRAIN: np.array([t.accumulated.max() for t in traces]),
        PASS_PLASTIC_INCREMENT: accumulated.max(axis=1),
        PASS_NET_INCREMENT: net.max(axis=1),
        PASS_SURFACE_ADVANCE: np.diff([0.0, *(t.surface for t in traces)]),
        SHAKEDOWN_STATE: found.state,
        STEADY_PLASTIC_INCREMENT: found.accumulated,
        STEADY_NET_INCREMENT: found.net,
    }


def effort(parameters: WheelRailParameters, passes: Sequence[float]) -> Effort:
    """Return the work of so many passes; the section is meshed for it."""
    from solver.scenes.wheel_rail_track import geometry, section_of

    section, count = section_of(geometry(parameters)), int(max(passes))
    return Effort(
        elements=len(section.weights),
        unknowns=len(section.free),
        increments=count,
        most_increments=count,
    )


WHEEL_RAIL = Scene(
    name="wheel_rail",
    summary="railway wheel rolling along an elastic-plastic rail, in three dimensions",
    parameters=WheelRailParameters,
    branch="passes",
    method=method,
    view=view,
    outputs=(maps, profiles, residual_extremes, extremes, patch, section, cycles),
    costs=(cost,),
    effort=effort,
    advice={
        Status.LIMIT_LOAD: "lower load or traction, or let the material harden",
        Status.NOT_CONVERGED: "lower load or traction, or choose another accuracy or position",
    },
)
