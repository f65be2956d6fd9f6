"""Seeded columns of two blocks under uniform stress: any mesh, law, stiffness and element."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from solver import Material, PathControl
from solver.loading.program import Tolerances
from tests.stability.closed import Column, judge_column
from tests.stability.kinds.draws import RULES
from tests.stability.trial import Scene, brief, tells

COUNT = 8
SEED = 1678
STATES = ("plane_stress", "plane_strain", "axisymmetric")
ELEMENTS = ("quad8", "quad4", "quad9", "tri6", "tri3")
YIELD = 300.0
POISSON = (0.0, 0.3, 0.45, 0.499, 0.4999)
ROUNDED = Tolerances().residual / 10


def random_column(number: int, rng: np.random.Generator) -> Column:
    """Return a column; states and elements take turns, the rest is drawn."""
    rule = str(rng.choice(RULES))
    law = Material(
        youngs_modulus=2e5,
        poisson_ratio=float(rng.choice(POISSON)),
        yield_stress=YIELD,
        hardening=rule,
        hardening_ratio=0.0 if rule == "none" else float(10 ** rng.uniform(-6, -0.3)),
        isotropic_fraction=float(rng.random()),
    )
    # surfaces that slide by finite distances keep their stress uniform only if both widen alike
    finite = bool(rng.random() < 0.4)
    stiffer = 1.0 if finite else float(10 ** rng.choice([-5.0, 5.0, *rng.uniform(-5, 5, 2)]))
    height = 4.0 * float(10 ** rng.choice([0.0, *rng.uniform(-3, 1, 2)]))
    fine = int(rng.choice([1, 4, 20]))
    cells = [(fine, int(rng.integers(1, 4))), (int(rng.integers(1, 6)), int(rng.integers(1, 5)))]
    if rng.random() < 0.5:
        cells.reverse()
    # nodes are moved by a share of the mean size, which suits equal elements only
    crooked = bool(rng.random() < 0.5)
    state = STATES[number // 5 % 3]
    decades = 1 if state == "axisymmetric" else 4
    strained = 2e-3 * 2e5 * min(stiffer, 1.0)
    return Column(
        upper=replace(law, youngs_modulus=2e5 * stiffer),
        lower=law,
        pressure=min(YIELD * float(rng.choice([1e-6, 0.01, 0.5, 0.9999])), strained),
        state=state,
        element=ELEMENTS[number % 5],
        thickness=float(10 ** rng.uniform(-3, 3)),
        heights=(height, height * float(rng.uniform(0.5, 2.0))),
        cells=(cells[0], cells[1]),
        sliding="finite" if finite else "small",
        perturb=float(rng.choice([0.1, 0.25])) if crooked else 0.0,
        grading=1.0 if crooked else float(10 ** rng.uniform(-decades, decades)),
        seed=number,
    )


def _bent(column: Column) -> float:
    """Return by how much rounding grows on the way to the stress of a strip that lies on another.

    A strip of length L and height h that contact alone holds bends under forces F by about
    F (L/h)^3 / E; contact forces known by that share, over elements of length d, bend it by a
    stress of 6 (d/h)^2 of the pressure.
    """
    slender = [
        (column.width / h) ** 3 * 6 * (column.width / nx / h) ** 2
        for h, (nx, _) in zip(column.heights, column.cells, strict=True)
    ]
    return max(slender)


def _scene(number: int, column: Column, steps: int) -> Scene:
    """Return a column.

    What a stiff block moves with a soft one is rounded: a change of eps strains it by a force of
    eps times the ratio of stiffnesses, that of change of volume included, which no iterate can be
    nearer to equilibrium than. A force balanced to 1e-8 is much for the smallest elements. Where
    rounding bends a strip by as much as the load, normals that turn with it need not converge.
    """
    upper, lower = column.upper, column.lower
    eps = float(np.finfo(float).eps)
    ratio = max(upper.youngs_modulus / lower.youngs_modulus, 1.0)
    rounded = eps * ratio / (1 - 2 * upper.poisson_ratio)
    uneven = max(column.grading, 1 / column.grading)
    smallest = (20 * uneven) ** (2 if column.state == "axisymmetric" else 1)
    limit = 1e-6 + 200 * eps * ratio + 1e-8 * smallest + 30 * eps * _bent(column)
    honest = "out-of-balance force of .*e-0[78]" if rounded > ROUNDED else None
    if limit > 1 and column.sliding == "finite":
        honest = "out-of-balance force"
    return Scene(
        what=f"{brief(column)} in {steps}",
        run=partial(column.solve, control=PathControl(load_step=1 / steps, unload_steps=steps)),
        judge=partial(judge_column, column, -column.pressure, limit=limit),
        honest=tells(honest) if honest else None,
    )


def scenes(count: int = COUNT) -> list[Scene]:
    """Return the columns, every other in one increment."""
    rng = np.random.default_rng(SEED)
    return [_scene(k, random_column(k, rng), (1, 3)[k % 2]) for k in range(count)]
