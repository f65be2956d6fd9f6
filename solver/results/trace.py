"""What each pass leaves under the track, and what becomes of it from cycle to cycle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from solver.results.shakedown import Shakedown, State, classify

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.loading.passes import PassResult
    from solver.results.harvest import Harvest

    Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Trace:
    """One pass, under the stations of a layout.

    Attributes
    ----------
    stress : (station, 4, depth) residual stress, tensor components [MPa]
    strain : (station, depth) equivalent plastic strain
    flow : (station, 4, depth) signed plastic strain, tensor components
    surface : (2, station) displacement of the surface [mm]
    creepage, peak : of the pass; largest equivalent plastic strain anywhere
    """

    stress: Array
    strain: Array
    flow: Array
    surface: Array
    creepage: float
    peak: float

    @classmethod
    def of(cls, harvest: Harvest, result: PassResult) -> Trace:
        """Take the trace of a pass that came to its end."""
        assert result.unloaded is not None
        return cls(
            *harvest.profile(result.unloaded),
            harvest.flow(result.unloaded),
            harvest.moved(result.unloaded),
            result.creepage,
            float(result.unloaded.responses[-1].state.accumulated.max()),
        )


def fields(traces: Sequence[Trace], cycle: int) -> dict[str, Any]:
    """Return the variables over passes; increments are those of the cycle a pass ends."""
    middle = len(traces[0].strain) // 2
    accumulated, left = _increments(traces, cycle)
    shear = 2 * left[:, 3]
    largest = np.abs(shear).argmax(axis=1)
    surface = np.stack([t.surface[0, middle] for t in traces])
    return {
        "residual_profile": (
            ("pass", "station", "component", "depth"), np.stack([t.stress for t in traces])
        ),
        "plastic_strain_profile": (
            ("pass", "station", "depth"), np.stack([t.strain for t in traces])
        ),
        "plastic_flow_profile": (
            ("pass", "station", "component", "depth"), np.stack([t.flow for t in traces])
        ),
        "pass_creepage": (("pass",), np.array([t.creepage for t in traces])),
        "pass_max_plastic_strain": (("pass",), np.array([t.peak for t in traces])),
        "pass_plastic_increment": (("pass",), accumulated.max(axis=1)),
        "pass_net_increment": (("pass",), _equivalent(left).max(axis=1)),
        "pass_net_shear": (("pass",), shear[np.arange(len(shear)), largest]),
        "pass_surface_advance": (("pass",), _differences(surface, cycle)),
    }  # fmt: skip


def shakedown(
    traces: Sequence[Trace], cycle: int, yield_strain: float, *, periodic: bool, hardens: bool
) -> Shakedown:
    """Return the state the passes tend to.

    On a track with ends only a body that stays elastic is decided: the ends hold back the layer
    that ratchetting moves, until it looks like a closed cycle.
    """
    accumulated, left = _increments(traces, cycle)
    last = slice((len(traces) - 1) % cycle, None, cycle)
    found = classify(accumulated[last], _equivalent(left)[last], yield_strain, hardens=hardens)
    if periodic or found.state is State.ELASTIC:
        return found
    return Shakedown(State.UNDECIDED, found.accumulated, found.net)


def _increments(traces: Sequence[Trace], cycle: int) -> tuple[Array, Array]:
    """Return accumulated (pass, depth) and signed (pass, 4, depth) strain of each cycle."""
    middle = len(traces[0].strain) // 2
    accumulated = np.stack([t.strain[middle] for t in traces])
    flow = np.stack([t.flow[middle] for t in traces])
    return _differences(accumulated, cycle), _differences(flow, cycle)


def _differences(values: Array, cycle: int) -> Array:
    """Return the change of values (pass, ...) over the last cycle, from zero at first."""
    before = np.concatenate([np.zeros((cycle, *values.shape[1:])), values[:-cycle]])
    return values - before[: len(values)]


def _equivalent(flow: Array) -> Array:
    """Return the equivalent of signed strain (pass, 4, depth), tensor components."""
    square = (flow[:, :3] ** 2).sum(axis=1) + 2 * flow[:, 3] ** 2
    return np.asarray(np.sqrt(2 / 3 * square))
