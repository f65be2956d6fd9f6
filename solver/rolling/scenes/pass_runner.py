"""Runs of steady passes: pass after pass, in windows of several sizes around the load."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, cast

import numpy as np

from solver.audit.report import Audit
from solver.errors import LimitLoad, ModelError, NotConverged, WindowTooSmall
from solver.late import Late
from solver.linear.solvers import one_thread
from solver.loading.outcome import Outcome, Tally
from solver.materials.doubts import doubts
from solver.materials.law import Law
from solver.results.acting import Acting
from solver.results.fields import Samples
from solver.results.mesh_fields import MeshFields
from solver.results.run import FinishedRun, Values
from solver.results.view import View
from solver.rolling.load import PassingLoad
from solver.rolling.passing import EXACT, Pass, SolveBudget, passing
from solver.rolling.results.stage import SteadyBody
from solver.scenes.scene import Monitor, Scene
from solver.typing import Array

_Family = Late("solver.derivatives.family:Family")


class Passes(ABC):
    """The passes of a loading path in a window of one size, as results see them.

    The constructor raises `ModelError` if there is no room for the window.

    Attributes
    ----------
    parameters : those of the run with the most passes
    law : law of the material
    track : the body
    extent : size of the window in words, for the error if the largest window is too small
    beside : (pass) -> fields of a further body, None without
    exact : tolerance of passes of which differences are taken: of wider ones if it is above `EXACT`
    """

    parameters: Any
    law: Law
    track: Any
    extent = ""
    beside: Callable[[Pass[Any]], MeshFields] | None = None
    exact = EXACT

    @abstractmethod
    def found(self, budget: SolveBudget) -> Iterator[Pass[Any]]:
        """Yield the passes behind those of `begin`; ``budget`` counts the solves of each."""

    @abstractmethod
    def load(self, number: int) -> PassingLoad:
        """Return the load of a pass, counted from 0."""

    def way(self, number: int) -> int:
        """Return the direction of a pass, counted from 0: 1 along +x, -1 along -x."""
        return 1

    def follow(self, beside: Pass[Any], last: Pass[Any] | None, number: int) -> Pass[Any]:
        """Return a pass, counted from 0, of a run whose parameters are almost those of another one.

        It is solved so exactly that differences can be taken.

        Parameters
        ----------
        beside : the same pass of the other run
        last : the pass before, None for the first one
        """
        before = last.left if last else self.track.virgin(self.law)
        before = before if self.way(number) == 1 else before.mirrored
        with one_thread():
            found = passing(
                self.track, self.law, self.load(number).exact, before, beside.strain,
                start=beside.loading.start, parts=beside.parts, tolerance=self.exact,
            )  # fmt: skip
        return replace(found, direction=self.way(number))

    @abstractmethod
    def same_mesh(self, parameters: Any) -> bool:
        """Return whether a run with other parameters can be followed on this mesh."""

    @abstractmethod
    def shown(self, number: int) -> tuple[Samples, Callable[[Any], Acting]]:
        """Return the fields of a `SteadyBody`, and what acts on it, in a pass counted from 0."""

    @abstractmethod
    def trace(self, found: Pass[Any]) -> Any:
        """Return the data of a pass that are kept."""

    @abstractmethod
    def audit(self, found: Pass[Any], left: Any, number: int) -> Audit:
        """Return the audit of a pass, counted from 0; ``left`` is the state before, or None."""

    def state(self, found: Pass[Any], traces: Sequence[Any]) -> Mapping[str, Array]:
        """Return what `begin` needs after a pass; empty where other passes cannot go on from it."""
        return {}

    def begin(self, state: Mapping[str, Array]) -> tuple[list[Any], Any]:
        """Go on from a `state` of passes over the same body; return their traces and what is left.

        They may have been found in another process.
        """
        raise NotImplementedError

    def decided(self, traces: Sequence[Any]) -> bool:
        """Return whether the passes so far are enough for all runs."""
        return False


Window = Callable[[Any, View, float], Passes]
"""(parameters, positions of results, ratio of the window to its usual size) -> passes."""
Otherwise = Callable[[Sequence[Any], NotConverged], Iterator[FinishedRun] | None]
"""(remaining runs, error of their passes) -> the runs computed in another way, or None."""


def by_passes(
    scene: Scene,
    runs: Sequence[Any],
    monitor: Monitor,
    *,
    window: Window,
    reaches: Sequence[float],
    otherwise: Otherwise = lambda remaining, error: None,
    begun: Mapping[str, Array] | None = None,
) -> Iterator[FinishedRun]:
    """Compute pass after pass; yield the runs, which differ in the number of passes.

    If yielding or contact reaches the edge of the window, begin again with a larger window.

    Parameters
    ----------
    reaches : ratios of the size of the window to the usual size, tried in turn
    begun : `FinishedRun.state` of a run with fewer passes, to go on from
    """
    remaining = list(runs)
    path = _Path(scene, runs[-1], window, begun)
    for reach in (each for each in reaches if begun is None or each >= begun["reach"].item()):
        for run in path.runs(remaining, monitor, reach):
            remaining.pop(0)
            yield run
        if not isinstance(path.error, WindowTooSmall):
            break
    others = otherwise(remaining, path.error) if path.error and remaining else None
    if others is None:
        yield from map(path.finished, remaining)
        return
    spent = path.seconds
    for run in others:
        tally = replace(run.outcome.tally, seconds=spent + run.outcome.tally.seconds)
        outcome = replace(run.outcome, tally=tally)
        yield replace(run, outcome=outcome, derived=run.derived or path.derived([]))


class _Path:
    """The passes of a loading path that are computed so far.

    Attributes
    ----------
    error : error that ended the passes, or None
    """

    def __init__(
        self, scene: Scene, last: Any, window: Window, state: Mapping[str, Array] | None
    ) -> None:
        self._last, self._window, self._view = last, window, scene.view(last)
        self._state = state
        self._started = time.process_time() - (state["seconds"].item() if state else 0.0)
        self._elsewhere = 0.0
        self._scene = scene
        self._family: Any = None
        self._beside: list[_Path] = []
        self._budget = SolveBudget()
        self.error: NotConverged | None = None
        # of a smaller window: a pass in a larger one refutes it
        self._limit: LimitLoad | None = None

    @property
    def seconds(self) -> float:
        """Processor time so far."""
        return time.process_time() - self._started - self._elsewhere

    def _begin(self, reach: float) -> None:
        self._reach, self._passes = reach, self._window(self._last, self._view, reach)
        self._scene.refuse(self._last, self._passes.shown(0)[0])
        self._steps: list[int] = []
        self._traces: list[Any] = []
        self._found: Pass[Any] | None = None
        self._left: Any = None
        if self._state and reach == self._state["reach"].item():
            self._traces, self._left = self._passes.begin(self._state)
            self._steps = self._state["steps"].astype(int).tolist()
        each = []
        if asked := self._scene.derivatives:
            wider = asked.by if self._passes.exact > EXACT else ()
            self._family = _Family(asked, self._scene, self._last, wider)
            self._family.keep_mesh(self._last, self._passes.same_mesh)
            each = [self._last, *self._family.runs(self._last)]
        plain = replace(self._scene, derivatives=None)
        self._beside = [_Path(plain, parameters, self._window, None) for parameters in each]
        for other in self._beside:
            other._begin(reach)

    def _take(self, found: Pass[Any]) -> None:
        """Go on to a pass that is found."""
        self._left = self._found.left if self._found else self._left
        self._found, self._limit = found, None
        self._steps.append(max(found.steps, 1))
        self._traces.append(self._passes.trace(found))
        last, number = found, len(self._steps) - 1
        for other in self._beside:  # each begins where the one before it has ended
            if other.error or self._beside[0].error:
                continue
            try:
                drives = [each._passes.load(number).load.drive for each in (self, other)]
                if (drives[0] is None) != (drives[1] is None):
                    raise NotConverged("the wheel is locked in one run, and turns in the other")
                last = other._passes.follow(last, other._found, number)
                other._take(last)
            except NotConverged as failure:
                other.error = failure

    def runs(self, runs: Sequence[Any], monitor: Monitor, reach: float) -> Iterator[FinishedRun]:
        """Yield the runs whose passes are found; ``error`` is the reason if others are not.

        ``reach`` is the ratio of the size of the window to the usual size.
        """
        remaining = list(runs)
        try:
            self._begin(reach)
        except ModelError:
            if self.error is None:
                raise
            return  # this window has no room: keep the error of the smaller one
        self.error = None
        try:
            first = len(self._steps) + 1
            for number, found in enumerate(self._passes.found(self._budget), start=first):
                self._take(found)
                monitor(min(number / self._last.passes, 0.99))
                decided = self._passes.decided(self._traces)
                while remaining and (decided or remaining[0].passes == number):
                    run = self.finished(remaining.pop(0))
                    paused = time.process_time()
                    yield run
                    self._elsewhere += time.process_time() - paused
                if not remaining:
                    return
        except NotConverged as failure:
            self.error = failure
            if isinstance(failure.__cause__, LimitLoad):
                self._limit = failure.__cause__

    def finished(self, run: Any) -> FinishedRun:
        """Return a run with the results of the last pass found."""
        passes, found, before = self._passes, self._found, self._left
        number = max(len(self._steps) - 1, 0)
        (samples, acting), points, beside = passes.shown(number), {}, None
        view, body = samples.view, cast("SteadyBody", samples.system)
        if found is not None and self.error is None:
            loaded, left = body.under_load(found), body.left_by(found)
            points = {name: left if name == view.unloaded else loaded for name in view.stages}
            if (fields := passes.beside) is not None:
                beside = partial(fields, found)
        seconds = self.seconds
        runs: list[Any] = [run, *self._family.runs(run)] if self._family else []
        others = [other.finished(own) for other, own in zip(self._beside, runs, strict=False)]

        def check() -> Audit:
            assert found is not None
            return passes.audit(found, before, number)

        def state() -> Mapping[str, Array]:
            if found is None or self.error or self._family:  # neighbours have no state
                return {}
            own = passes.state(found, self._traces)
            kept = {"reach": [self._reach], "seconds": [seconds], "steps": self._steps}
            return own and {**own, **{k: np.array(v, dtype=float) for k, v in kept.items()}}

        return FinishedRun(
            parameters=run,
            samples=samples,
            acting=acting,
            outcome=Outcome(
                tally=Tally(iterations=tuple(self._steps), seconds=seconds, plastic_work=np.nan),
                last=points.get(view.unloaded),
                points=points,
                traces=tuple(self._traces),
                error=self._reported(),
            ),
            check=check,
            doubts=doubts({view.profile_body: passes.law}),
            beside=beside,
            derived=self.derived(others),
            state=state,
        )

    def derived(self, runs: Sequence[FinishedRun]) -> Callable[..., Values] | None:
        """Return what gives the derivatives of a run, of its neighbours; None if none are asked."""
        return partial(self._family.values, runs) if self._family else None

    def _reported(self) -> NotConverged | None:
        """Return the error: a limit load, or the window that is too small with its size."""
        if isinstance(self.error, WindowTooSmall) and self._limit:
            return self._limit
        if isinstance(self.error, WindowTooSmall) and self._passes.extent:
            return WindowTooSmall(f"{self.error}, in the largest zone, {self._passes.extent}")
        return self.error
