"""Runs of scenes in three dimensions: steady passes of a load over an endless prism."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

import numpy as np

from solver.audit.report import Audit
from solver.errors import ModelError, NotConverged, WindowTooSmall
from solver.linear.threads import one_thread
from solver.loading.outcome import Outcome, Tally
from solver.materials.doubts import doubts
from solver.memory import kept
from solver.results.run import FinishedRun
from solver.results.samples import Samples
from solver.rolling.audit.plain_rail import PlainPrism
from solver.rolling.audit.rail import audit_prism
from solver.rolling.passing import Pass, passing
from solver.rolling.rail.patch_contact import PatchContact, PatchLoad
from solver.rolling.rail.patch_passing import AppliedPatch, PatchPassing
from solver.rolling.rail.state import PrismState
from solver.rolling.rail.track import PrismTrack
from solver.rolling.results.rail import PatchTractions, PrismBody
from solver.rolling.results.rail_fields import zone_fields
from solver.scenes.scene import Monitor, Scene
from solver.tensors import to_tensor
from solver.typing import Array

_REACHES = (1.0, 1.4, 2.0)
"""Ratios of the size of zone and window to the usual size, tried in turn."""
_SETTLED = 1
"""Number of Newton steps of a pass, up to which the next one is taken to be nearly the same."""


@dataclass(frozen=True, slots=True)
class PassTrace:
    """What a pass leaves.

    Attributes
    ----------
    accumulated : (n,) equivalent plastic strain at the points of the zone
    plastic_strain : (n, 6) signed plastic strain there, Mandel
    creepage : creepage of the wheel
    surface : displacement along x of the surface, mean over the zone [mm]
    lowest : (6,) smallest residual stress in the zone [MPa]
    """

    accumulated: Array
    plastic_strain: Array
    creepage: float
    surface: float
    lowest: Array


class RolledPrism(Protocol):
    """What a scene says of its prism.

    Attributes
    ----------
    parameters : parameters of the scene
    """

    parameters: Any

    def track(self, reach: float) -> PrismTrack:
        """Return the prism; ``reach`` is the ratio of zone and window to their usual size.

        Raises `ModelError` if the section has no room for them.
        """

    def load(self, track: PrismTrack, number: int) -> PatchLoad:
        """Return the load of a pass over the prism, counted from 0.

        It is the same object as in the pass before if the load is the same.
        """


def by_passes(
    scene: Scene, runs: Sequence[Any], monitor: Monitor, *, rolled: Callable[[Any], RolledPrism]
) -> Iterator[FinishedRun]:
    """Compute pass after pass; yield the runs, which differ in the number of passes.

    If yielding or contact reaches the edge of zone or window, begin again with larger ones.

    Parameters
    ----------
    rolled : (parameters of a scene) -> its prism and loads
    """
    remaining, prism = list(runs), rolled(runs[-1])
    path = _Path(scene, prism, _REACHES[0])
    for reach in _REACHES:
        if reach > _REACHES[0]:
            try:
                path = _Path(scene, prism, reach)
            except ModelError:
                break  # a zone of this size does not fit
        for run in path.runs(remaining, monitor):
            remaining.pop(0)
            yield run
        if not isinstance(path.error, WindowTooSmall):
            break
    path.tell_size()
    yield from map(path.finished, remaining)


class _Path:
    """The passes that are computed so far, with zone and window of one size.

    Attributes
    ----------
    error : why there are no more, or None
    """

    def __init__(self, scene: Scene, prism: RolledPrism, reach: float) -> None:
        self._started, self._elsewhere = time.process_time(), 0.0
        last = prism.parameters
        self._prism, self._last = prism, last
        self._law, view = last.material(), scene.view(last)
        self._track = prism.track(reach)
        self._body = PrismBody(self._track, self._law, view.profile_body)
        self._samples = Samples(self._body, view)
        self._found: Pass[PrismState] | None = None
        self._previous: Pass[PrismState] | None = None
        self._load: PatchLoad | None = None
        self._steps: list[int] = []
        self._traces: list[PassTrace] = []
        self.error: NotConverged | None = None

    def runs(self, runs: Sequence[Any], monitor: Monitor) -> Iterator[FinishedRun]:
        """Yield those of the runs whose passes are found; ``error`` says why others are not."""
        remaining = list(runs)
        try:
            for number in range(1, self._last.passes + 1):
                self._roll()
                monitor(min(number / self._last.passes, 0.99))
                if remaining[0].passes == number:
                    run = self.finished(remaining.pop(0))
                    paused = time.process_time()
                    yield run
                    self._elsewhere += time.process_time() - paused
        except NotConverged as failure:
            self.error = failure

    def tell_size(self) -> None:
        """Add the size of the zone to an error that it is too small: no larger one is tried."""
        if isinstance(self.error, WindowTooSmall):
            z, y = self._track.points
            size = f"{np.ptp(z):.3g} mm wide and {np.ptp(y):.3g} mm deep"
            self.error = WindowTooSmall(f"{self.error}, in the largest zone, {size}")

    def _roll(self) -> None:
        """Compute the next pass.

        It begins with the elastic solution of its load on the strain that is left. Only where pass
        after pass is nearly the same it begins with the strain of the last one: of passes that
        still yield, that is farther away, and of another load it leads nowhere.
        """
        found = self._found
        before = self._track.virgin(self._law) if found is None else found.after
        load = self._prism.load(self._track, len(self._traces))
        guess = None
        if found is not None and load is self._load and found.steps <= _SETTLED:
            guess = found.strain
        with one_thread():
            contact = None if found is None else contact_of(found)
            moving = PatchPassing(load, before.displacement, contact)
            self._found = passing(self._track, self._law, moving, before, guess)
        self._previous, self._load = found, load
        self._steps.append(max(self._found.steps, 1))
        after = self._found.after
        stress = self._law.stiffness(6) @ (after.strain - after.plastic_strain).T
        self._traces.append(
            PassTrace(
                accumulated=after.accumulated,
                plastic_strain=after.plastic_strain,
                creepage=contact_of(self._found).creepage,
                surface=float(after.displacement[:, 0].mean()),
                lowest=to_tensor(stress).min(axis=1),
            )
        )

    def finished(self, run: Any) -> FinishedRun:
        """Return a run with the results of the last pass found."""
        found, previous, view = self._found, self._previous, self._samples.view
        points, beside = {}, None
        if found is not None and self.error is None:
            points = {
                view.loaded: self._body.under_load(found),
                view.unloaded: self._body.left_by(found),
            }
            beside = partial(zone_fields, self._body, found, view.loaded, view.unloaded)
        seconds = time.process_time() - self._started - self._elsewhere

        def check() -> Audit:
            assert found is not None
            return audit_prism(self._track, self._law, found, previous, _plain(self._track))

        return FinishedRun(
            parameters=run,
            samples=self._samples,
            tractions=PatchTractions(),
            outcome=Outcome(
                tally=Tally(iterations=tuple(self._steps), seconds=seconds, plastic_work=np.nan),
                last=points.get(view.unloaded),
                points=points,
                traces=tuple(self._traces),
                error=self.error,
            ),
            check=check,
            notes=doubts({view.profile_body: self._law}),
            beside=beside,
        )


@kept
def _plain(track: PrismTrack) -> PlainPrism:
    """Return the second evaluation of a prism for the audit; all runs over it share it."""
    return PlainPrism(track)


def contact_of(found: Pass[PrismState]) -> PatchContact:
    """Return the contact of a pass."""
    assert isinstance(found.loading, AppliedPatch)
    return found.loading.contact
