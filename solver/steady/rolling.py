"""Pass after pass of the same load over a track without ends."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from solver.errors import LimitLoad, ModelError, NotConverged, WindowTooSmall
from solver.linear.threads import one_thread
from solver.steady.passing import PARTS, TOLERANCE, passing

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    import numpy as np
    from numpy.typing import NDArray

    from solver.materials.material import Material
    from solver.steady.layers import Layers
    from solver.steady.load import Load
    from solver.steady.passing import Pass
    from solver.steady.track import Track

    Array = NDArray[np.float64]

_SHARES = (0.8, 0.9, 0.95)
"""Of a load, by which one approaches it."""
EXACT_AFTER = 4
REPEATED = 1e-5
"""After so many passes the tolerance is this one: small changes of many passes add up."""


def rolling(
    track: Track,
    material: Material,
    load: Load | Iterable[Load],
    directions: Iterable[int],
    *,
    guess: Array | None = None,
    parts: int = PARTS,
) -> Iterator[Pass]:
    """Yield the passes of a load over a track that begins without plastic strain.

    Parameters
    ----------
    track : with the elastic constants of the material
    material : of the track
    load : as it goes along +x; one for all passes, or one for each
    directions : for each pass, 1 along +x, -1 back
    guess : strains (n_rows, n_columns, 4) that the first pass adds, as a coarser mesh has them
    parts : increments between two points of a row

    Raises
    ------
    ModelError
        if the track has other elastic constants
    LimitLoad
        if plastic strain grows without bound
    NotConverged
        if a pass is not found
    """
    if material.elasticity != track.elasticity:
        raise ModelError(
            "material", material.elasticity, f"must have those of the track, {track.elasticity}"
        )
    state: Layers = track.rows.virgin
    guesses: dict[tuple[int, int], Array] = {}
    loads = load if isinstance(load, Iterable) else itertools.repeat(load)
    for number, (own, direction) in enumerate(zip(loads, directions, strict=False)):
        which = id(own), direction
        solve = partial(
            passing, track, material, before=state if direction == 1 else state.mirrored,
            parts=parts, tolerance=TOLERANCE if number < EXACT_AFTER else REPEATED,
        )  # fmt: skip
        with one_thread():
            found = _found(solve, own, guesses.get(which, guess))
        found = replace(found, direction=direction)
        guesses[which] = guess = found.strain
        state = found.left
        yield found


def _found(solve: Callable[..., Pass], load: Load, guess: Array | None) -> Pass:
    """Return a pass from a guess, or from the elastic one, or from lighter loads.

    Newton's method may lose its way where much flows at once, and take that for a limit. It is one
    only where lighter loads do not lead to the load.
    """
    try:
        return solve(load, guess=guess)
    except WindowTooSmall:
        raise
    except NotConverged as failure:
        if guess is not None and not isinstance(failure, LimitLoad):
            with suppress(NotConverged):
                return solve(load)
        guess = None
        for share in _SHARES:
            try:
                guess = solve(load.lighter(share), guess=guess).strain
            except WindowTooSmall:
                raise
            except NotConverged:
                raise failure from None
        return solve(load, guess=guess)
