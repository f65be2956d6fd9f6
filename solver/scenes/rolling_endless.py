"""How the rolling scene passes over a track without ends: steadily, in the frame of the load."""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from solver.errors import LimitLoad, ModelError, NotConverged, Spins, WindowTooSmall
from solver.loading.outcome import Outcome, Tally
from solver.materials.doubts import doubts
from solver.results.audit.steady import OfPass, audit_pass
from solver.results.run import FinishedRun
from solver.results.samples import Samples
from solver.results.shakedown import ShakedownState
from solver.results.steady import SteadyTractions, TrackBody
from solver.results.tractions import PrescribedTractions
from solver.scenes.passes import Trace, shakedown_of
from solver.scenes.rolling_steady import steady_passes, track_for
from solver.scenes.scene import by_increments
from solver.steady import RollingContact, standing_pressure
from solver.tensors import to_tensor

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from solver.model.motion import TravellingPressure
    from solver.results.audit.report import Audit
    from solver.results.steady import Standing
    from solver.results.tractions import SurfaceTractions
    from solver.results.view import View
    from solver.scenes.rolling_parameters import RollingParameters
    from solver.scenes.scene import Monitor, Scene
    from solver.steady import Pass, Track

    Array = NDArray[np.float64]


_REACHES = (1.0, 1.5, 2.5, 4.0)
"""Sizes of the window that are tried, over the usual one."""
_BY_INCREMENTS = 6.0
"""Track / half-width, where no steady pass is found: as long as that of the published tests."""
_MOST_BY_INCREMENTS = 4
"""Passes up to which this is done: each takes minutes."""


def without_ends(
    scene: Scene, runs: Sequence[RollingParameters], monitor: Monitor
) -> Iterator[FinishedRun]:
    """Roll pass after pass; yield each of the runs, which differ in the number of passes.

    Where a pass yields or touches beyond the window of its mesh, all begins again with a larger
    one. Where no steady pass is found, the runs that are left are rolled by increments: a wheel
    that sinks in without end may still go some way, but no prescribed pressure beyond the limit,
    nor a wheel that spins.
    """
    waiting = list(runs)
    rolled = _Rolled(scene, runs[-1])
    for reach in _REACHES:
        for run in rolled.runs(waiting, monitor, reach):
            waiting.pop(0)
            yield run
        if not isinstance(rolled.error, WindowTooSmall):
            break
    none = LimitLoad if runs[-1].load == "hertz" else Spins
    if not isinstance(rolled.error, none) and waiting and (others := _stepped(waiting)):
        length, side = others[0].length, others[0].element_size
        note = f"{rolled.error}: rolled by increments instead, over {length:.4g} mm"
        note += f" with elements of {side:.3g} mm"
        for run in by_increments(scene, others, monitor):
            yield replace(run, notes=(*run.notes, note))
        return
    yield from map(rolled.finished, waiting)


def _stepped(runs: Sequence[RollingParameters]) -> list[RollingParameters]:
    """Return the runs on a track with ends, none if that would take too many increments.

    Their elements are as large as those of such a track are, or as those of the run, if larger.
    """
    last = runs[-1]
    if last.passes > _MOST_BY_INCREMENTS:
        return []
    ends: dict[str, Any] = {"track": _BY_INCREMENTS * last.half_width, "until": "passes"}
    usual: dict[str, Any] = dict.fromkeys(("element_size", "advance_step"))
    with suppress(ModelError):
        own = replace(last, **ends, **usual)
        h = max(own.element_size, last.element_size)
        return [replace(run, **ends, element_size=h, advance_step=h / 2) for run in runs]
    return []


class _Rolled:
    """The passes of a path, as far as they were rolled."""

    def __init__(self, scene: Scene, last: RollingParameters) -> None:
        self._scene, self._last = scene, last
        self._started, self._elsewhere = time.process_time(), 0.0
        self.error: NotConverged | None = None

    def _begin(self, reach: float) -> None:
        """Begin with a window of so many times the usual size."""
        last = self._last
        view, track = self._scene.view(last), track_for(last, reach)
        self._sides = {way: _Side(track, view, way) for way in set(last.directions)}
        self._steps: list[int] = []
        self._traces: list[Trace] = []
        self._found: Pass | None = None
        self._previous: Pass | None = None

    def runs(
        self, runs: Sequence[RollingParameters], monitor: Monitor, reach: float
    ) -> Iterator[FinishedRun]:
        """Yield these runs, as many as there are passes for; ``error`` tells why not all."""
        last, waiting = self._last, list(runs)
        try:
            self._begin(reach)
        except ModelError:
            if self.error is None:
                raise
            return  # such a window has too many elements: the error stays
        self.error = None
        try:
            for number, found in enumerate(steady_passes(last, reach), start=1):
                self._previous, self._found = self._found, found
                self._steps.append(max(found.steps, 1))
                self._traces.append(self._sides[found.direction].trace(found))
                monitor(min(number / last.passes, 0.99))
                decided = last.until == "decided" and _decided(last, self._traces)
                while waiting and (decided or waiting[0].passes == number):
                    run = self.finished(waiting.pop(0))
                    paused = time.process_time()
                    yield run
                    self._elsewhere += time.process_time() - paused
                if not waiting:
                    return
        except NotConverged as failure:
            self.error = failure

    def finished(self, run: RollingParameters) -> FinishedRun:
        """Return a run after the last pass found."""
        found = self._found
        side = self._sides[found.direction if found else self._last.directions[0]]
        view = side.samples.view
        seconds = time.process_time() - self._started - self._elsewhere
        points = side.states(found) if found else {}
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
            return audit_pass(side.half_plane.track, run.material(), found, previous, way)

        own = run.of_pass(max(len(self._steps) - 1, 0))
        moving = _moving(own, found.direction) if found and own.load != "contact" else None
        return FinishedRun(
            parameters=run,
            samples=side.samples,
            tractions=_tractions(own, side.half_plane.way),
            outcome=outcome,
            check=check,
            notes=doubts({side.samples.view.profile_body: run.material()}),
            source=OfPass(side.half_plane, found, moving, view.unloaded) if found else None,
        )


class _Side:
    """What one sees of a load that goes one way along x: 1 or -1."""

    def __init__(self, track: Track, view: View, way: int) -> None:
        self.half_plane = TrackBody(track, way)
        self.samples = Samples(self.half_plane, view)

    @cached_property
    def _by_depth(self) -> Array:
        """The matrix (n_depth, 1 + n_rows) from values at the surface and of rows to a profile."""
        body, track = self.samples.view.profile_body, self.half_plane.track
        rows, n = track.rows, track.part.weights.size
        each = np.zeros((1 + len(rows.every), n + len(rows.highest)))
        each[0, n:] = 1.0
        np.put_along_axis(each[1:], rows.every, 1.0, axis=1)
        return self.samples.along_depth(self.samples.fields.recovered(body, each))[:, 0].T

    def trace(self, found: Pass) -> Trace:
        """Return what is kept of a pass."""
        left, elasticity = found.left.whole, self.half_plane.track.elasticity
        strain = np.maximum(self._by_depth @ left.accumulated, 0.0)
        stress, flow = (
            to_tensor((self._by_depth @ values).T)[None]
            for values in (left.stress(elasticity), left.plastic_strain)
        )
        touching = found.loading
        return Trace(
            stress=stress,
            strain=strain[None],
            flow=flow,
            surface=left.displacement(elasticity)[:, None],
            creepage=touching.creepage if isinstance(touching, RollingContact) else np.nan,
            peak=float(left.accumulated.max()),
        )

    def states(self, found: Pass) -> dict[str, Standing]:
        """Return the states of a pass by the names of the view's stages."""
        loaded, left = self.half_plane.under_load(found), self.half_plane.left_by(found)
        view = self.samples.view
        return {name: left if name == view.unloaded else loaded for name in view.stages}


def _decided(parameters: RollingParameters, traces: Sequence[Trace]) -> bool:
    """Tell whether the passes so far decide to which state they tend."""
    state = shakedown_of(parameters, traces).state
    return state is not ShakedownState.UNDECIDED


def _tractions(parameters: RollingParameters, way: int) -> SurfaceTractions:
    """Return what acts on the half-space."""
    if parameters.load == "contact":
        return SteadyTractions(way)
    return PrescribedTractions(_moving(parameters, way), 0.0)


def _moving(parameters: RollingParameters, way: int) -> TravellingPressure:
    p, ratio = parameters, way * parameters.friction * parameters.traction
    return standing_pressure(p.half_width, p.peak_pressure, ratio)
