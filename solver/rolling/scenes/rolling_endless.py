"""Runs of the rolling scene on an endless track: steady passes in the frame of the load."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from solver.audit.report import Audit
from solver.errors import LimitLoad, ModelError, NotConverged, Spins
from solver.linear.solvers import one_thread
from solver.loading.checks import uncarried
from solver.materials.elastic_plastic import Material
from solver.memory import kept
from solver.model.amplitude import Amplitude
from solver.model.body import Axle
from solver.model.friction import effective_friction
from solver.results.acting import Acting, of_pressure
from solver.results.fields import Samples
from solver.results.run import FinishedRun
from solver.results.shakedown import ShakedownState
from solver.results.view import View
from solver.rolling.audit.plane import audit_pass
from solver.rolling.load import FULL_SLIP, PassingLoad, RollingLoad
from solver.rolling.passing import Pass, SolveBudget
from solver.rolling.plane.layers import Layers
from solver.rolling.plane.lines import rim_elements, track_lines, wheel_nodes
from solver.rolling.plane.rolling import rolling
from solver.rolling.plane.track import Track, standing_pressure, track_of
from solver.rolling.plane.wheel import Rim, RollingContact, RollingWheel
from solver.rolling.results.plane import TrackBody, of_wheel
from solver.rolling.scenes.pass_runner import Passes, by_passes
from solver.rolling.scenes.passes import Trace, shakedown_of
from solver.rolling.scenes.rolling import RollingParameters
from solver.rolling.scenes.rolling_model import wheel_body
from solver.rolling.search import search
from solver.scenes.driver import by_increments
from solver.scenes.scene import Monitor, Scene
from solver.tensors import to_tensor
from solver.typing import Array

_PARTS, _TOLERANCE = 4, 0.01
"""Number of increments between two points of a row, and tolerance, of a pass on a coarser mesh."""


def steady_passes(
    parameters: RollingParameters,
    reach: float = 1.0,
    parts: int | None = None,
    budget: SolveBudget | None = None,
) -> Iterator[Pass[Layers]]:
    """Yield the passes in their order.

    Parameters
    ----------
    reach : ratio of the size of the window to the usual size
    parts : increments between two points of a row, or None for the usual number
    budget : counts the solves of each pass, as in `rolling`
    """
    p = parameters
    track = track_for(p, reach)
    block = p.block  # equal passes are one object
    load_of = {id(own): load_on(track, p, own) for own in block}
    loads = itertools.cycle(load_of[id(own)] for own in block)
    guess = _first_guess(p, reach)
    yield from rolling(
        track, p.material(), loads, p.directions, guess=guess, parts=parts, budget=budget
    )


def _first_guess(parameters: RollingParameters, reach: float) -> Array | None:
    """Return the strain of the first pass as found with elements of twice the side, or None.

    Half of Newton's steps only approach the solution; on the coarser mesh they cost a fifth.
    """
    p = parameters
    try:
        coarse = replace(p, element_size=2 * p.element_size, growth=p.growth**2)
        track = track_for(coarse, reach)
        with one_thread():
            found = search(
                track, p.material(), load_on(track, coarse, coarse.of_pass(0)),
                track.virgin(p.material()), _first_guess(coarse, reach), parts=_PARTS,
                tolerance=_TOLERANCE,
            )  # fmt: skip
    except LimitLoad:
        raise
    except (NotConverged, ModelError):
        return None
    return track_for(p, reach).rows.interpolated(found.strain, track.rows)


def track_for(parameters: RollingParameters, reach: float = 1.0) -> Track:
    """Return the half-space, built once in a process for each mesh."""
    p = parameters
    return track_of(p.mesh_width, p.element_size, p.growth, p.material().elasticity, reach)


def rim_of(parameters: RollingParameters) -> Rim:
    """Return the rim of the wheel, condensed once in a process for each wheel."""
    p = parameters
    return _rim(p.radius, p.widest.reach, p.element_size, p.wheel_material)


@kept
def _rim(radius: float, reach: float, h: float, material: Material) -> Rim:
    still = Amplitude.constant(0.0)
    axle = Axle(centre=(0.0, radius), radius=radius, force=still, moment=still, position=still)
    return Rim(wheel_body(axle, reach, h, material), "rim")


def load_on(track: Track, run: RollingParameters, parameters: RollingParameters) -> PassingLoad:
    """Return the load of a pass, which moves along +x.

    Parameters
    ----------
    run : parameters of the run, for the rim of its widest contact
    parameters : those of the pass

    Raises
    ------
    LimitLoad, Runaway
        if the surface does not carry its prescribed shear
    """
    p = parameters
    if p.load == "hertz":
        if error := _sheared(p):
            raise error
        return track.hertz(p.peak_pressure, p.friction * p.traction, p.half_width)
    friction = effective_friction(p.friction)
    return RollingWheel(
        track=track,
        rim=rim_of(run),
        friction=p.friction_part,
        strength=p.material().shear_yield_stress,
        load=RollingLoad(
            force=p.force,
            drive=None if p.guided else p.traction * friction * p.force,
            creepage=FULL_SLIP if p.traction == 1.0 else p.given_creepage,
        ),
    )


def _sheared(p: RollingParameters) -> NotConverged | None:
    """Return the error if the surface does not carry the shear of a prescribed pressure."""
    return uncarried(p.material(), p.friction * abs(p.traction) * p.peak_pressure)


_REACHES = (1.0, 1.5, 2.5, 4.0)
"""Ratios of the size of the window to the usual size, tried in turn."""
_LENGTH = 6.0
"""Length of a track rolled by increments, over the half-width, as in published tests."""
_MOST_PASSES = 4
"""Largest number of passes that are rolled by increments if no steady pass is found: each takes
minutes."""


def by_steady_passes(
    scene: Scene, runs: Sequence[RollingParameters], monitor: Monitor
) -> Iterator[FinishedRun]:
    """Compute pass after pass; yield the runs, which differ in the number of passes.

    If no steady pass is found, roll the remaining runs by increments on a short track: there a
    wheel that sinks in may still be in equilibrium. A prescribed pressure above the limit load, a
    shear that the surface does not carry and a wheel that spins cannot be.
    """

    def otherwise(
        remaining: Sequence[RollingParameters], error: NotConverged
    ) -> Iterator[FinishedRun] | None:
        final = LimitLoad if runs[-1].load == "hertz" else Spins
        others = [] if isinstance(error, final) else _on_short_track(remaining)
        if not others:
            return None
        length, side = others[0].length, others[0].element_size
        note = f"{error}: rolled by increments instead, over {length:.4g} mm"
        note += f" with elements of {side:.3g} mm"
        rolled = by_increments(replace(scene, derivatives=None), others, monitor)
        return (replace(run, notes=(*run.notes, note)) for run in rolled)

    return by_passes(
        scene, runs, monitor, window=TrackPasses, reaches=_REACHES, otherwise=otherwise
    )


def _on_short_track(runs: Sequence[RollingParameters]) -> list[RollingParameters]:
    """Return the runs on a track of given length; none if they cannot be there, or take too long.

    Their elements have the usual side on such a track, or that of the runs if it is larger.
    """
    last = runs[-1]
    if last.passes > _MOST_PASSES or any(p.load == "hertz" and _sheared(p) for p in last.block):
        return []
    ends: dict[str, Any] = {"track": _LENGTH * last.half_width, "until": "passes"}
    usual: dict[str, Any] = dict.fromkeys(("element_size", "advance_step"))
    with suppress(ModelError):
        own = replace(last, **ends, **usual)
        h = max(own.element_size, last.element_size)
        return [replace(run, **ends, element_size=h, advance_step=h / 2) for run in runs]
    return []


class TrackPasses(Passes):
    """Passes over a half-space; those along -x are mirrored."""

    def __init__(self, parameters: RollingParameters, view: View, reach: float) -> None:
        self.parameters, self.law, self._reach = parameters, parameters.material(), reach
        self.track = track_for(parameters, reach)
        self._ways = parameters.directions
        self._by_way = {way: Samples(TrackBody(self.track, way), view) for way in set(self._ways)}
        self._by_depth: dict[int, Array] = {}

    def found(self, budget: SolveBudget) -> Iterator[Pass[Layers]]:
        """See `Passes`."""
        return steady_passes(self.parameters, self._reach, budget=budget)

    @cached_property
    def _loads(self) -> list[PassingLoad]:
        """The loads of the block of passes."""
        p = self.parameters
        return [load_on(self.track, p, own) for own in p.block]

    def load(self, number: int) -> PassingLoad:
        """See `Passes`."""
        return self._loads[number % len(self._loads)]

    def way(self, number: int) -> int:
        """See `Passes`."""
        return self._ways[number]

    def same_mesh(self, parameters: RollingParameters) -> bool:
        """See `Passes`. Nodes of the wheel may move, but not become more or fewer."""
        both = self.parameters, parameters
        tracks = [track_lines(p.mesh_width, p.element_size, p.growth, self._reach) for p in both]
        if not all(np.array_equal(*each) for each in zip(*tracks, strict=True)):
            return False
        if self.parameters.load == "hertz":
            return True
        sizes = [(p.widest.reach, p.element_size) for p in both]
        wheels = [wheel_nodes(p.radius, *size) for p, size in zip(both, sizes, strict=True)]
        one, other = ([len(nodes) for nodes in wheel] for wheel in wheels)
        return one == other and rim_elements(*sizes[0]) == rim_elements(*sizes[1])

    def shown(self, number: int) -> tuple[Samples, Callable[[Any], Acting]]:
        """See `Passes`."""
        p, way = self.parameters.of_pass(number), self._ways[number]
        if p.load == "contact":
            return self._by_way[way], partial(of_wheel, way)
        shear = way * p.friction * p.traction
        pressure = standing_pressure(p.half_width, p.peak_pressure, shear)
        return self._by_way[way], partial(of_pressure, pressure)

    def trace(self, found: Pass[Layers]) -> Trace:
        """Return the trace of a pass, from the state that it leaves."""
        left, elasticity = found.left.whole, self.track.elasticity
        by_depth = self._profile(found.direction)
        strain = np.maximum(by_depth @ left.accumulated, 0.0)
        stress, flow = (
            to_tensor((by_depth @ values).T)[None]
            for values in (left.stress(elasticity), left.plastic_strain)
        )
        contact = found.loading
        creepage = contact.creepage if isinstance(contact, RollingContact) else np.nan
        moved = left.displacement(elasticity)[:1]
        peak = float(left.accumulated.max())
        return Trace.at(stress, strain[None], flow, moved, creepage, peak)

    def _profile(self, way: int) -> Array:
        """Return the matrix (n_depth, 1 + n_rows) from surface and rows to the profile."""
        if way in self._by_depth:
            return self._by_depth[way]
        samples, track = self._by_way[way], self.track
        rows, n = track.rows, track.part.weights.size
        each = np.zeros((1 + len(rows.every), n + len(rows.highest)))
        each[0, n:] = 1.0
        np.put_along_axis(each[1:], rows.every, 1.0, axis=1)
        nodal = samples.fields.recovered(samples.view.profile_body, each)
        self._by_depth[way] = samples.along_depth(nodal)[:, 0].T
        return self._by_depth[way]

    def audit(self, found: Pass[Layers], left: Layers | None, number: int) -> Audit:
        """See `Passes`."""
        return audit_pass(self.track, self.law, found, left, self._ways[number])

    def decided(self, traces: Sequence[Trace]) -> bool:
        """Return whether the passes so far decide the shakedown state, if they end then."""
        if self.parameters.until != "decided":
            return False
        return (
            shakedown_of(self.parameters, traces, self.parameters.cycle).state
            is not ShakedownState.UNDECIDED
        )
