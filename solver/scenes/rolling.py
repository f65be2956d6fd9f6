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
from typing import Any

import numpy as np

from solver.passes import Passes, PassResult
from solver.record import Record
from solver.scenes.harvest import End, Harvest, Layout
from solver.scenes.rolling_model import RollingParameters, model
from solver.scenes.scene import Monitor, Scene
from solver.stepper import PathControl
from solver.system import System


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


def _by_pass(harvest: Harvest, done: list[PassResult]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the variables that have the pass as a dimension, and the pass coordinate."""
    profiles = [harvest.profile(r.unloaded) for r in done if r.unloaded is not None]
    strain = np.stack([p[1] for p in profiles])
    peak = [float(r.unloaded.responses[-1].state.accumulated.max()) for r in done if r.unloaded]
    fields = {
        "residual_profile": (
            ("pass", "station", "component", "depth"),
            np.stack([p[0] for p in profiles]),
        ),
        "plastic_strain_profile": (("pass", "station", "depth"), strain),
        "pass_creepage": (("pass",), np.array([r.creepage for r in done])),
        "pass_max_plastic_strain": (("pass",), np.array(peak)),
    }
    return fields, {"pass": np.arange(1, len(profiles) + 1)}


def _figures(harvest: Harvest, result: PassResult) -> dict[str, float]:
    """Return the figures of the last pass under mid-track that rolling is judged by."""
    assert result.unloaded is not None
    assert result.mid_track is not None
    stress, strain = harvest.profile(result.unloaded)
    depth = harvest.layout.depth
    middle = len(stress) // 2
    out = {"creepage": result.creepage, "travel": result.travel}
    for name, component in (("x", 0), ("z", 2)):
        profile = stress[middle, component]
        out[f"surface_residual_{name}"] = float(profile[0])
        out[f"lowest_residual_{name}"] = float(profile.min())
        out[f"depth_of_lowest_residual_{name}"] = float(depth[profile.argmin()])
    out["surface_plastic_strain"] = float(strain[middle, 0])
    out["highest_plastic_strain"] = float(strain[middle].max())
    out["depth_of_highest_plastic_strain"] = float(depth[strain[middle].argmax()])
    spread = np.ptp(stress[:, [0, 2]], axis=0).max()
    out["unsteadiness"] = float(spread / max(np.abs(stress[:, [0, 2]]).max(), 1e-30))
    if harvest.system.interfaces:
        wheel = result.mid_track.state.u[0]
        out["axle_height"] = float(wheel[-2])
        contact = result.mid_track.state.contacts[0]
        out["longitudinal_force"] = -float(contact.tangential.sum())
    return out


def path(
    parameters: RollingParameters, values: Sequence[float], monitor: Monitor
) -> Iterator[Record]:
    """Yield one record for each number of passes, in increasing order."""
    wanted = sorted(replace(parameters, passes=int(v)).passes for v in values)
    parameters = replace(parameters, passes=wanted[-1])
    schedule = parameters.schedule
    system = System(model(parameters))
    harvest = Harvest(system, layout(parameters))
    control = PathControl(load_step=1.0, max_cuts=4)
    increments = 2 * schedule.half_steps + schedule.press + schedule.release
    expected, done = increments * schedule.n, 0

    def report(load: float, message: str) -> None:
        nonlocal done
        done += 1
        monitor(min(done / expected, 0.99), message)

    results: list[PassResult] = []
    for result in Passes(system, schedule, control, report).results():
        results.append(result)
        for n in wanted:
            if n == result.number + 1 or (result.unloaded is None and n > result.number):
                yield _record(harvest, replace(parameters, passes=n), results)
    monitor(1.0, "done")


def _record(harvest: Harvest, parameters: RollingParameters, results: list[PassResult]) -> Record:
    last = results[-1]
    if last.unloaded is None or last.mid_track is None or last.loaded is None:
        scalars = {"travel": last.travel}
        return harvest.record(parameters, End(tally=last.tally, error=last.error, scalars=scalars))
    fields, coordinates = _by_pass(harvest, results)
    end_of_track = parameters.schedule.directions[-1] * parameters.track / 2
    return harvest.record(
        parameters,
        End(
            tally=last.tally,
            loaded=last.mid_track,
            unloaded=last.unloaded,
            stages=((last.loaded, end_of_track), (last.mid_track, 0.0), (last.unloaded, 0.0)),
            coordinates=coordinates,
            fields=fields,
            scalars=_figures(harvest, last),
        ),
    )


ROLLING = Scene(
    name="rolling",
    summary="elastic cylinder rolling on an elastic-plastic half-space, pass after pass",
    parameters=RollingParameters,
    branch="passes",
    path=path,
)
