"""Residual stress and plastic strain after each pass, and their changes over a cycle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from solver.contact.state import Converged
from solver.results.fields import Bodies, Solved
from solver.results.maps import PROFILE_PLASTIC_STRAIN, RESIDUAL_PROFILE
from solver.results.quantities import declare
from solver.results.run import Values
from solver.results.samples import Samples
from solver.results.shakedown import Shakedown, ShakedownState, classify
from solver.rolling.scenes.rolling_parameters import RollingParameters
from solver.typing import Array

_EACH = ("pass",)

PASS = declare("pass", "number of the pass", dims=_EACH, count=True)
PLASTIC_FLOW_PROFILE = declare(
    "plastic_flow_profile", "signed plastic strain along depth",
    dims=("station", "component", "depth"),
)  # fmt: skip
PASS_CREEPAGE = declare(
    "pass_creepage", "creepage of a pass: 1 + R d(rotation) / d(advance)", dims=_EACH
)
PASS_MAX_PLASTIC_STRAIN = declare(
    "pass_max_plastic_strain", "largest equivalent plastic strain after a pass", dims=_EACH
)
PASS_PLASTIC_INCREMENT = declare(
    "pass_plastic_increment",
    "largest equivalent plastic strain accumulated in a cycle, mid-track", dims=_EACH,
)  # fmt: skip
PASS_NET_INCREMENT = declare(
    "pass_net_increment",
    "largest equivalent of the signed plastic strain a cycle leaves, mid-track", dims=_EACH,
)  # fmt: skip
PASS_NET_SHEAR = declare(
    "pass_net_shear", "largest plastic shear (engineering) a cycle leaves, mid-track", dims=_EACH
)
PASS_SURFACE_ADVANCE = declare(
    "pass_surface_advance", "displacement along x a cycle gives the surface", "mm", dims=_EACH
)


@dataclass(frozen=True, slots=True)
class Trace:
    """Results of one pass at the stations of a view.

    Attributes
    ----------
    stress : (station, 4, depth) residual stress, tensor components [MPa]
    strain : (station, depth) equivalent plastic strain
    flow : (station, 4, depth) signed plastic strain, tensor components
    surface : (2, station) displacement of the surface [mm]
    creepage : 1 + R d(rotation) / d(advance) over the second half of the track
    peak : largest equivalent plastic strain in the half-space
    """

    stress: Array
    strain: Array
    flow: Array
    surface: Array
    creepage: float
    peak: float

    @classmethod
    def of(cls, samples: Samples, points: Mapping[str, Converged]) -> Trace:
        """Return the trace of a pass from its states ``mid_track``, ``loaded``, ``unloaded``."""
        left = points["unloaded"]
        return cls(
            samples.profile("stress", left).swapaxes(0, 1),
            samples.profile("plastic_strain", left),
            samples.flow(left).swapaxes(0, 1),
            samples.profile("displacement", left)[:, :, 0],
            _creepage(samples.system, points["mid_track"], points["loaded"]),
            float(left.responses[-1].state.accumulated.max()),
        )


def _creepage(bodies: Bodies, first: Solved, last: Solved) -> float:
    """Return the creepage of the wheel between two states, NaN without a wheel."""
    before, now = bodies.axle(first), bodies.axle(last)
    if before is None or now is None:
        return np.nan
    axle = bodies.full("wheel").body.axle
    assert axle is not None
    return 1 + axle.radius * (now.rotation - before.rotation) / (now.x - before.x)


def passes(traces: Sequence[Trace], cycle: int) -> Values:
    """Return the variables over passes; increments are those of the cycle that ends with a pass."""
    middle = len(traces[0].strain) // 2
    accumulated, left = _increments(traces, cycle)
    shear = 2 * left[:, 3]
    largest = np.abs(shear).argmax(axis=1)
    surface = np.stack([t.surface[0, middle] for t in traces])
    return {
        PASS: np.arange(1, len(traces) + 1),
        RESIDUAL_PROFILE.over("pass"): np.stack([t.stress for t in traces]),
        PROFILE_PLASTIC_STRAIN.over("pass"): np.stack([t.strain for t in traces]),
        PLASTIC_FLOW_PROFILE.over("pass"): np.stack([t.flow for t in traces]),
        PASS_CREEPAGE: np.array([t.creepage for t in traces]),
        PASS_MAX_PLASTIC_STRAIN: np.array([t.peak for t in traces]),
        PASS_PLASTIC_INCREMENT: accumulated.max(axis=1),
        PASS_NET_INCREMENT: _equivalent(left).max(axis=1),
        PASS_NET_SHEAR: shear[np.arange(len(shear)), largest],
        PASS_SURFACE_ADVANCE: _differences(surface, cycle),
    }


def shakedown_of(parameters: RollingParameters, traces: Sequence[Trace]) -> Shakedown:
    """Return the shakedown state that the passes tend to.

    On a track with ends a body that yields stays undecided: the ends constrain the layer that
    ratchetting moves, so that the cycle seems closed.
    """
    cycle, yield_strain = parameters.cycle, parameters.yield_stress / parameters.youngs_modulus
    hardens = parameters.material().hardens
    accumulated, left = _increments(traces, cycle)
    last = slice((len(traces) - 1) % cycle, None, cycle)
    found = classify(accumulated[last], _equivalent(left)[last], yield_strain, hardens=hardens)
    if parameters.endless or found.state is ShakedownState.ELASTIC:
        return found
    return Shakedown(ShakedownState.UNDECIDED, found.accumulated, found.net)


def _increments(traces: Sequence[Trace], cycle: int) -> tuple[Array, Array]:
    """Return accumulated (pass, depth) and signed (pass, 4, depth) plastic strain of a cycle."""
    middle = len(traces[0].strain) // 2
    accumulated = np.stack([t.strain[middle] for t in traces])
    flow = np.stack([t.flow[middle] for t in traces])
    return _differences(accumulated, cycle), _differences(flow, cycle)


def _differences(values: Array, cycle: int) -> Array:
    """Return the changes of values (pass, ...) over a cycle; values before the first are zero."""
    before = np.concatenate([np.zeros((cycle, *values.shape[1:])), values[:-cycle]])
    return values - before[: len(values)]


def _equivalent(flow: Array) -> Array:
    """Return the equivalent (pass, depth) of signed strain (pass, 4, depth), tensor components."""
    square = (flow[:, :3] ** 2).sum(axis=1) + 2 * flow[:, 3] ** 2
    return np.asarray(np.sqrt(2 / 3 * square))
