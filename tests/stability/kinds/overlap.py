"""Two blocks between walls that overlap before anything is loaded.

Each is under a uniform stress sigma (tension positive) along y; their shortenings make up the
overlap d: ``sum of L eps(sigma) = -d``, L being the heights of the meshes, eps the uniaxial law
in plane stress, the walls and the blocks without friction.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from scipy.optimize import brentq

from solver import Material, PathControl, Solution
from tests.stability.closed import Column, contact_force, passed, reaction, uniaxial
from tests.stability.closed import stress_miss as miss
from tests.stability.trial import Figure, Scene, brief, tells_size

if TYPE_CHECKING:
    from collections.abc import Callable

SOFT = Material(youngs_modulus=1e3, poisson_ratio=0.4)
HARDENING = Material(
    youngs_modulus=2e5,
    poisson_ratio=0.3,
    yield_stress=60.0,
    hardening="isotropic",
    hardening_ratio=0.05,
)
IDEAL = Material(youngs_modulus=2e5, poisson_ratio=0.3, yield_stress=60.0)
CONTROL = PathControl(load_step=0.25, unload_steps=2)


def strain(material: Material, sigma: float, side: float) -> float:
    """Return the strain along y under ``sigma`` and, elastic, a pressure from the side."""
    beyond = max(abs(sigma) - material.yield_stress, 0.0)
    plastic = math.copysign(beyond / material.plastic_modulus, sigma) if beyond else 0.0
    return (sigma + material.poisson_ratio * side) / material.youngs_modulus + plastic


def squeezed(column: Column) -> float:
    """Return the stress along y that makes up the overlap."""
    upper, lower = column.upper, column.lower
    heights = column.heights[0] + column.overlap, column.heights[1]

    def open_(sigma: float) -> float:
        shorter = [
            L * strain(m, sigma, column.side) for L, m in zip(heights, (upper, lower), strict=True)
        ]
        return sum(shorter) + column.overlap

    ideal = [m.yield_stress for m in (upper, lower) if m.plastic_modulus == 0]
    strongest = min([*ideal, 1e6])
    return -strongest if open_(-strongest) > 0 else float(brentq(open_, -strongest, 0, xtol=1e-12))


def judge(column: Column, solution: Solution) -> dict[str, Figure]:
    """Return the figures of a squeezed column, loaded."""
    sigma = squeezed(column)
    force = -sigma * column.area
    worst = max(miss(solution, b, uniaxial(column, sigma)) for b in ("upper", "lower"))
    return {
        "audit": passed(solution),
        "uniform stress": Figure(worst, 1e-6),
        "contact force": Figure(abs(contact_force(solution) - force) / force, 1e-6),
        "reaction": Figure(abs(reaction(solution, "lower", "bottom") - force) / force, 1e-6),
    }


def _scene(column: Column, judge_: Callable[[Solution], dict[str, Figure]] | None) -> Scene:
    size = column.overlap
    return Scene(
        what=brief(column),
        run=partial(column.solve, control=CONTROL),
        judge=judge_,
        refusal=None if judge_ else tells_size(size, "overlap", "upper|lower|contact|slave"),
    )


def scenes() -> list[Scene]:
    """Return small overlaps, which have an answer, and big ones, which are refused."""
    base = Column(clamped=True, pressure=0.0)
    tiny = replace(base, width=5e-6, heights=(4e-6, 6e-6))
    small = [
        replace(tiny, overlap=4e-10),
        replace(base, overlap=1e-3, side=20.0, element="quad4"),
        replace(base, overlap=1e-3, upper=SOFT, lower=SOFT, sliding="finite"),
        replace(base, overlap=1e-2, upper=HARDENING, lower=HARDENING),
        replace(base, overlap=1e-2, upper=HARDENING, element="tri6"),
        replace(base, overlap=5e-3, upper=IDEAL, lower=HARDENING, element="quad9"),
        replace(base, overlap=5e-3, upper=IDEAL),
        replace(base, overlap=4e-3, upper=IDEAL),
    ]
    big = [
        replace(base, overlap=0.8),
        replace(base, overlap=1.6, upper=HARDENING, sliding="finite"),
        replace(base, overlap=2.4, lower=SOFT, friction=0.3),
        replace(base, overlap=0.9, pressure=50.0, clamped=False),
    ]
    return [_scene(c, partial(judge, c)) for c in small] + [_scene(c, None) for c in big]
