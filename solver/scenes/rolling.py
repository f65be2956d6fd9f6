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
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from solver.contact.system import System
from solver.errors import LimitLoad
from solver.fem.wheel import Wheel
from solver.loading.passes import PassResult
from solver.loading.stepper import Tally
from solver.results.free_surface import FreeSurface
from solver.results.harvest import End, Harvest, Layout
from solver.results.record import Record
from solver.results.trace import Trace, fields, shakedown
from solver.scenes.rolling_model import RollingParameters, model
from solver.scenes.scene import Monitor, Scene
from solver.scenes.settling import Settling


def layout(parameters: RollingParameters) -> Layout:
    """Return where rolling is looked at: a function of its dimensions, not of its mesh."""
    half, a = parameters.track / 2, parameters.half_width
    depth = 5 * a
    edge = math.ceil(half + 2 * a)
    return Layout(
        x=np.linspace(-edge, edge, 2 * edge * 2 + 1),
        y=-(np.arange(120) + 0.5) * depth / 120,
        depth=np.concatenate([np.linspace(0.0, 3 * a, 121), np.linspace(3.1 * a, 6 * a, 30)]),
        station=np.array([-10.0, 0.0, 10.0]) * min(1.0, parameters.track / 50.0),
        s=np.linspace(-edge, edge, 8 * edge + 1),
        profile_body="half_space",
        surfaces={"half_space": "top"},
        stages=("loaded", "mid_track", "unloaded"),
    )


def _figures(harvest: Harvest, trace: Trace, result: PassResult) -> dict[str, float]:
    """Return the figures of the last pass under mid-track that rolling is judged by."""
    assert result.mid_track is not None
    stress, strain = trace.stress, trace.strain
    depth = harvest.layout.depth
    middle = len(stress) // 2
    out = {"creepage": result.creepage, "travel": result.travel}
    for name, component in (("x", 0), ("z", 2)):
        profile = stress[middle, component]
        out[f"surface_residual_{name}"] = float(profile[0])
        out[f"lowest_residual_{name}"] = float(profile.min())
        out[f"depth_of_lowest_residual_{name}"] = float(depth[profile.argmin()])
    out |= _surface(harvest.system, result)
    out["surface_plastic_strain"] = float(strain[middle, 0])
    out["highest_plastic_strain"] = float(strain[middle].max())
    out["depth_of_highest_plastic_strain"] = float(depth[strain[middle].argmax()])
    spread = np.ptp(stress[:, [0, 2]], axis=0).max()
    out["unsteadiness"] = float(spread / max(np.abs(stress[:, [0, 2]]).max(), 1e-30))
    out["longitudinal_force"] = harvest.touch.force(result.mid_track)
    part = harvest.system.parts[0]
    if isinstance(part, Wheel):
        wheel = result.mid_track.state.u[0]
        out["axle_height"] = float(wheel[-2])
        out["axle_rotation"] = float(wheel[-1]) / part.radius
    return out


def _surface(system: System, result: PassResult) -> dict[str, float]:
    """Return residual stress at mid-track that is not extrapolated to the surface."""
    assert result.unloaded is not None
    surface = FreeSurface.of(system.full("half_space"), "top")
    response = system.response("half_space", result.unloaded)
    u = system.displacement("half_space", result.unloaded.state)
    free = surface.at(0.0, surface.stress(u, response.state.plastic_strain))
    row = surface.at(0.0, surface.first_row(response.stress))
    return {
        "first_row_residual_x": float(row[0]),
        "first_row_residual_z": float(row[1]),
        "first_row_depth": float(surface.at(0.0, surface.depth)),
        "free_surface_residual_x": float(free[0]),
        "free_surface_residual_z": float(free[1]),
    }


def beyond_strength(parameters: RollingParameters) -> LimitLoad | None:
    """Return why a prescribed shear has no equilibrium, if so.

    No stress in or inside the yield surface has a shear above the shear yield stress, and the
    traction is the stress at the surface: without hardening nothing can balance more.
    """
    shear = abs(parameters.friction * parameters.traction) * parameters.peak_pressure
    strength = parameters.yield_stress / math.sqrt(3)
    hardens = parameters.material().plastic_modulus > 0
    if parameters.load != "hertz" or hardens or shear <= strength:
        return None
    return LimitLoad(
        f"the prescribed shear, {shear:.4g} MPa, is above the shear yield stress, "
        f"{strength:.4g} MPa: no equilibrium without hardening",
        strength / shear,
        1.0,
    )


def path(
    parameters: RollingParameters, values: Sequence[float], monitor: Monitor
) -> Iterator[Record]:
    """Yield one record for each number of passes, in increasing order."""
    wanted = sorted(replace(parameters, passes=int(v)).passes for v in values)
    parameters = replace(parameters, passes=wanted[-1])
    schedule = parameters.schedule
    system = System(model(parameters))
    harvest = Harvest(system, layout(parameters))
    if error := beyond_strength(parameters):
        for n in wanted:
            end = End(tally=Tally(), error=error, scalars={"travel": 0.0})
            yield harvest.record(replace(parameters, passes=n), end)
        return
    increments = 2 * schedule.half_steps + schedule.press + schedule.release
    expected, done = increments * schedule.n, 0

    def report() -> None:
        nonlocal done
        done += 1
        monitor(min(done / expected, 0.99))

    tolerance = parameters.advance_tolerance * parameters.yield_stress
    rolled = Settling(harvest, schedule, tolerance, report)
    traces: list[Trace] = []
    for result in rolled.results():
        if result.unloaded is not None:
            traces.append(Trace.of(harvest, result))
        for n in wanted:
            if n == result.number + 1 or (result.unloaded is None and n > result.number):
                here = replace(parameters, passes=n)
                yield _record(harvest, here, result, traces, rolled)
    monitor(1.0)


def _record(
    harvest: Harvest,
    parameters: RollingParameters,
    last: PassResult,
    traces: Sequence[Trace],
    rolled: Settling,
) -> Record:
    accuracy = {"advance": rolled.advance, "advance_error": rolled.error}
    if last.unloaded is None or last.mid_track is None or last.loaded is None:
        scalars = accuracy | {"travel": last.travel}
        return harvest.record(parameters, End(tally=last.tally, error=last.error, scalars=scalars))
    cycle = parameters.schedule.cycle
    state = shakedown(
        traces, cycle, parameters.yield_stress / parameters.youngs_modulus,
        periodic=parameters.periodic, hardens=parameters.material().plastic_modulus > 0,
    )  # fmt: skip
    end_of_track = parameters.schedule.directions[-1] * parameters.track / 2
    return harvest.record(
        parameters,
        End(
            tally=last.tally,
            loaded=last.mid_track,
            unloaded=last.unloaded,
            stages=((last.loaded, end_of_track), (last.mid_track, 0.0), (last.unloaded, 0.0)),
            warnings=rolled.warnings,
            coordinates={"pass": np.arange(1, len(traces) + 1)},
            fields=fields(traces, cycle),
            scalars=_figures(harvest, traces[-1], last)
            | accuracy
            | {
                "shakedown_state": state.state,
                "steady_plastic_increment": state.accumulated,
                "steady_net_increment": state.net,
            },
        ),
    )


ROLLING = Scene(
    name="rolling",
    summary="elastic cylinder rolling on an elastic-plastic half-space, pass after pass",
    parameters=RollingParameters,
    branch="passes",
    path=path,
    refining=frozenset(
        {
            "element_size", "growth", "advance_step", "advance_tolerance", "press_steps",
            "unload_steps",
        }
    ),
)  # fmt: skip
