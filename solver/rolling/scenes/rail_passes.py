"""Runs of scenes in three dimensions: steady passes of a load over an endless prism."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from solver.audit.report import Audit
from solver.linear.threads import one_thread
from solver.memory import kept
from solver.results.acting import Acting
from solver.results.samples import Samples
from solver.results.view import View
from solver.rolling.audit.plain_rail import PlainPrism
from solver.rolling.audit.rail import audit_prism
from solver.rolling.passing import Pass, SolveBudget
from solver.rolling.rail.flow import PrismState
from solver.rolling.rail.patch_contact import AppliedPatch, PatchContact, PatchLoad
from solver.rolling.rail.track import PrismTrack
from solver.rolling.results.rail import PrismBody, of_patch, zone_fields
from solver.rolling.scenes.pass_runner import Passes
from solver.rolling.scenes.passes import PassTrace
from solver.rolling.search import search
from solver.tensors import to_tensor
from solver.typing import Array

REACHES = (1.0, 1.4, 2.0)
"""Ratios of the size of zone and window to the usual size, tried in turn."""
_SETTLED = 1
"""Largest number of Newton steps of a pass after which the next pass begins with its strain."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RailTrace(PassTrace):
    """The state after a pass over a prism; ``lowest`` (6,) is the least residual stress [MPa]."""

    lowest: Array


class RolledPrism(ABC):
    """The prism of a scene, and its loads.

    Attributes
    ----------
    parameters : parameters of the scene
    """

    def __init__(self, parameters: Any) -> None:
        self.parameters, self._passes = parameters, parameters.each_pass()
        self._made: tuple[PrismTrack, Any, PatchLoad] | None = None

    @abstractmethod
    def track(self, reach: float) -> PrismTrack:
        """Return the prism; ``reach`` is the ratio of zone and window to their usual size.

        Raises `ModelError` if the section has no room for them.
        """

    @abstractmethod
    def made(self, track: PrismTrack, own: Any, last: Any) -> PatchLoad:
        """Return the load of a pass with these parameters; ``last`` is one on this prism, or None.

        Raises `LimitLoad` if no prism of the material can carry it.
        """

    def load(self, track: PrismTrack, number: int) -> PatchLoad:
        """Return the load of a pass, counted from 0: the same object as before if it is equal."""
        own, known = self._passes[number], self._made
        if known is None or known[:2] != (track, own):
            last = known[2] if known is not None and known[0] is track else None
            known = self._made = track, own, self.made(track, own, last)
        return known[2]


class RailPasses(Passes):
    """Passes over a prism.

    Parameters
    ----------
    rolled : (parameters of a scene) -> its prism and loads
    """

    def __init__(
        self, rolled: Callable[[Any], RolledPrism], parameters: Any, view: View, reach: float
    ) -> None:
        self.parameters, self.law = parameters, parameters.material()
        self._rolled = rolled(parameters)
        self._track = self._rolled.track(reach)
        body = PrismBody(self._track, self.law, view.profile_body)
        self._samples = Samples(body, view)
        z, y = self._track.points
        self.extent = f"{np.ptp(z):.3g} mm wide and {np.ptp(y):.3g} mm deep"
        self.beside = partial(zone_fields, body, view.loaded, view.unloaded)

    def found(self, budget: SolveBudget) -> Iterator[Pass[PrismState]]:
        """See `Passes`.

        A pass begins with the elastic solution of its load on the residual strain. If the passes
        are nearly the same, it begins with the strain of the last pass; while passes still yield,
        that guess is worse, and after another load it does not converge.
        """
        track, law = self._track, self.law
        before = track.virgin(law)
        found: Pass[PrismState] | None = None
        last: PatchLoad | None = None
        for number in range(self.parameters.passes):
            load, guess, start = self._rolled.load(track, number), None, None
            if found is not None:
                start = found.loading.start
                guess = found.strain if load is last and found.steps <= _SETTLED else None
            with one_thread():
                found = search(
                    track, law, load, before, guess, start=start, budget=budget, wider=False
                )
            budget.renew()
            before, last = found.after, load
            yield found

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

    def audit(
        self, found: Pass[PrismState], previous: Pass[PrismState] | None, number: int
    ) -> Audit:
        """See `Passes`."""
        return audit_prism(self._track, self.law, found, previous, _plain(self._track))


@kept
def _plain(track: PrismTrack) -> PlainPrism:
    """Return the second evaluation of a prism for the audit; all runs over it share it."""
    return PlainPrism(track)


def contact_of(found: Pass[PrismState]) -> PatchContact:
    """Return the contact of a pass."""
    assert isinstance(found.loading, AppliedPatch)
    return found.loading.contact
