"""The state after each pass, its change over a cycle, and the shakedown state of the passes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from solver.contact.state import Converged
from solver.contact.system import System
from solver.results.acting import axle_of
from solver.results.fields import Samples
from solver.results.maps import PROFILE_PLASTIC_STRAIN, RESIDUAL_PROFILE
from solver.results.quantities import declare
from solver.results.run import Values
from solver.results.shakedown import Shakedown, ShakedownState, classify
from solver.tensors import SQRT2, to_mandel
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


@dataclass(frozen=True, slots=True, kw_only=True)
class PassTrace:
    """The state after a pass at n points: along depth under mid-track, or in the zone of a prism.

    Attributes
    ----------
    accumulated : (n,) equivalent plastic strain
    plastic_strain : (n, n_components) signed plastic strain, Mandel
    creepage : creepage of the wheel; by increments over the second half of the track
    surface : displacement of the surface along x [mm]
    peak : largest equivalent plastic strain in the body
    """

    accumulated: Array
    plastic_strain: Array
    creepage: float
    surface: float
    peak: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Trace(PassTrace):
    """The state after a pass over a half-space, also at the stations of a view.

    Attributes
    ----------
    stress : (station, 4, depth) residual stress, tensor components [MPa]
    strain : (station, depth) equivalent plastic strain
    flow : (station, 4, depth) signed plastic strain, tensor components
    """

    stress: Array
    strain: Array
    flow: Array

    @classmethod
    def at(
        cls, stress: Array, strain: Array, flow: Array, surface: Array, creepage: float, peak: float
    ) -> Trace:
        """Return the trace from values at all stations; ``surface`` (station,) is along x."""
        middle = len(strain) // 2
        return cls(
            accumulated=strain[middle], plastic_strain=to_mandel(flow[middle]).T,
            creepage=creepage, surface=float(surface[middle]), peak=peak,
            stress=stress, strain=strain, flow=flow,
        )  # fmt: skip

    @classmethod
    def of(cls, samples: Samples, points: Mapping[str, Converged]) -> Trace:
        """Return the trace of a pass from its states ``mid_track``, ``loaded``, ``unloaded``."""
        left = points["unloaded"]
        return cls.at(
            samples.profile("stress", left).swapaxes(0, 1),
            samples.profile("plastic_strain", left),
            samples.flow(left).swapaxes(0, 1),
            samples.profile("displacement", left)[0, :, 0],
            _creepage(samples, points["mid_track"], points["loaded"]),
            float(left.responses[-1].state.accumulated.max()),
        )


def _creepage(samples: Samples, first: Converged, last: Converged) -> float:
    """Return the creepage of the wheel between two states, NaN without a wheel."""
    assert isinstance(samples.system, System)
    begun, ended = axle_of(samples.system, first), axle_of(samples.system, last)
    if begun is None or ended is None:
        return np.nan
    (wheel, before), (_, now) = begun, ended
    return 1 + wheel.axle.radius * (now.rotation - before.rotation) / (now.x - before.x)


def passes(traces: Sequence[PassTrace], cycle: int) -> Values:
    """Return the variables over passes; increments are those of the cycle that ends with a pass."""
    added = [added_by(traces, number, cycle) for number in range(len(traces))]
    surface = np.array([t.surface for t in traces])
    before = np.concatenate([np.zeros(cycle), surface])[: len(surface)]
    return {
        PASS: np.arange(1, len(traces) + 1),
        PASS_CREEPAGE: np.array([t.creepage for t in traces]),
        PASS_MAX_PLASTIC_STRAIN: np.array([t.peak for t in traces]),
        PASS_PLASTIC_INCREMENT: np.array([accumulated.max() for accumulated, _ in added]),
        PASS_NET_INCREMENT: np.array([_equivalent(left).max() for _, left in added]),
        PASS_SURFACE_ADVANCE: surface - before,
    }


def profiles(traces: Sequence[Trace], cycle: int) -> Values:
    """Return the variables over passes and depth, and the shear after each cycle."""
    each = (added_by(traces, number, cycle)[1] for number in range(len(traces)))
    shear = np.array([SQRT2 * left[:, 3] for left in each])
    largest = np.abs(shear).argmax(axis=1)
    return {
        RESIDUAL_PROFILE.over("pass"): np.stack([t.stress for t in traces]),
        PROFILE_PLASTIC_STRAIN.over("pass"): np.stack([t.strain for t in traces]),
        PLASTIC_FLOW_PROFILE.over("pass"): np.stack([t.flow for t in traces]),
        PASS_NET_SHEAR: shear[np.arange(len(shear)), largest],
    }


def shakedown_of(parameters: Any, traces: Sequence[PassTrace], cycle: int | None) -> Shakedown:
    """Return the shakedown state that passes approach, of a material with these parameters.

    Parameters
    ----------
    cycle : number of passes after which the loading repeats itself. With None it never does: if
        anything yields, no state is decided
    """
    length = cycle or 1
    ends = range((len(traces) - 1) % length, len(traces), length)
    last = [added_by(traces, number, length) for number in ends]
    found = classify(
        np.stack([accumulated for accumulated, _ in last]),
        np.stack([_equivalent(left) for _, left in last]),
        parameters.yield_stress / parameters.youngs_modulus,
        hardens=parameters.material().hardens,
    )
    if cycle is None and found.state is not ShakedownState.ELASTIC:
        return Shakedown(ShakedownState.UNDECIDED, np.nan, np.nan)
    return found


def mean_added(traces: Sequence[PassTrace], most: int) -> tuple[float, float]:
    """Return the largest mean strain added in a pass, over the last half of the passes or ``most``.

    The first number is accumulated strain, the second the equivalent of signed strain.
    """
    average = max(min(len(traces) // 2, most), 1)
    accumulated, left = added_by(traces, len(traces) - 1, average)
    return float(accumulated.max() / average), float(_equivalent(left).max() / average)


def added_by(traces: Sequence[PassTrace], number: int, cycle: int) -> tuple[Array, Array]:
    """Return the strain added in the cycle that ends with a pass: equivalent (n,), and signed."""
    after = traces[number]
    if number < cycle:
        return after.accumulated, after.plastic_strain
    before = traces[number - cycle]
    return after.accumulated - before.accumulated, after.plastic_strain - before.plastic_strain


def _equivalent(flow: Array) -> Array:
    """Return the equivalent (n,) of signed strain (n, n_components), Mandel."""
    return np.asarray(np.sqrt(2 / 3 * (flow**2).sum(axis=1)))
