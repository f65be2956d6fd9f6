"""Runs of scenes in three dimensions: steady passes of a load over an endless prism."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any

import numpy as np

from solver.audit.report import Audit
from solver.errors import LimitLoad, ModelError, NotConverged
from solver.linear.solvers import one_thread
from solver.memory import kept
from solver.results.acting import Acting
from solver.results.fields import Samples
from solver.results.run import FinishedRun
from solver.results.view import View
from solver.rolling.audit.plain_rail import PlainPrism
from solver.rolling.audit.rail import audit_prism
from solver.rolling.passing import Pass, SolveBudget
from solver.rolling.rail.flow import PrismState
from solver.rolling.rail.patch_contact import AppliedPatch, PatchContact, PatchLoad, PatchStart
from solver.rolling.rail.track import PrismTrack
from solver.rolling.results.rail import PrismBody, of_patch, zone_fields
from solver.rolling.scenes.pass_runner import Passes, by_passes
from solver.rolling.scenes.passes import PassTrace
from solver.rolling.scenes.rail_outputs import finer
from solver.rolling.search import search
from solver.scenes.scene import Effort, Monitor, Scene
from solver.tensors import to_tensor
from solver.typing import Array

REACHES = (1.0, 1.4, 2.0)
"""Ratios of the size of zone and window to the usual size, tried in turn."""
_TRIED = {"draft": "standard"}
"""The accuracy that is tried where another one is lost; finer ones than these need too much memory
to be tried unasked."""
_SETTLED = 1
"""Largest number of Newton steps of a pass after which the next pass begins with its strain."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RailTrace(PassTrace):
    """The state after a pass over a prism; ``lowest`` (6,) is the least residual stress [MPa]."""

    lowest: Array


_plain = kept(PlainPrism)
"""(prism) -> its second evaluation for the audit; all runs over it share it."""
_TRACED = tuple(each.name for each in fields(RailTrace))
Prism = Callable[[Any, float], PrismTrack]
"""(parameters, ratio of zone and window to their usual size) -> the prism of a scene."""
LoadOn = Callable[[PrismTrack, Any, Any], PatchLoad]
"""(prism, parameters of a pass, load of an earlier pass or None) -> the load of the pass."""


def by_rail_passes(
    scene: Scene,
    runs: Sequence[Any],
    monitor: Monitor,
    *,
    prism: Prism,
    load_on: LoadOn,
    begun: Mapping[str, Array] | None = None,
) -> Iterator[FinishedRun]:
    """Compute pass after pass, see `by_passes`; with smaller elements if that is the remedy.

    Such runs have a note, and no state: a longer run begins with the usual elements too.
    """
    computed = partial(by_passes, window=partial(RailPasses, prism, load_on), reaches=REACHES)

    def otherwise(remaining: Sequence[Any], error: NotConverged) -> Iterator[FinishedRun] | None:
        last = remaining[-1]
        own = _TRIED.get(last.accuracy)
        if own is None or isinstance(error, LimitLoad) or scene.remedy(last, error) != finer(last):
            return None

        def noted(run: FinishedRun) -> FinishedRun:
            done = "computed" if run.complete else "tried"
            note = f"{error}: {done} with accuracy = {own} instead"
            return replace(run, notes=(*run.notes, note), state=dict)

        return map(noted, computed(scene, [replace(r, accuracy=own) for r in remaining], monitor))

    return computed(scene, runs, monitor, otherwise=otherwise, begun=begun)


def effort_of(work: Callable[[Any], Effort], parameters: Any) -> Effort:
    """Return the work of passes; unknowns and memory are those of what is tried, if more.

    Parameters
    ----------
    work : (parameters) -> the work of passes with their accuracy
    """
    own, other = work(parameters), _TRIED.get(parameters.accuracy)
    if other is not None:
        with suppress(ModelError):  # it has no room for the zone, and will not be tried
            most = work(replace(parameters, accuracy=other))
            unknowns, memory = max(own.unknowns, most.unknowns), max(own.memory, most.memory)
            return replace(own, unknowns=unknowns, memory=memory)
    return own


class RailPasses(Passes):
    """Passes over a prism.

    Parameters
    ----------
    prism, load_on : of the scene
    """

    exact = 1e-10  # rounding of waves leaves 3e-11

    def __init__(
        self, prism: Prism, load_on: LoadOn, parameters: Any, view: View, reach: float
    ) -> None:
        self.parameters, self.law = parameters, parameters.material()
        self._each, self._load_on = parameters.each_pass(), load_on
        self._prism, self._reach = prism, reach
        self._made: tuple[Any, PatchLoad] | None = None
        self.track = prism(parameters, reach)
        body = PrismBody(self.track, self.law, view.profile_body)
        self._samples = Samples(body, view)
        z, y = self.track.points
        self.extent = f"{np.ptp(z):.3g} mm wide and {np.ptp(y):.3g} mm deep"
        self.beside = partial(zone_fields, body, view.loaded, view.unloaded)
        self._first = 0
        self._before: PrismState | None = None
        self._guess: Array | None = None
        self._start: PatchStart | None = None

    def load(self, number: int) -> PatchLoad:
        """See `Passes`: the same object as before if it is equal."""
        own, known = self._each[number], self._made
        if known is None or known[0] != own:
            known = self._made = own, self._load_on(self.track, own, known and known[1])
        return known[1]

    def found(self, budget: SolveBudget) -> Iterator[Pass[PrismState]]:
        """See `Passes`.

        A pass begins with the elastic solution of its load on the residual strain. If the passes
        are nearly the same, it begins with the strain of the last pass; while passes still yield,
        that guess is worse, and after another load it does not converge.

        If an easier pass needs a larger window, that is tried. In the largest one the run ends:
        finer elements would not help.
        """
        track, law, first = self.track, self.law, self._first
        before, guess, start = self._before or track.virgin(law), self._guess, self._start
        last = self.load(first - 1) if first else None
        for number in range(first, self.parameters.passes):
            load = self.load(number)
            with one_thread():
                found = search(
                    track, law, load, before, guess if load is last else None,
                    start=start, budget=budget, wider=False,
                )  # fmt: skip
            budget.renew()
            before, start, last = found.after, found.loading.start, load
            guess = found.strain if found.steps <= _SETTLED else None
            yield found

    def same_mesh(self, parameters: Any) -> bool:
        """See `Passes`. Nodes may move, but not become more or fewer."""
        one, other = self.track, self._prism(parameters, self._reach)
        counts = [
            (each.weights.shape, each.grid.stations, each.modes.stations) for each in (one, other)
        ]
        return counts[0] == counts[1] and np.array_equal(one.section.dofs, other.section.dofs)

    def shown(self, number: int) -> tuple[Samples, Callable[[Any], Acting]]:
        """See `Passes`."""
        return self._samples, of_patch

    def trace(self, found: Pass[PrismState]) -> RailTrace:
        """See `Passes`."""
        after = found.after
        stress = self.law.stiffness(6) @ (after.strain - after.plastic_strain).T
        return RailTrace(
            accumulated=after.accumulated,
            plastic_strain=after.plastic_strain,
            creepage=contact_of(found).creepage,
            surface=float(after.displacement[:, 0].mean()),
            peak=float(after.accumulated.max()),
            lowest=to_tensor(stress).min(axis=1),
        )

    def audit(self, found: Pass[PrismState], left: PrismState | None, number: int) -> Audit:
        """See `Passes`."""
        return audit_prism(self.track, self.law, found, left, _plain(self.track))

    def state(self, found: Pass[PrismState], traces: Sequence[RailTrace]) -> Mapping[str, Array]:
        """See `Passes`."""
        after, contact = found.after, contact_of(found)
        kept = {
            "internal": after.state.packed,
            "strain": after.strain,
            "displacement": after.displacement,
            "traction": contact.traction,
            "motion": np.array([contact.height, contact.creepage, contact.lateral_creepage]),
            **{name: np.stack([getattr(t, name) for t in traces]) for name in _TRACED},
        }
        return {**kept, "guess": found.strain} if found.steps <= _SETTLED else kept

    def begin(self, state: Mapping[str, Array]) -> tuple[list[RailTrace], PrismState]:
        """See `Passes`."""
        virgin = self.track.virgin(self.law)
        left = PrismState(
            virgin.state.unpacked(state["internal"]), state["strain"], state["displacement"]
        )
        each = zip(*(state[name] for name in _TRACED), strict=True)
        traces = [RailTrace(**dict(zip(_TRACED, values, strict=True))) for values in each]
        self._first, self._before, self._guess = len(traces), left, state.get("guess")
        self._start = PatchStart(state["traction"], *state["motion"].tolist())
        return traces, left


def contact_of(found: Pass[PrismState]) -> PatchContact:
    """Return the contact of a pass."""
    assert isinstance(found.loading, AppliedPatch)
    return found.loading.contact
