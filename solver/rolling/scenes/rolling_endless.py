"""Runs of the rolling scene on an endless track: steady passes in the frame of the load."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from solver.audit.report import Audit
from solver.errors import LimitLoad, ModelError, NotConverged, Spins, WindowTooSmall
from solver.loading.outcome import Outcome, Tally
from solver.materials.doubts import doubts
from solver.model.motion import TravellingPressure
from solver.results.run import FinishedRun
from solver.results.samples import Samples
from solver.results.shakedown import ShakedownState
from solver.results.tractions import PrescribedTractions, SurfaceTractions
from solver.results.view import View
from solver.rolling.audit.plane import audit_pass
from solver.rolling.layers import Layers
from solver.rolling.passing import Pass, SolveBudget
from solver.rolling.plane.touching import RollingContact
from solver.rolling.plane.track import Track, standing_pressure
from solver.rolling.results.plane import SteadyTractions, TrackBody, TrackState
from solver.rolling.scenes.passes import Trace, shakedown_of
from solver.rolling.scenes.rolling_parameters import RollingParameters
from solver.rolling.scenes.rolling_steady import steady_passes, track_for
from solver.scenes.driver import by_increments
from solver.scenes.scene import Monitor, Scene
from solver.tensors import to_tensor
from solver.typing import Array

_REACHES = (1.0, 1.5, 2.5, 4.0)
"""Ratios of the size of the window to the usual size, tried in turn."""
_LENGTH = 6.0
"""Ratio of the length of a track rolled by increments to the half-width, as in published tests."""
_MOST_PASSES = 4
"""Largest number of passes that are rolled by increments instead: each takes minutes."""


def by_steady_passes(
    scene: Scene, runs: Sequence[RollingParameters], monitor: Monitor
) -> Iterator[FinishedRun]:
    """Compute pass after pass; yield the runs, which differ in the number of passes.

    1. If yielding or contact reaches the edge of the window, begin again with a larger window.
    2. If no steady pass is found, roll the remaining runs by increments on a short track: there a
       wheel that sinks in may still be in equilibrium. A prescribed pressure above the limit load
       and a wheel that spins cannot be.
    """
    remaining = list(runs)
    path = _SteadyPath(scene, runs[-1])
    for reach in _REACHES:
        for run in path.runs(remaining, monitor, reach):
            remaining.pop(0)
            yield run
        if not isinstance(path.error, WindowTooSmall):
            break
    final = LimitLoad if runs[-1].load == "hertz" else Spins
    if not isinstance(path.error, final) and remaining and (others := _on_short_track(remaining)):
        length, side = others[0].length, others[0].element_size
        note = f"{path.error}: rolled by increments instead, over {length:.4g} mm"
        note += f" with elements of {side:.3g} mm"
        for run in by_increments(scene, others, monitor):
            yield replace(run, notes=(*run.notes, note))
        return
    yield from map(path.finished, remaining)


def _on_short_track(runs: Sequence[RollingParameters]) -> list[RollingParameters]:
    """Return the runs on a track of given length; none if they have too many passes.

    Their elements have the usual side on such a track, or that of the runs if it is larger.
    """
    last = runs[-1]
    if last.passes > _MOST_PASSES:
        return []
    ends: dict[str, Any] = {"track": _LENGTH * last.half_width, "until": "passes"}
    usual: dict[str, Any] = dict.fromkeys(("element_size", "advance_step"))
    with suppress(ModelError):
        own = replace(last, **ends, **usual)
        h = max(own.element_size, last.element_size)
        return [replace(run, **ends, element_size=h, advance_step=h / 2) for run in runs]
    return []


class _SteadyPath:
    """The steady passes of a loading path that are computed so far.

    Attributes
    ----------
    error : why there are no more, or None
    """

    def __init__(self, scene: Scene, last: RollingParameters) -> None:
        self._scene, self._last = scene, last
        self._started, self._elsewhere = time.process_time(), 0.0
        self._budget = SolveBudget()
        self.error: NotConverged | None = None

    def _begin(self, reach: float) -> None:
        last = self._last
        view, track = self._scene.view(last), track_for(last, reach)
        self._by_way = {way: _Direction(track, view, way) for way in set(last.directions)}
        self._steps: list[int] = []
        self._traces: list[Trace] = []
        self._found: Pass[Layers] | None = None
        self._previous: Pass[Layers] | None = None

    def runs(
        self, runs: Sequence[RollingParameters], monitor: Monitor, reach: float
    ) -> Iterator[FinishedRun]:
        """Yield those of the runs whose passes are found; ``error`` says why others are not.

        ``reach`` is the ratio of the size of the window to the usual size.
        """
        last, remaining = self._last, list(runs)
        try:
            self._begin(reach)
        except ModelError:
            if self.error is None:
                raise
            return  # this window has too many elements: keep the error of the smaller one
        self.error = None
        try:
            passes = steady_passes(last, reach, budget=self._budget)
            for number, found in enumerate(passes, start=1):
                self._previous, self._found = self._found, found
                self._steps.append(max(found.steps, 1))
                self._traces.append(self._by_way[found.direction].trace(found))
                monitor(min(number / last.passes, 0.99))
                decided = last.until == "decided" and _decided(last, self._traces)
                while remaining and (decided or remaining[0].passes == number):
                    run = self.finished(remaining.pop(0))
                    paused = time.process_time()
                    yield run
                    self._elsewhere += time.process_time() - paused
                if not remaining:
                    return
        except NotConverged as failure:
            self.error = failure

    def finished(self, run: RollingParameters) -> FinishedRun:
        """Return a run with the results of the last pass found."""
        found = self._found
        direction = self._by_way[found.direction if found else self._last.directions[0]]
        samples, body = direction.samples, direction.half_plane
        view = samples.view
        seconds = time.process_time() - self._started - self._elsewhere
        points = direction.states(found) if found else {}
        outcome = Outcome(
            tally=Tally(iterations=tuple(self._steps), seconds=seconds, plastic_work=np.nan),
            last=points.get(view.unloaded),
            points=points,
            traces=tuple(self._traces),
            error=self.error,
        )

        previous, ways = self._previous, self._last.directions

        def check() -> Audit:
            assert found is not None
            way = ways[len(self._steps) - 1]
            return audit_pass(body.track, run.material(), found, previous, way)

        own = run.of_pass(max(len(self._steps) - 1, 0))
        return FinishedRun(
            parameters=run,
            samples=samples,
            tractions=_tractions(own, body.way),
            outcome=outcome,
            check=check,
            notes=doubts({view.profile_body: run.material()}),
        )


class _Direction:
    """The half-space and its samples for passes along +x (``way`` 1) or -x (``way`` -1)."""

    def __init__(self, track: Track, view: View, way: int) -> None:
        self.half_plane = TrackBody(track, way)
        self.samples = Samples(self.half_plane, view)

    @cached_property
    def _by_depth(self) -> Array:
        """The matrix (n_depth, 1 + n_rows) from values at surface and rows to the profile."""
        body, track = self.samples.view.profile_body, self.half_plane.track
        rows, n = track.rows, track.part.weights.size
        each = np.zeros((1 + len(rows.every), n + len(rows.highest)))
        each[0, n:] = 1.0
        np.put_along_axis(each[1:], rows.every, 1.0, axis=1)
        return self.samples.along_depth(self.samples.fields.recovered(body, each))[:, 0].T

    def trace(self, found: Pass[Layers]) -> Trace:
        """Return the trace of a pass, from the state that it leaves."""
        left, elasticity = found.left.whole, self.half_plane.track.elasticity
        strain = np.maximum(self._by_depth @ left.accumulated, 0.0)
        stress, flow = (
            to_tensor((self._by_depth @ values).T)[None]
            for values in (left.stress(elasticity), left.plastic_strain)
        )
        contact = found.loading
        return Trace(
            stress=stress,
            strain=strain[None],
            flow=flow,
            surface=left.displacement(elasticity)[:, None],
            creepage=contact.creepage if isinstance(contact, RollingContact) else np.nan,
            peak=float(left.accumulated.max()),
        )

    def states(self, found: Pass[Layers]) -> dict[str, TrackState]:
        """Return the states of a pass by the names of their stages."""
        loaded, left = self.half_plane.under_load(found), self.half_plane.left_by(found)
        view = self.samples.view
        return {name: left if name == view.unloaded else loaded for name in view.stages}


def _decided(parameters: RollingParameters, traces: Sequence[Trace]) -> bool:
    """Tell whether the passes so far decide the shakedown state."""
    state = shakedown_of(parameters, traces).state
    return state is not ShakedownState.UNDECIDED


def _tractions(parameters: RollingParameters, way: int) -> SurfaceTractions:
    """Return pressure and shear on the half-space."""
    if parameters.load == "contact":
        return SteadyTractions(way)
    return PrescribedTractions(_moving(parameters, way))


def _moving(parameters: RollingParameters, way: int) -> TravellingPressure:
    """Return the Hertz pressure, at x = 0."""
    p, ratio = parameters, way * parameters.friction * parameters.traction
    return standing_pressure(p.half_width, p.peak_pressure, ratio)
