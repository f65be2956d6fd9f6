"""Which loads a track certainly bears, and which it may not."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from solver.rolling.scenes.rolling import RollingParameters

STRAINED = 2.0
"""Plastic strain up to which hardening is counted: not much below where a pass counts as flow
without bound."""
NEAR = 0.75
"""Of what is borne. A wheel that sinks in leans on what is before it, and needs more than its
traction tells: that there is an equilibrium is certain only well below."""
NEAR_LARGE, ENOUGH = 0.7, 0.024
"""The same where a steady pass that adds more than 30 % of plastic strain counts as a limit, which
may be well before the limit load; the slope / Young's modulus from which hardening lets it add
more."""
FLATTER = 2.5
"""Approach of the hub / (half-width^2 / radius): log(4 radius / half-width) - 1/2 for a soft wheel
(K.L. Johnson, Contact Mechanics (1985), section 5.6), 2.5 at the largest slope, 0.2."""
BORNE = 1 / (1 + math.pi / 2)
"""Most traction over vertical force that a surface without hardening bears: k times a width that
bears (1 + pi / 2) k beside it (A.P. Green, J. Mech. Phys. Solids 2 (1954) 197-211)."""


def bears(parameters: RollingParameters) -> bool:
    """Whether an equilibrium is certain to exist in every pass."""
    return all(_borne(own) and _held(own) for own in parameters.block)


def flows_ahead(parameters: RollingParameters) -> bool:
    """Whether later passes may flow far before the load.

    A pass that makes the surface flow, or all that is under the load, leaves rows on the yield
    surface. What the next load makes before it falls with the distance only, never to nothing.
    """
    k = parameters.yield_stress / math.sqrt(3)
    return parameters.passes > 1 and any(
        _sheared(own) > NEAR * k or own.peak_pressure > NEAR * (2 + math.pi) * k
        for own in parameters.block
    )


def _sheared(p: RollingParameters) -> float:
    """Return the largest shear under a Hertz pressure [MPa].

    A wheel whose creepage is given, or that is locked, slips wherever it touches at worst.
    """
    return (1.0 if p.guided else abs(p.traction)) * p.friction * p.peak_pressure


def _held(p: RollingParameters) -> bool:
    """Whether friction certainly bears the moment of a wheel.

    The moment is told for the wheel's radius; friction acts on the arm that a flattened rim leaves.
    """
    shorter = FLATTER * (p.half_width / p.radius) ** 2
    return p.load == "hertz" or p.guided or abs(p.traction) <= 1 - shorter


def _borne(p: RollingParameters) -> bool:
    """Whether one pass is borne.

    With the shear m k, a strip bears the pressure k (1 + pi / 2 + acos m + sqrt(1 - m^2)), L.
    Prandtl's (2 + pi) k where there is no shear. A given pressure must be below it everywhere, and
    that of a wheel in the mean: beyond, its contact must become wider by flow alone.
    """
    enough = p.hardening != "none" and p.hardening_ratio >= ENOUGH
    near = NEAR if enough else NEAR_LARGE
    linear = p.material().linear_hardening
    hardened = STRAINED * linear.modulus if enough and linear else 0.0
    k = (p.yield_stress + hardened) / math.sqrt(3)
    shear = _sheared(p)
    if p.load == "contact":
        if p.shear_limit:
            shear = min(shear, p.shear_limit * p.yield_stress / math.sqrt(3))
            if not p.guided and p.friction and abs(p.traction) > near * _transmitted(p):
                return False
        ratio = p.friction * (1.0 if p.guided else abs(p.traction))
        if ratio > near * BORNE and shear > near * k:
            return False
        return math.pi / 4 * p.peak_pressure < k * (2 + math.pi)
    m = min(shear / k, 1.0)
    strip = k * (1 + math.pi / 2 + math.acos(m) + math.sqrt(1 - m**2))
    return m < near and p.peak_pressure < near * strip


def _transmitted(p: RollingParameters) -> float:
    """Return what the limit of shear leaves of friction under a Hertz pressure."""
    x = np.linspace(-1, 1, 201)
    sheared = p.friction * p.peak_pressure * np.sqrt(1 - x**2)
    limit = p.shear_limit * p.yield_stress / math.sqrt(3)
    return float(np.minimum(sheared, limit).sum() / sheared.sum())
