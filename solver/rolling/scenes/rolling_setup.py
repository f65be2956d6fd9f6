"""The passes and the results of the rolling cylinder."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from solver.errors import ModelError, Runaway, WindowTooSmall
from solver.loading.program import Program, StepRefinement
from solver.mesh.lines import cells
from solver.results.cycles import shakedown
from solver.results.quantities import Quantity, declare
from solver.results.record import Status
from solver.results.run import FinishedRun, Values
from solver.results.shakedown import Shakedown, ShakedownState
from solver.results.view import View
from solver.rolling.plane.lines import recorded_step
from solver.rolling.results.free_surface import FreeSurface
from solver.rolling.scenes.passes import Trace, passes, profiles, shakedown_of
from solver.rolling.scenes.rolling import RollingParameters
from solver.rolling.scenes.rolling_endless import by_steady_passes
from solver.scenes.driver import by_increments
from solver.scenes.scene import Advice, Method, Monitor, Scene
from solver.typing import Array

CREEPAGE = declare("creepage", "creepage of the last pass")
TRAVEL = declare("travel", "length rolled in the last pass", "mm")
ADVANCE = declare("advance", "advance of an increment, as used", "mm")
ADVANCE_ERROR = declare(
    "advance_error",
    "estimated error of residual stress under mid-track by the advance of increments", "MPa",
)  # fmt: skip


def _of_axes(name: str, long_name: str, units: str = "MPa") -> dict[str, Quantity]:
    """Declare a variable for the residual stress xx, and for zz; ``{0}`` is the axis."""
    return {axis: declare(name.format(axis), long_name.format(axis), units) for axis in "xz"}


SURFACE = _of_axes(
    "surface_residual_{0}",
    "residual stress {0}{0} at the surface, mid-track, recovered at its nodes",
)
FIRST_ROW = _of_axes(
    "first_row_residual_{0}",
    "residual stress {0}{0} at the first row of integration points, mid-track",
)
FREE_SURFACE = _of_axes(
    "free_surface_residual_{0}",
    "residual stress {0}{0} at the surface, mid-track, by the conditions of a free surface",
)
LOWEST = _of_axes("lowest_residual_{0}", "smallest residual stress {0}{0} under mid-track")
DEPTH_OF_LOWEST = _of_axes(
    "depth_of_lowest_residual_{0}", "depth of the smallest residual stress {0}{0}", "mm"
)
FIRST_ROW_DEPTH = declare(
    "first_row_depth", "depth of the first row of integration points, mid-track", "mm"
)
SURFACE_PLASTIC_STRAIN = declare(
    "surface_plastic_strain", "equivalent plastic strain at the surface, mid-track"
)
HIGHEST_PLASTIC_STRAIN = declare(
    "highest_plastic_strain", "largest equivalent plastic strain under mid-track"
)
DEPTH_OF_HIGHEST_PLASTIC_STRAIN = declare(
    "depth_of_highest_plastic_strain",
    "depth of the largest plastic strain under mid-track", "mm",
)  # fmt: skip
UNSTEADINESS = declare(
    "unsteadiness",
    "ratio of the largest difference of residual stress between stations to the largest residual "
    "stress",
)
LONGITUDINAL_FORCE = declare(
    "longitudinal_force", "longitudinal force on the track along x, mid-track", "N"
)
AXLE_HEIGHT = declare("axle_height", "displacement of the axle at mid-track", "mm")
AXLE_ROTATION = declare(
    "axle_rotation",
    "rotation of the wheel at mid-track, counter-clockwise, from its mesh", "rad",
)  # fmt: skip


def method(parameters: RollingParameters) -> Method:
    """Return the method of the passes: steady on an endless track, else by increments."""

    def on_a_track(
        scene: Scene, runs: Sequence[RollingParameters], monitor: Monitor
    ) -> Iterator[FinishedRun]:
        if scene.derivatives:
            raise ModelError("track", runs[-1].track, "must be endless: runs have derivatives")
        return by_increments(scene, runs, monitor)

    return by_steady_passes if parameters.endless else on_a_track


def program(parameters: RollingParameters) -> Program:
    """Return the loading history of the passes."""
    return parameters.schedule.program


def refinement(parameters: RollingParameters) -> StepRefinement | None:
    """Return how the advance is halved until residual stress converges, or None."""
    tolerance = parameters.advance_tolerance * parameters.yield_stress

    def under_mid_track(trace: Trace) -> Array:
        return trace.stress[len(trace.stress) // 2, [0, 2]]

    return StepRefinement(measure=under_mid_track, tolerance=tolerance) if tolerance else None


def progress(run: FinishedRun) -> Values:
    """Return the length rolled in the last pass, the advance of its increments and its error."""
    if run.parameters.endless:
        return {}
    schedule, settled = run.parameters.schedule, run.outcome.settled
    return {
        TRAVEL: schedule.travel(run.outcome.last.state.time),
        ADVANCE: schedule.increment / settled.times,
        ADVANCE_ERROR: settled.error,
    }


def profile_figures(run: FinishedRun) -> Values:
    """Return the figures of the last pass under mid-track."""
    trace: Trace = run.outcome.traces[-1]
    stress, strain = trace.stress, trace.strain
    depth = run.view.depth
    middle = len(stress) // 2
    out: dict[Quantity, float] = {CREEPAGE: trace.creepage}
    for axis, component in (("x", 0), ("z", 2)):
        profile = stress[middle, component]
        out[SURFACE[axis]] = float(profile[0])
        out[LOWEST[axis]] = float(profile.min())
        out[DEPTH_OF_LOWEST[axis]] = float(depth[profile.argmin()])
    out[SURFACE_PLASTIC_STRAIN] = float(strain[middle, 0])
    out[HIGHEST_PLASTIC_STRAIN] = float(strain[middle].max())
    out[DEPTH_OF_HIGHEST_PLASTIC_STRAIN] = float(depth[strain[middle].argmax()])
    spread = np.ptp(stress[:, [0, 2]], axis=0).max()
    out[UNSTEADINESS] = float(spread / max(np.abs(stress[:, [0, 2]]).max(), 1e-30))
    return out


def wheel(run: FinishedRun) -> Values:
    """Return the longitudinal force at mid-track, and height and rotation of a wheel."""
    acting = run.acting(run.loaded)
    out: dict[Quantity, float] = {LONGITUDINAL_FORCE: acting.force}
    if (hub := acting.axle) is not None:
        out |= {AXLE_HEIGHT: hub.y, AXLE_ROTATION: hub.rotation}
    return out


def surface(run: FinishedRun) -> Values:
    """Return residual stress at and near the surface at mid-track, without extrapolation."""
    found = FreeSurface.of(run.system.full("half_space"), "top")
    left = run.system.state("half_space", run.unloaded)
    free = found.at(0.0, found.stress(left.u, left.plastic.plastic_strain))
    row = found.at(0.0, found.first_row(left.stress))
    return {
        **{FIRST_ROW[axis]: float(value) for axis, value in zip("xz", row, strict=True)},
        FIRST_ROW_DEPTH: float(found.at(0.0, found.depth)),
        **{FREE_SURFACE[axis]: float(value) for axis, value in zip("xz", free, strict=True)},
    }


def cycles(run: FinishedRun) -> Values:
    """Return the results of every pass, and the shakedown state that the passes approach."""
    parameters, traces = run.parameters, run.outcome.traces
    return {
        **passes(traces, parameters.cycle),
        **profiles(traces, parameters.cycle),
        **shakedown(state_of(parameters, traces)),
    }


def state_of(parameters: RollingParameters, traces: Sequence[Trace]) -> Shakedown:
    """Return the shakedown state that passes over a half-space approach.

    On a track with ends a body that yields stays undecided: the ends constrain the layer that
    ratchetting moves, so that the cycle seems closed.
    """
    found = shakedown_of(parameters, traces, parameters.cycle)
    if parameters.endless or found.state is ShakedownState.ELASTIC:
        return found
    return replace(found, state=ShakedownState.UNDECIDED)


def warnings(run: FinishedRun) -> tuple[str, ...]:
    """Return a warning if the error by the advance is above its tolerance or unknown."""
    settled, tolerance = run.outcome.settled, refinement(run.parameters)
    if run.parameters.endless or tolerance is None or settled.error <= tolerance.tolerance:
        return ()
    advance = run.parameters.schedule.increment
    known = not np.isnan(settled.error)
    error = f"an error of {settled.error:.3g} MPa" if known else "an unknown error"
    failed = f"; one of {advance / settled.failed:.3g} mm failed" if settled.failed else ""
    return (
        f"an advance of {advance / settled.times:.3g} mm still leaves {error}, "
        f"above the tolerance of {tolerance.tolerance:.3g} MPa{failed}: "
        "reduce advance_step or raise advance_tolerance",
    )


def advice(parameters: RollingParameters) -> Advice:
    """Return what the user can do; on an endless track nothing advances by steps."""
    return {
        Status.LIMIT_LOAD: "lower load_ratio or traction, or let the material harden",
        Runaway: "lower load_ratio or traction",
        WindowTooSmall: "lower load_ratio",
        Status.NOT_CONVERGED: "refine the mesh by element_size"
        if parameters.endless
        else "reduce advance_step",
    }


_EXTENT = 4.0
"""Largest x of results on an endless track, over the Hertz half-width."""


def view(parameters: RollingParameters) -> View:
    """Return the positions of results, which depend on dimensions and not on the mesh."""
    p, a = parameters, parameters.widest.half_width
    own: dict[str, Any] = {"stages": ("loaded", "unloaded")}
    if p.endless:
        x, s = (a * np.linspace(-_EXTENT, _EXTENT, count) for count in (161, 641))
        station = np.zeros(1)
    else:
        edge = math.ceil(p.length / 2 + max(2 * a, p.spread))
        places = round(edge / recorded_step(a))
        x, s = (np.linspace(-edge, edge, count) for count in (places + 1, 2 * places + 1))
        station = np.array([-10.0, 0.0, 10.0]) * min(1.0, p.length / 50.0)
        own = {
            "stages": ("loaded", "mid_track", "unloaded"), "loaded": "mid_track",
            "following": ("loaded",),
        }  # fmt: skip
    return View(
        x=x,
        y=-cells(5 * a, smallest=a / 64, ratio=1.05, largest=a / 16),
        depth=np.concatenate([np.linspace(0.0, 3 * a, 121), np.linspace(3.1 * a, 6 * a, 30)]),
        station=station,
        s=s,
        profile_body="half_space",
        surfaces={"half_space": "top"},
        **own,
    )
