"""Find a steady pass directly, or by continuation from passes that are easier to find.

If Newton's method fails although a pass may exist, try in turn:

1. if the first contact problem has no solution: the same load with smaller moments first
2. on a track that was not rolled: the same load with more hardening, which is then reduced to that
   of the material; then a heavier load, and back
3. on a track that was rolled: lighter loads first

If friction exceeds the shear strength of a material without hardening, the contact flattens until
it does not; more than 30 % of plastic strain in a pass counts as the limit load.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from solver.errors import LimitLoad, NoContact, NotConverged, Spins, TooLong, WindowTooSmall
from solver.materials.law import Law
from solver.materials.material import Material
from solver.rolling.layers import Layers
from solver.rolling.load import PassingLoad
from solver.rolling.passing import TOLERANCE, Pass, SolveBudget, passing
from solver.rolling.plane.touching import RollingContact
from solver.rolling.plane.track import Track
from solver.typing import Array

_HARDEST, _SOFTEST = 0.024, 1e-4
"""First and last hardening ratio, slope of the uniaxial curve over Young's modulus."""
_STIFFEST = 0.3
"""Largest first hardening ratio, tried if no pass is found with `_HARDEST`, and only for a material
that hardens. Without hardening such a load is above the limit, or too close to it."""
_SHARE, _SLOWEST = 1 / 3, 0.8
"""Ratio of one hardening ratio to the previous one: at first, and at most after failures."""
_LARGE = 0.3
"""Plastic strain added in a pass; above it the load counts as the limit load of a material without
hardening. It grows as elements become smaller."""
_LIGHTER, _HEAVIER = (0.8, 0.9, 0.95), (1.1, 1.06, 1.03)
"""Factors of the load in the passes that lead to it."""
_PARTS, _TOLERANCE = 8, 2e-3
"""Increments between two points of a row, and tolerance, of passes with reduced hardening."""


def search(
    track: Track,
    material: Law,
    load: PassingLoad,
    before: Layers,
    guess: Array | None = None,
    *,
    parts: int | None = None,
    tolerance: float = TOLERANCE,
    budget: SolveBudget | None = None,
) -> Pass[Layers]:
    """Return the steady pass that `passing` finds, from this guess or by continuation.

    Parameters are those of `passing`.

    Raises
    ------
    LimitLoad, WindowTooSmall, TooLong, NotConverged
        as `passing` does, `TooLong` for all attempts together; `LimitLoad` also if a pass adds more
        than 30 % of plastic strain in a material without hardening
    """
    budget = budget or SolveBudget()

    def exactly(load: PassingLoad, guess: Array | None = None) -> Pass[Layers]:
        return passing(
            track, material, load, before, guess, parts=parts, tolerance=tolerance, budget=budget
        )

    def eased(load: PassingLoad, ratio: float, guess: Array | None) -> Pass[Layers]:
        return passing(
            track, _linear(material, ratio), load, before, guess, parts=_PARTS,
            tolerance=_TOLERANCE, budget=budget,
        )  # fmt: skip

    linear, E = material.linear_hardening, material.elasticity.youngs_modulus
    # to 12 digits: the rounding of a ratio that is one of those below must not decide
    own = float(f"{linear.modulus / (E + linear.modulus):.12g}") if linear else 0.0
    largest = np.inf if material.hardens else _LARGE
    found = _tried(exactly, load, guess)
    if isinstance(found, NoContact):  # contact on the elastic track differs from the final one
        found = _approached(exactly, load.driven, _LIGHTER, None, found)
    if isinstance(found, NoContact):
        _check_spinning(exactly, load)
    # on a rolled track more hardening would act on strain that accumulated with less hardening
    if own < _HARDEST and not before.accumulated.any():
        if isinstance(found, NotConverged):
            found = _tried(_fading, partial(eased, load), partial(exactly, load), own, largest)
        if isinstance(found, NotConverged) and not isinstance(found, LimitLoad):
            above = load.scaled(_HEAVIER[0])
            begun = _tried(_fading, partial(eased, above), partial(exactly, above), own, np.inf)
            found = _approached(exactly, load.scaled, _HEAVIER[1:], begun, found)
    else:
        if guess is not None and isinstance(found, NotConverged):  # the guess may be unsuitable
            found = _tried(exactly, load)
        if isinstance(found, NotConverged):
            found = _approached(exactly, load.scaled, _LIGHTER, None, found)
    if isinstance(found, NotConverged):
        raise found
    if found.most_added > largest:
        raise _excessive(own)
    return found


def _linear(law: Law, ratio: float) -> Material:
    """Return a material with the first yield stress of the law and this hardening ratio."""
    return Material(
        youngs_modulus=law.elasticity.youngs_modulus,
        poisson_ratio=law.elasticity.poisson_ratio,
        yield_stress=law.yield_stress,
        hardening="kinematic",
        hardening_ratio=ratio,
    )


def _excessive(ratio: float) -> LimitLoad:
    """Return the error for a pass that adds too much plastic strain even with this hardening."""
    even = f", even if the material hardens by {ratio:.2g} of Young's modulus" if ratio else ""
    much = f"a steady pass adds more than {_LARGE:.0%} of plastic strain{even}"
    return LimitLoad(f"{much}: this counts as the limit")


def _check_spinning(exactly: Callable[[PassingLoad], Pass[Layers]], load: PassingLoad) -> None:
    """Raise `Spins` if the moment on a wheel exceeds that of full slip.

    Full slip may carry less than friction times load: shear on a slope carries a part of the load,
    and pressure shortens the rim along which shear works.
    """
    most = _tried(exactly, load.slipping) if load.moment else None
    if most is None or isinstance(most, NotConverged):
        return
    assert isinstance(most.loading, RollingContact)
    carried = most.loading.moment / load.moment
    if carried < 1.0:
        much = f"the wheel spins: all of its contact slips at {carried:.2%} of the moment"
        raise Spins(much, carried, 1.0)


def _tried(solve: Callable[..., Pass[Layers]], *given: Any) -> Pass[Layers] | NotConverged:
    """Return a pass, or the reason why it was not found; raise `WindowTooSmall` and `TooLong`."""
    try:
        return solve(*given)
    except (WindowTooSmall, TooLong):
        raise
    except NotConverged as failure:
        return failure


def _fading(
    eased: Callable[[float, Array | None], Pass[Layers]],
    exactly: Callable[[Array | None], Pass[Layers]],
    own: float,
    largest: float,
) -> Pass[Layers]:
    """Return the pass found by reducing the hardening ratio, in smaller steps if one fails.

    No pass may add more plastic strain than ``largest``. If the first pass is not found and the
    material hardens, the reduction begins with a larger hardening ratio.

    Parameters
    ----------
    eased : (hardening ratio, guess) -> pass
    exactly : (guess) -> pass of the material
    own : hardening ratio of the material, 0 if it does not harden
    largest : largest plastic strain that a pass may add
    """
    ratio, share = _HARDEST, _SHARE
    stiffest = _STIFFEST if own else _HARDEST
    found: Pass[Layers] | None = None
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
        elif next_one.most_added > largest:
            raise _excessive(ratio)
        else:
            found, share = next_one, max(share**2, _SHARE)
        ratio *= share


def _approached(
    exactly: Callable[..., Pass[Layers]],
    eased: Callable[[float], PassingLoad],
    shares: tuple[float, ...],
    begun: Pass[Layers] | NotConverged | None,
    failure: NotConverged,
) -> Pass[Layers] | NotConverged:
    """Return the pass found by changing the load through ``shares`` to 1, or ``failure``.

    ``eased`` gives the load for a share; ``begun`` is the pass to start from, None for no guess.
    """
    found = begun
    for share in (*shares, 1.0):
        if isinstance(found, NotConverged):
            return failure
        found = _tried(exactly, eased(share), None if found is None else found.strain)
    return failure if found is None else found
