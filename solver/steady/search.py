"""A steady pass from whatever guess there is: directly, or by way of passes easier to find.

Newton's method may lose its way where much flows at once, and take that for a limit. Where friction
asks for more shear than the material bears, the contact must flatten until it does, and strain is
not small. The same load on a material that hardens leads there, as its strain grows while hardening
fades away. On a track that was rolled before, lighter loads do.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from solver.errors import LimitLoad, NotConverged, WindowTooSmall
from solver.steady.passing import PARTS, TOLERANCE, passing

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

    from solver.materials.material import Material
    from solver.steady.layers import Layers
    from solver.steady.load import Load
    from solver.steady.passing import Pass
    from solver.steady.track import Track

    Array = NDArray[np.float64]

_HARDEST, _SOFTEST = 0.024, 1e-4
"""Slopes of the uniaxial curve / Young's modulus, from which hardening fades away, and to which."""
_SHARE, _SLOWEST = 1 / 3, 0.8
"""Ratio of one slope to the one before: at first, and where a pass is hard to find."""
_LARGE = 0.3
"""Plastic strain gathered, above which a load is at its limit: less hardening makes it more."""
_SHARES = (0.8, 0.9, 0.95)
"""Of a load, by which one approaches it."""
_PARTS, _TOLERANCE = 8, 2e-3
"""How exactly these passes are found."""


def search(
    track: Track,
    material: Material,
    load: Load,
    before: Layers,
    guess: Array | None = None,
    *,
    parts: int = PARTS,
    tolerance: float = TOLERANCE,
) -> Pass:
    """Return the steady pass that `passing` finds, from the guess or from another one."""

    def exactly(load: Load, guess: Array | None = None) -> Pass:
        return passing(track, material, load, before, guess, parts=parts, tolerance=tolerance)

    def eased(ratio: float, guess: Array | None) -> Pass:
        harder = replace(material, hardening="kinematic", hardening_ratio=ratio)
        return passing(track, harder, load, before, guess, parts=_PARTS, tolerance=_TOLERANCE)

    found = _tried(exactly, load, guess)
    if not isinstance(found, NotConverged):
        return found
    own = material.hardening_ratio if material.hardens else 0.0
    # on a track that was rolled, hardening would know of the strain that was gathered without it
    if own < _HARDEST and not before.accumulated.any():
        return _fading(eased, partial(exactly, load), own)
    if guess is not None and not isinstance(found, LimitLoad):
        found = _tried(exactly, load)
        if not isinstance(found, NotConverged):
            return found
    return _approached(exactly, load, found)


def _tried(solve: Callable[..., Pass], *given: Any) -> Pass | NotConverged:
    """Return a pass, or why it was not found; raise where only a larger window can help."""
    try:
        return solve(*given)
    except WindowTooSmall:
        raise
    except NotConverged as failure:
        return failure


def _fading(
    eased: Callable[[float, Array | None], Pass],
    exactly: Callable[[Array | None], Pass],
    own: float,
) -> Pass:
    """Return the pass to which those of fading hardening lead, in smaller steps where they must."""
    ratio, share = _HARDEST, _SHARE
    found: Pass | None = None
    while True:
        guess = found.strain if found else None
        last = ratio <= max(own, _SOFTEST)
        next_one = _tried(exactly, guess) if last else _tried(eased, ratio, guess)
        if isinstance(next_one, NotConverged):
            if found is None or share > _SLOWEST:
                raise next_one
            ratio, share = ratio / share, share**0.5
        elif last:
            return next_one
        elif next_one.gathered > _LARGE:
            raise LimitLoad(
                "plastic strain grows without bound: a steady pass adds more than "
                f"{_LARGE:.0%}, even if the material hardens by {ratio:.2g} of Young's modulus"
            )
        else:
            found, share = next_one, max(share**2, _SHARE)
        ratio *= share


def _approached(exactly: Callable[..., Pass], load: Load, failure: NotConverged) -> Pass:
    """Return the pass to which lighter loads lead; raise ``failure`` where one is not found."""
    guess: Array | None = None
    for share in _SHARES:
        found = _tried(exactly, load.lighter(share), guess)
        if isinstance(found, NotConverged):
            raise failure
        guess = found.strain
    return exactly(load, guess)
