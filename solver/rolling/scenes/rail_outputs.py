"""Results of rolling over a prism: the contact, the section of the prism, and its passes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from enum import IntEnum
from typing import Any

import numpy as np
import scipy

from solver.errors import NoContact, Runaway, WindowTooSmall
from solver.materials.law import Law
from solver.model.friction import PatchStatus
from solver.results.cycles import shakedown
from solver.results.quantities import declare
from solver.results.record import Status
from solver.results.run import FinishedRun, Values
from solver.results.shakedown import ShakedownState
from solver.rolling.rail.section import Section
from solver.rolling.scenes.passes import mean_added, passes, shakedown_of
from solver.rolling.scenes.rail_scene import PrismParameters
from solver.rolling.scenes.rolling_setup import CREEPAGE, LONGITUDINAL_FORCE
from solver.scenes.scene import Advice
from solver.scenes.sketch import Sketch
from solver.typing import Array

_PATCH = ("x", "z")
PATCH_PRESSURE = declare(
    "patch_pressure", "contact pressure on the running surface", "MPa", dims=_PATCH
)
_WAYS = (("x", "along x"), ("z", "across it"))
PATCH_SHEAR = {
    axis: declare(
        f"patch_shear_{axis}", f"contact shear on the running surface {way}", "MPa", dims=_PATCH
    )
    for axis, way in _WAYS
}
PATCH_SLIP = {
    axis: declare(
        f"patch_slip_{axis}",
        f"slip of the running surface over the wheel {way}, per advance", dims=_PATCH,
    )
    for axis, way in _WAYS
}  # fmt: skip
PATCH_STATUS = declare(
    "patch_status", "whether the surfaces are open, stick or slip", dims=_PATCH, flags=PatchStatus
)
PEAK_PATCH_PRESSURE = declare(
    "peak_patch_pressure", "largest contact pressure on the running surface", "MPa"
)
PEAK_PATCH_PRESSURE_Z = declare(
    "peak_patch_pressure_z", "position z of the largest contact pressure", "mm"
)
PATCH_AREA = declare("patch_area", "area of the contact", "mm2")
PATCH_LEFT = declare("patch_left", "smallest z of the contact", "mm")
PATCH_RIGHT = declare("patch_right", "largest z of the contact", "mm")
LATERAL_FORCE = declare("lateral_force", "contact force along z", "N")
RUNNING_SURFACE_RESIDUAL = declare(
    "running_surface_residual", "residual stress at the running surface, at its nodes, over z",
    "MPa", dims=("component", "z"),
)  # fmt: skip
LOWEST_LOADED = declare(
    "lowest_loaded", "smallest stress around the load, at integration points", "MPa",
    dims=("component",),
)  # fmt: skip
HIGHEST_MISES = declare("highest_mises", "largest von Mises stress at x = 0 under the load", "MPa")
HIGHEST_MISES_DEPTH = declare(
    "highest_mises_depth", "depth below the surface of the largest von Mises stress", "mm"
)
MOST_STRAINED_Z = declare("most_strained_z", "position z of the largest plastic strain", "mm")
LEAST_YIELDED_DEPTH = declare(
    "least_yielded_depth", "least depth below the surface of a point that has yielded", "mm"
)
MOST_YIELDED_DEPTH = declare(
    "most_yielded_depth", "largest depth below the surface of a point that has yielded", "mm"
)
PASS_RESIDUAL_MIN = declare(
    "pass_residual_min", "smallest residual stress after a pass, at points of the zone", "MPa",
    dims=("component", "pass"),
)  # fmt: skip
MEAN_PLASTIC_INCREMENT = declare(
    "mean_plastic_increment",
    "largest equivalent plastic strain accumulated in a pass, its mean over the last passes",
)
MEAN_NET_INCREMENT = declare(
    "mean_net_increment",
    "largest equivalent of the signed plastic strain left by a pass, mean over the last passes",
)


class ComputedAccuracy(IntEnum):
    """The accuracy with which a run was computed, with its stored value."""

    DRAFT = 0
    STANDARD = 1
    FINE = 2


COMPUTED_ACCURACY = declare(
    "computed_accuracy",
    "accuracy of the elements with which the run was computed",
    flags=ComputedAccuracy,
)
_AVERAGED = 100
"""Largest number of passes in a mean over the last passes; it is at most half of all."""
_YIELDED = 1e-6
"""Plastic strain above which a point counts as yielded."""


def sketched(name: str, section: Section, law: Law, curves: Mapping[str, Array]) -> Sketch:
    """Return the section of a prism of a law, and curves (2, n) of what rolls on it, in z and y."""
    body = replace(section.plane.body, name=name, material=law)
    return Sketch((body,), springs={body.name: [*section.springs]}, curves=curves)


def accuracy(run: FinishedRun) -> Values:
    """Return the accuracy that was computed: another than asked for where that one was lost."""
    return {COMPUTED_ACCURACY: ComputedAccuracy[run.parameters.accuracy.upper()]}


def patch(run: FinishedRun) -> Values:
    """Return pressure, shear and slip on the contact, its forces, its size, and the creepage.

    Slip and status are those of the nearest station and vertex; slip is NaN in open places.
    """
    contact: Any = run.outcome.points[run.view.loaded].touching
    grid, pressure = contact.grid, contact.pressure
    X, Z = np.meshgrid(run.view.x, run.view.z, indexing="ij")
    places = _widened(grid.x[::-1]), _widened(grid.z)

    def sampled(values: Array, method: str = "linear", outside: float = 0.0) -> Array:
        at = scipy.interpolate.RegularGridInterpolator(
            places, values[::-1], method, bounds_error=False, fill_value=outside
        )
        return np.asarray(at((X, Z)))

    closed = contact.status != PatchStatus.OPEN
    slip = np.where(closed[..., None], contact.slip / grid.spacing, np.nan)
    touched = grid.z[closed.any(axis=0)]
    force = contact.force
    return {
        PATCH_PRESSURE: sampled(pressure),
        PATCH_SHEAR["x"]: sampled(contact.shear[..., 0]),
        PATCH_SHEAR["z"]: sampled(contact.shear[..., 1]),
        PATCH_SLIP["x"]: sampled(slip[..., 0], "nearest", np.nan),
        PATCH_SLIP["z"]: sampled(slip[..., 1], "nearest", np.nan),
        PATCH_STATUS: sampled(contact.status.astype(float), "nearest").astype(np.int32),
        PEAK_PATCH_PRESSURE: float(pressure.max()),
        PEAK_PATCH_PRESSURE_Z: float(grid.z[pressure.max(axis=0).argmax()]),
        PATCH_AREA: float((closed * grid.area).sum()),
        PATCH_LEFT: float(touched[0]),
        PATCH_RIGHT: float(touched[-1]),
        CREEPAGE: contact.creepage,
        LONGITUDINAL_FORCE: float(force[0]),
        LATERAL_FORCE: float(force[2]),
    }


def _widened(places: Array) -> Array:
    """Return rising places, the outermost moved out by rounding to include them."""
    ends = 1e-9 * (places[-1] - places[0]) * np.array([-1.0, 1.0])
    return np.concatenate([places[:1] + ends[0], places[1:-1], places[-1:] + ends[1]])


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
    depth = run.view.below(X)
    yielded = depth[accumulated > _YIELDED]
    most = int(np.nanargmax(mises))
    return {
        RUNNING_SURFACE_RESIDUAL: np.stack(at_surface),
        LOWEST_LOADED: loaded.lowest,
        HIGHEST_MISES: float(mises[most]),
        HIGHEST_MISES_DEPTH: float(depth[most]),
        MOST_STRAINED_Z: float(X[2, accumulated.argmax()]) if len(yielded) else np.nan,
        LEAST_YIELDED_DEPTH: float(yielded.min()) if len(yielded) else np.nan,
        MOST_YIELDED_DEPTH: float(yielded.max()) if len(yielded) else np.nan,
    }


FINER = {"draft": "standard", "standard": "fine"}
"""The next finer accuracy."""


def finer(parameters: PrismParameters) -> str:
    """Return the advice to choose the next finer accuracy; empty if there is none."""
    own = FINER.get(parameters.accuracy, "")
    return f"choose accuracy = {own}" if own else ""


def remedies(parameters: PrismParameters, pressure: float) -> Advice:
    """Return what the user can do, given the peak pressure of the elastic contact [MPa].

    Where friction carries more shear than the body does, it flows at its surface: no contact is
    found on any mesh.
    """
    strength, friction = parameters.material().shear_yield_stress, parameters.friction
    coulomb = getattr(parameters, "friction_law", "coulomb") == "coulomb"
    unlimited = coulomb and not getattr(parameters, "shear_limit", 0.0)
    beyond = unlimited and friction * pressure > strength
    shear = f"friction would carry {friction * pressure:.0f} MPa, more than the shear yield stress"
    limited = f"{shear} of {strength:.0f} MPa: set shear_limit = 1"
    accuracy = finer(parameters) or "lower load or traction"
    return {
        Status.LIMIT_LOAD: "lower load or traction, or let the material harden",
        Runaway: "lower load or traction",
        WindowTooSmall: "lower the load",
        NoContact: limited if beyond else accuracy,
        Status.NOT_CONVERGED: accuracy,
        "audit_contact_resolution": accuracy,
        Status.AUDIT_FAILED: limited if beyond else accuracy,
    }


def undecided(run: FinishedRun) -> tuple[str, ...]:
    """Return what to do if the shakedown state is not known after several passes."""
    traces, cycle = run.outcome.traces, getattr(run.parameters, "cycle", 1)
    if cycle is None or len(traces) < 2:  # a load that never repeats itself decides no state
        return ()
    if shakedown_of(run.parameters, traces, cycle).state is not ShakedownState.UNDECIDED:
        return ()
    return (f"the shakedown state is undecided after {len(traces)} passes: raise passes",)


def cycles(run: FinishedRun, cycle: int | None = 1) -> Values:
    """Return the figures of every pass, and the shakedown state that the passes tend to.

    Parameters
    ----------
    cycle : number of passes after which the loading repeats itself; increments are those of the
        cycle that ends with a pass. With None it never repeats: increments are those of a pass
    """
    traces = run.outcome.traces
    mean, mean_net = mean_added(traces, _AVERAGED)
    return {
        **passes(traces, cycle or 1),
        **shakedown(shakedown_of(run.parameters, traces, cycle)),
        PASS_RESIDUAL_MIN: np.stack([t.lowest for t in traces], axis=1),
        MEAN_PLASTIC_INCREMENT: mean,
        MEAN_NET_INCREMENT: mean_net,
    }
