"""Numbers of a material that are allowed, but look like mistakes."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from solver.materials.law import Law

_YIELD_STRAIN = 0.05
"""Yield stress / Young's modulus, which no metal reaches (the hardest wires 0.02), nor a hard
polymer."""
_METALS = (1e4, 1e6)
"""Young's modulus of metals and ceramics, with room to spare [MPa]."""
_UNITS = (("GPa", 1e3, 1.0), ("kPa", 1.0, 1e-3), ("Pa", 1.0, 1e-6))
"""Another unit, and by how much Young's modulus or else the yield stress then is too small."""


def doubts(laws: Mapping[str, Law]) -> tuple[str, ...]:
    """Return a text for each body whose material yields at a strain that points to a wrong unit.

    It names the number that is probably in another unit than MPa.

    Parameters
    ----------
    laws : body -> its law
    """
    every = ((body, law.yield_stress, law.elasticity.youngs_modulus) for body, law in laws.items())
    return tuple(
        f"{body}.{_suspected(strength, E)}; yield at a strain of {strength / E:.3g} is that of no "
        f"metal (yield_stress = {strength:g} MPa, youngs_modulus = {E:g} MPa)"
        for body, strength, E in every
        if _YIELD_STRAIN * E < strength < math.inf
    )


def _suspected(strength: float, E: float) -> str:
    """Return the number that another unit explains: its name, its value, the likely unit."""
    for unit, stiffer, weaker in _UNITS:
        meant, Re = E * stiffer, strength * weaker
        if _METALS[0] <= meant <= _METALS[1] and Re <= _YIELD_STRAIN * meant:
            if stiffer > 1.0:
                return f"youngs_modulus = {E:g}: {meant:g} MPa was probably meant, {E:g} {unit}"
            return (
                f"yield_stress = {strength:g}: {Re:g} MPa was probably meant, {strength:g} {unit}"
            )
    return f"youngs_modulus = {E:g}: must be in MPa, as the yield stress"
