"""Find numbers of a material that are allowed but look like a wrong unit."""

from __future__ import annotations

import math
from collections.abc import Mapping

from solver.materials.law import Law

_YIELD_STRAIN = 0.05
"""Ratio of yield stress to Young's modulus; no metal (hardest wires: 0.02) or hard polymer reaches
it."""
_METALS = (1e4, 1e6)
"""Range of Young's modulus of metals and ceramics, with a margin [MPa]."""
_UNITS = (("GPa", 1e3, 1.0), ("kPa", 1.0, 1e-3), ("Pa", 1.0, 1e-6))
"""Wrong unit, and the factors to MPa of Young's modulus and of the yield stress if only that one is
given in it."""


def doubts(laws: Mapping[str, Law]) -> tuple[str, ...]:
    """Return a message for each body whose yield strain suggests that a number has a wrong unit.

    It names the number that is probably not in MPa.

    Parameters
    ----------
    laws : law of each body by its name
    """
    every = ((body, law.yield_stress, law.elasticity.youngs_modulus) for body, law in laws.items())
    return tuple(
        f"{body}.{_suspected(strength, E)}; no metal has a yield strain of {strength / E:.3g} "
        f"(yield_stress = {strength:g} MPa, youngs_modulus = {E:g} MPa)"
        for body, strength, E in every
        if _YIELD_STRAIN * E < strength < math.inf
    )


def _suspected(strength: float, E: float) -> str:
    """Return name, value and likely unit of the number that was probably given in a wrong unit."""
    for unit, stiffer, weaker in _UNITS:
        modulus, Re = E * stiffer, strength * weaker
        if _METALS[0] <= modulus <= _METALS[1] and Re <= _YIELD_STRAIN * modulus:
            if stiffer > 1.0:
                return f"youngs_modulus = {E:g}: {modulus:g} MPa was probably meant, {E:g} {unit}"
            return (
                f"yield_stress = {strength:g}: {Re:g} MPa was probably meant, {strength:g} {unit}"
            )
    return f"youngs_modulus = {E:g}: must be in MPa, like the yield stress"
