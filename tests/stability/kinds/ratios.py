"""Columns whose stiffness, thickness, load or strength differ by up to nine powers of ten."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from solver import Material, Solution
from solver.loading.program import Tolerances
from tests.stability.closed import STEEL, Column, judge_column, lowered
from tests.stability.trial import Figure, Scene, brief, tells


def _judge(column: Column, solution: Solution) -> dict[str, Figure]:
    """Return the figures of a column, how much each block is shortened among them.

    A stiff block on a soft one moves down with it by u: rounding eps u of its displacements
    strains it by eps u / h, over its own strain some eps times the ratio of the stiffnesses, the
    elements being a few times smaller than the blocks.
    """
    ratio = column.upper.youngs_modulus / column.lower.youngs_modulus
    limit = 1e-7 + 50 * float(np.finfo(float).eps) * ratio
    figures = judge_column(column, -column.pressure, solution, limit=limit)
    low = lowered(solution, "lower", "top")
    law = column.lower
    modulus = law.youngs_modulus / (1 - law.poisson_ratio**2 * (column.state == "plane_strain"))
    expected = column.pressure * column.heights[1] / modulus
    figures["shortening"] = Figure(abs(low - expected) / expected, 1e-7)
    return figures


def _scene(column: Column) -> Scene:
    """Return a column; one whose displacements no float writes finely enough may be given up.

    The last digit of what a stiff block moves with a soft one strains it by a force of eps times
    the ratio of stiffnesses, which no iterate can be nearer to equilibrium than.
    """
    ratio = column.upper.youngs_modulus / column.lower.youngs_modulus
    coarse = np.finfo(float).eps * ratio > Tolerances().residual
    return Scene(
        what=brief(column),
        run=column.solve,
        judge=partial(_judge, column),
        honest=tells("relative out-of-balance force of .*e-0[78]") if coarse else None,
    )


def scenes() -> list[Scene]:
    """Return the columns."""

    def steel(factor: float = 1.0, **law: object) -> Material:
        return replace(STEEL, youngs_modulus=2e5 * factor, **law)

    base = Column()
    ideal = Material(youngs_modulus=2e5, poisson_ratio=0.3, yield_stress=300.0)
    weak = replace(ideal, yield_stress=1e-6, hardening="isotropic", hardening_ratio=0.1)
    return [
        _scene(column)
        for column in (
            replace(base, upper=steel(1e-9), pressure=1e-6),
            replace(base, upper=steel(1e9)),
            replace(base, lower=steel(1e-6), pressure=1e-3),
            replace(base, lower=steel(1e6), state="plane_strain"),
            replace(base, thickness=1e-9),
            replace(base, thickness=1e9, upper=ideal, lower=ideal),
            replace(base, upper=ideal, lower=ideal, pressure=300.0 * 1e-9),
            replace(base, upper=ideal, lower=ideal, pressure=300.0 * 1e-5, element="quad4"),
            replace(base, upper=ideal, lower=ideal, pressure=300.0 * 0.9999, element="tri6"),
            replace(base, upper=replace(ideal, yield_stress=1e15), state="axisymmetric"),
            replace(base, upper=weak, lower=weak, pressure=0.999e-6),
        )
    ]
