"""A block without vertical support, some way above the other, pushed towards it or away."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from solver import Material, Solution
from tests.stability.closed import STEEL, Column, judge_column
from tests.stability.trial import Figure, Scene, brief, tells, tells_size

YIELDING = Material(
    youngs_modulus=2e5, poisson_ratio=0.3, yield_stress=200.0, hardening="kinematic",
    hardening_ratio=0.01,
)  # fmt: skip
FAR = 0.25
"""Gaps above this many millimetres, about a sixth of an element, may be refused."""


def _judge(column: Column, solution: Solution) -> dict[str, Figure]:
    return judge_column(column, -column.pressure, solution)


def _pushed(column: Column) -> Scene:
    gap = -column.overlap
    told = tells_size(gap, "apart|gap|distance|away|far|reach")
    return Scene(
        what=brief(column),
        run=column.solve,
        judge=partial(_judge, column),
        refusal=told if gap > FAR else None,
        honest=told if gap > FAR else None,
    )


def _pulled(column: Column) -> Scene:
    """A block that nothing holds back has no equilibrium: any refusal but a limit will do."""
    told = tells("upper|contact")
    return Scene(what=brief(column), run=column.solve, refusal=told, honest=told)


def scenes() -> list[Scene]:
    """Return gaps of 2.5e-7 to 2 heights, and blocks pulled away."""
    gaps = [
        Column(overlap=-1e-6),
        Column(overlap=-1e-4, upper=YIELDING, lower=YIELDING, sliding="finite"),
        Column(overlap=-1e-2, friction=0.3, state="plane_strain", lower=STEEL),
        Column(overlap=-0.4, element="quad9"),
        Column(overlap=-2.0, upper=YIELDING, lower=YIELDING),
        Column(overlap=-8.0, sliding="finite"),
    ]
    base = Column(pressure=-100.0)
    away = [base, replace(base, overlap=-0.4, upper=YIELDING, friction=0.2)]
    return [_pushed(c) for c in gaps] + [_pulled(c) for c in away]
