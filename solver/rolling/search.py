"""Find a steady pass directly, or by continuation from passes that are easier to find.

If Newton's method fails although a pass may exist, try in turn:

1. if the first contact problem has no solution: the same load with smaller moments first
2. on a body that has not yielded: the same load with more hardening, which is then reduced to that
   of the material; then a heavier load, and back
3. on one that has yielded: lighter loads first

If friction exceeds the shear strength of a material without hardening, the contact flattens until
it does not; more than 30 % of plastic strain in a pass counts as the limit load.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np

from solver.errors import LimitLoad, NoContact, NotConverged, Spins, TooLong, WindowTooSmall
from solver.materials.elastic_plastic import Material
from solver.materials.law import Law
from solver.rolling.load import PassedBody, PassingLoad, RollingLoad, S, spinning
from solver.rolling.passing import TOLERANCE, Pass, SolveBudget, passing
from solver.typing import Array

_HARDEST, _SOFTEST = 0.024, 1e-4
"""Hardening ratios, slope of the uniaxial curve over Young's modulus: the first and the last
one."""
_STIFFEST = 0.3
"""Largest hardening ratio to begin with if no pass is found with `_HARDEST`, only for a material
that hardens. Without hardening such a load is above the limit, or too close to it."""
_SHARE, _SLOWEST = 1 / 3, 0.8
"""Ratio of a hardening ratio to the previous one: the first, and the largest after failures."""
_LARGE = 0.3
"""Plastic strain added in a pass above which the load counts as the limit load of a material
without hardening. It grows as elements become smaller."""
_LIGHTER, _HEAVIER = (0.8, 0.9, 0.95), (1.1, 1.06, 1.03)
"""Factors of the load in the passes that lead to it."""
_PARTS, _TOLERANCE = 8, 2e-3
"""Increments between two points of a row, and tolerance, of passes with reduced hardening."""


def search(
    track: PassedBody[S],
    material: Law,
    load: PassingLoad,
    before: S,
    guess: Array | None = None,
    *,
    start: Any = None,
    parts: int | None = None,
    tolerance: float = TOLERANCE,
    budget: SolveBudget | None = None,
    wider: bool = True,
) -> Pass[S]:
    """Return the steady pass that `passing` finds, from this guess or by continuation.

    Other parameters are those of `passing`.

    Parameters
    ----------
    wider : whether the search ends with the error of any tried pass that needs a larger window, or
        too many solves. Otherwise too many solves prove nothing, nor does a window that is too
        small for a heavier load or for full slip; a window that is too small for an easier pass is
        the error, with a limit load of the pass itself as its cause

    Raises
    ------
    LimitLoad, WindowTooSmall, TooLong, Spins, NotConverged
        as `passing` does, `TooLong` for all attempts together; `LimitLoad` also if a pass adds more
        than 30 % of plastic strain in a material without hardening
    """
    budget = budget or SolveBudget()

    def rolled(
        law: Law, rolls: RollingLoad, guess: Array | None, parts: int | None, tolerance: float
    ) -> Pass[S]:
        nonlocal start
        given = rolls is load.load
        try:
            found = passing(
                track, law, load.changed(load=rolls), before, guess, start=start, parts=parts,
                tolerance=tolerance, budget=budget,
            )  # fmt: skip
        except Spins as spins:
            if given and law is material:
                raise
            raise NotConverged(str(spins)) from spins  # an easier pass proves nothing
        if given:  # the contact of another load may be far from that of this one
            start = found.loading.start
        return found

    def exactly(rolls: RollingLoad, guess: Array | None = None) -> Pass[S]:
        return rolled(material, rolls, guess, parts, tolerance)

    def eased(rolls: RollingLoad, ratio: float, guess: Array | None) -> Pass[S]:
        return rolled(_linear(material, ratio), rolls, guess, _PARTS, _TOLERANCE)

    linear, E = material.linear_hardening, material.elasticity.youngs_modulus
    # to 12 digits: the rounding of a ratio that is one of those below must not decide
    own = float(f"{linear.modulus / (E + linear.modulus):.12g}") if linear else 0.0
    largest = np.inf if material.hardens else _LARGE
    unproved = () if wider else (WindowTooSmall,)
    rolls = load.load

    def easier(found: Pass[S] | NotConverged) -> Pass[S] | NotConverged:
        if isinstance(found, NoContact):  # contact on the elastic track differs from the final one
            found = _approached(exactly, rolls.driven, _LIGHTER, None, found)
        if isinstance(found, NoContact):
            with suppress(*unproved):
                _check_spinning(exactly, rolls)
        # on a body that has yielded more hardening would act on strain accumulated with less
        if own < _HARDEST and not before.accumulated.any():
            if isinstance(found, NotConverged):
                found = _tried(
                    _fading, partial(eased, rolls), partial(exactly, rolls), own, largest
                )
            if isinstance(found, NotConverged) and not isinstance(found, LimitLoad):
                above = rolls.scaled(_HEAVIER[0])
                with suppress(*unproved):
                    begun = _tried(
                        _fading, partial(eased, above), partial(exactly, above), own, np.inf
                    )
                    found = _approached(exactly, rolls.scaled, _HEAVIER[1:], begun, found)
        else:
            if guess is not None and isinstance(found, NotConverged):  # it may be unsuitable
                found = _tried(exactly, rolls)
            if isinstance(found, NotConverged):
                found = _approached(exactly, rolls.scaled, _LIGHTER, None, found)
        return found

    found = _tried(exactly, rolls, guess)
    try:
        found = easier(found)
    except (WindowTooSmall, TooLong) as error:
        if wider or isinstance(error, WindowTooSmall):
            limit = found if isinstance(found, LimitLoad) and not wider else error.__cause__
            raise error from limit
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


def _check_spinning(exactly: Callable[[RollingLoad], Pass[Any]], load: RollingLoad) -> None:
    """Raise `Spins` if the moment on a wheel exceeds that of full slip.

    Full slip may carry less than friction times load: shear on a slope carries a part of the load,
    and pressure shortens the rim along which shear works.
    """
    most = _tried(exactly, load.slipping) if load.drive else None
    if load.drive is None or most is None or isinstance(most, NotConverged):
        return
    carried = most.loading.moment / load.drive
    if carried < 1.0:
        raise spinning(carried)


def _tried(solve: Callable[..., Pass[S]], *given: Any) -> Pass[S] | NotConverged:
    """Return a pass, or its error; raise an error that no easier pass can mend."""
    try:
        return solve(*given)
    except (WindowTooSmall, TooLong, Spins):
        raise
    except NotConverged as failure:
        return failure


def _fading(
    eased: Callable[[float, Array | None], Pass[S]],
    exactly: Callable[[Array | None], Pass[S]],
    own: float,
    largest: float,
) -> Pass[S]:
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
    found: Pass[S] | None = None
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
    exactly: Callable[..., Pass[S]],
    eased: Callable[[float], RollingLoad],
    shares: tuple[float, ...],
    begun: Pass[S] | NotConverged | None,
    failure: NotConverged,
) -> Pass[S] | NotConverged:
    """Return the pass found by changing the load through ``shares`` to 1, or ``failure``.

    ``eased`` gives the load for a share; ``begun`` is the pass to start from, None for no guess.
    """
    found = begun
    for share in (*shares, 1.0):
        if isinstance(found, NotConverged):
            return failure
        found = _tried(exactly, eased(share), None if found is None else found.strain)
    return failure if found is None else found
