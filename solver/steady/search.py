"""A steady pass from whatever guess there is: directly, or by way of passes easier to find.

Where much flows at once, Newton's method may diverge though there is a pass. Then, in turn:

1. without contact forces to begin with: the same load with smaller moments first
2. on a track that was not rolled: the same load on a material that hardens, as hardening fades to
   its own; then a heavier load, and back
3. on a track that was rolled: lighter loads first

Where friction asks for more shear than a material bears that does not harden, the contact flattens
until it does; more than 30 % of plastic strain in a pass counts as the limit load.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from solver.errors import LimitLoad, NoContact, NotConverged, Spins, WindowTooSmall
from solver.materials.material import Material
from solver.steady.passing import TOLERANCE, passing
from solver.steady.touching import RollingContact

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from solver.materials.law import Law
    from solver.steady.layers import Layers
    from solver.steady.load import PassingLoad
    from solver.steady.passing import Pass
    from solver.steady.track import Track

    Array = NDArray[np.float64]

_HARDEST, _SOFTEST = 0.024, 1e-4
"""Slopes of the uniaxial curve / Young's modulus, from which hardening fades away, and to which."""
_STIFFEST = 0.3
"""The largest one from which it fades to that of a material, where a pass of `_HARDEST` is not
found at once. Without hardening such a load is beyond the limit, or too near to it."""
_SHARE, _SLOWEST = 1 / 3, 0.8
"""Ratio of one slope to the one before: at first, and where a pass is hard to find."""
_LARGE = 0.3
"""Plastic strain that a pass gathers, above which a load is at its limit if the material does not
harden: smaller elements make it more."""
_LIGHTER, _HEAVIER = (0.8, 0.9, 0.95), (1.1, 1.06, 1.03)
"""Of a load, by which one approaches it."""
_PARTS, _TOLERANCE = 8, 2e-3
"""How exactly these passes are found."""


def search(
    track: Track,
    material: Law,
    load: PassingLoad,
    before: Layers,
    guess: Array | None = None,
    *,
    parts: int | None = None,
    tolerance: float = TOLERANCE,
) -> Pass:
    """Return the steady pass that `passing` finds, from the guess or from another one.

    Raises
    ------
    LimitLoad, WindowTooSmall, NotConverged
        as `passing` does; a material that does not harden is at its limit where it adds more than
        30 % of plastic strain
    """

    def exactly(load: PassingLoad, guess: Array | None = None) -> Pass:
        return passing(track, material, load, before, guess, parts=parts, tolerance=tolerance)

    def eased(load: PassingLoad, ratio: float, guess: Array | None) -> Pass:
        return passing(
            track, _linear(material, ratio), load, before, guess, parts=_PARTS, tolerance=_TOLERANCE
        )

    own = 0.0
    if isinstance(material, Material) and material.hardens:
        own = material.hardening_ratio
    largest = np.inf if material.hardens else _LARGE
    found = _tried(exactly, load, guess)
    if isinstance(found, NoContact):  # an elastic track makes another contact than it will have
        found = _approached(exactly, load.driven, _LIGHTER, None, found)
    if isinstance(found, NoContact):
        _not_spinning(exactly, load)
    # on a track that was rolled, hardening would know of the strain that was gathered without it
    if own < _HARDEST and not before.accumulated.any():
        if isinstance(found, NotConverged):
            found = _tried(_fading, partial(eased, load), partial(exactly, load), own, largest)
        if isinstance(found, NotConverged) and not isinstance(found, LimitLoad):
            above = load.scaled(_HEAVIER[0])
            begun = _tried(_fading, partial(eased, above), partial(exactly, above), own, np.inf)
            found = _approached(exactly, load.scaled, _HEAVIER[1:], begun, found)
    else:
        if guess is not None and isinstance(found, NotConverged):  # the guess may be a bad one
            found = _tried(exactly, load)
        if isinstance(found, NotConverged):
            found = _approached(exactly, load.scaled, _LIGHTER, None, found)
    if isinstance(found, NotConverged):
        raise found
    if found.gathered > largest:
        raise _too_much(own)
    return found


def _linear(law: Law, ratio: float) -> Material:
    """Return a material that yields where the law does first, and hardens by this ratio."""
    return Material(
        youngs_modulus=law.elasticity.youngs_modulus,
        poisson_ratio=law.elasticity.poisson_ratio,
        yield_stress=law.yield_stress,
        hardening="kinematic",
        hardening_ratio=ratio,
    )


def _too_much(ratio: float) -> LimitLoad:
    """Return the limit of a load under which even a material of this hardening gathers too much."""
    even = f", even if the material hardens by {ratio:.2g} of Young's modulus" if ratio else ""
    much = f"a steady pass adds more than {_LARGE:.0%} of plastic strain{even}"
    return LimitLoad(f"{much}: this counts as the limit")


def _not_spinning(exactly: Callable[[PassingLoad], Pass], load: PassingLoad) -> None:
    """Raise `Spins` where a wheel is turned by more than full slip bears.

    That may be less than friction times load. Shear on a slope carries a part of the load, and
    pressure shortens the rim, along which shear does its work.
    """
    most = _tried(exactly, load.slipping) if load.moment else None
    if most is None or isinstance(most, NotConverged):
        return
    assert isinstance(most.loading, RollingContact)
    borne = most.loading.moment / load.moment
    if borne < 1.0:
        much = (
            f"the wheel spins: where all of its contact slips, it bears {borne:.2%} of the moment"
        )
        raise Spins(much, borne, 1.0)


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
    largest: float,
) -> Pass:
    """Return the pass to which those of fading hardening lead, in smaller steps where they must.

    None of them may gather more than ``largest``. Where the first one is not found, and the
    material hardens, more hardening fades, with which less flows.
    """
    ratio, share = _HARDEST, _SHARE
    stiffest = _STIFFEST if own else _HARDEST
    found: Pass | None = None
    while True:
        guess = found.strain if found else None
        last = ratio <= max(own, _SOFTEST)
        next_one = _tried(exactly, guess) if last else _tried(eased, ratio, guess)
        if isinstance(next_one, NotConverged):
            if found is None:
                ratio /= _SHARE
                if ratio > stiffest:
                    raise next_one
                continue
            if share > _SLOWEST:
                raise next_one
            ratio, share = ratio / share, share**0.5
        elif last:
            return next_one
        elif next_one.gathered > largest:
            raise _too_much(ratio)
        else:
            found, share = next_one, max(share**2, _SHARE)
        ratio *= share


def _approached(
    exactly: Callable[..., Pass],
    eased: Callable[[float], PassingLoad],
    shares: tuple[float, ...],
    begun: Pass | NotConverged | None,
    failure: NotConverged,
) -> Pass | NotConverged:
    """Return the pass to which other shares of its load lead, or ``failure`` if one is not found.

    ``eased`` gives the load of a share; ``begun`` is the pass from which they begin, None for a
    track at rest.
    """
    found = begun
    for share in (*shares, 1.0):
        if isinstance(found, NotConverged):
            return failure
        found = _tried(exactly, eased(share), None if found is None else found.strain)
    return failure if found is None else found
