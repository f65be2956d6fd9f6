"""A load in a patch of contact, as a load of `solver.rolling.passing`."""

from __future__ import annotations

from dataclasses import dataclass

from solver.rolling.load import AppliedLoad
from solver.rolling.rail.patch_contact import PatchContact, PatchLoad
from solver.rolling.rail.track import PrismField
from solver.typing import Array


@dataclass(frozen=True, slots=True)
class AppliedPatch(AppliedLoad):
    """A load on a prism.

    Attributes
    ----------
    contact : tractions, gap and slip
    load : the load whose contact it is
    """

    contact: PatchContact
    load: PatchLoad


class PatchPassing:
    """A load in a patch of contact, as `solver.rolling.load.PassingLoad`.

    Parameters
    ----------
    load : the load
    moved : (m, 3) displacement of the surface before the pass [mm]
    start : a contact to begin from, for instance that of a similar pass
    """

    def __init__(
        self, load: PatchLoad, moved: Array | None = None, start: PatchContact | None = None
    ) -> None:
        self._load, self._moved, self._start = load, moved, start
        self._last: PatchContact | None = None

    def on(self, u: PrismField) -> AppliedPatch:
        """See `PassingLoad`."""
        moved = u.displacement if self._moved is None else u.displacement + self._moved
        start = self._start if self._last is None else self._last
        if self._last is not None and self._last.near is not None:
            start = self._last.near(moved)
        self._last = found = self._load.solve(moved, start)

        def along(change: PrismField) -> PrismField:
            return change.loaded(found.along(change.displacement))

        loaded = u.loaded(found.traction)
        return AppliedPatch(found.force, loaded, along, found, self._load)

    def scaled(self, share: float) -> PatchPassing:
        """See `PassingLoad`."""
        return PatchPassing(self._load.scaled(share), self._moved)

    def driven(self, share: float) -> PatchPassing:
        """See `PassingLoad`."""
        return PatchPassing(self._load.driven(share), self._moved)

    @property
    def moment(self) -> float:
        """See `PassingLoad`."""
        return self._load.moment

    @property
    def slipping(self) -> PatchPassing:
        """See `PassingLoad`."""
        return PatchPassing(self._load.slipping, self._moved)
