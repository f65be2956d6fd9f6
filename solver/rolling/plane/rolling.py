"""Repeated passes of a load over a track without ends."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial

from solver.linear.solvers import one_thread
from solver.materials.law import Law
from solver.rolling.load import AppliedLoad, PassingLoad
from solver.rolling.passing import TOLERANCE, Pass, SolveBudget
from solver.rolling.plane.layers import Layers
from solver.rolling.plane.track import Track
from solver.rolling.search import search
from solver.typing import Array

EXACT_AFTER = 4
REPEATED = 1e-5
"""Tolerance of passes after the first `EXACT_AFTER`, since small errors of many passes add up."""


@dataclass(frozen=True, slots=True)
class Expected:
    """Prediction of the strain that the next pass adds, extrapolated from the last passes.

    ``strain`` is that of the last pass, ``change`` its change from the pass before (None after one
    pass), and ``kept`` the ratio of that change to the change before.
    """

    strain: Array
    change: Array | None = None
    kept: float = 0.0

    @property
    def next(self) -> Array:
        """The predicted strain of the next pass."""
        return self.strain if self.change is None else self.strain + self.kept * self.change

    def after(self, strain: Array) -> Expected:
        """Return the prediction after a pass that added this strain."""
        change = strain - self.strain
        if self.change is None:
            return Expected(strain, change)
        square = float((self.change**2).sum())
        kept = float((change * self.change).sum()) / square if square else 0.0
        return Expected(strain, change, min(max(kept, 0.0), 1.0))


def rolling(
    track: Track,
    material: Law,
    load: PassingLoad | Iterable[PassingLoad],
    directions: Iterable[int],
    *,
    guess: Array | None = None,
    parts: int | None = None,
    budget: SolveBudget | None = None,
) -> Iterator[Pass[Layers]]:
    """Yield the passes of a load over a track that begins without plastic strain.

    Errors are those of `search`.

    Parameters
    ----------
    track : the half-plane
    material : law of the track, with its elastic constants
    load : load as it moves along +x; one for all passes, or one for each
    directions : for each pass, 1 along +x, -1 along -x
    guess : strains (n_rows, n_columns, 4) that the first pass adds, for instance of a coarser mesh
    parts : number of increments between two points of a row, `PARTS` if None
    budget : counts the solves of each pass, those of earlier attempts at the first one included
    """
    state: Layers = track.virgin(material)
    budget = budget or SolveBudget()
    expected: dict[tuple[int, int], Expected] = {}
    starts: dict[int, AppliedLoad] = {}
    loads = load if isinstance(load, Iterable) else itertools.repeat(load)
    for number, (own, direction) in enumerate(zip(loads, directions, strict=False)):
        which = id(own), direction
        solve = partial(
            search, track, material, own, state if direction == 1 else state.mirrored,
            start=starts.get(id(own)), parts=parts, budget=budget,
            tolerance=TOLERANCE if number < EXACT_AFTER else REPEATED,
        )  # fmt: skip
        with one_thread():
            found = solve(expected[which].next if which in expected else guess)
        budget.renew()
        found = replace(found, direction=direction)
        guess, starts[id(own)] = found.strain, found.loading.start
        expected[which] = expected[which].after(guess) if which in expected else Expected(guess)
        state = found.left
        yield found
