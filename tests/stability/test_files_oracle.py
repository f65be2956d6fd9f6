"""What judges records of scene files notices a wrong number of every kind."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from tests.stability.kinds.files import KINDS, SEED, judge, solved
from tests.stability.kinds.rings import Ring, fitted
from tests.stability.kinds.told import Draw, Told

WRONG = [
    ("columns", "contact_normal_force", 1.001),
    ("columns", "point_stress", 1.01),
    ("columns", "reaction_y", 1.001),
    ("hertz", "contact_normal_force", 1.02),
    ("hertz", "top", 1.07),
    ("hertz", "contact_pressure", -1.0),
    ("dragged", "contact_tangential_force", 1.02),
    ("dragged", "contact_shear", 1.02),
    ("dragged", "reaction_x", -1.0),
]


@cache
def run(kind: str) -> tuple[Draw, list[Told]]:
    draw = next(
        d for n in range(9) if not (d := KINDS[kind](n, np.random.default_rng(SEED))).excused
    )
    return draw, solved(draw)


@pytest.mark.parametrize("kind", sorted({kind for kind, _, _ in WRONG}))
def test_what_was_solved_is_right(kind: str) -> None:
    assert all(figure.right for figure in judge(*run(kind)).values())


@pytest.mark.parametrize(("kind", "name", "factor"), WRONG)
def test_a_wrong_number_is_noticed(kind: str, name: str, factor: float) -> None:
    draw, runs = run(kind)
    record = runs[0].record
    if name in record.scalars:
        record = replace(record, scalars={**record.scalars, name: record.scalars[name] * factor})
    else:
        dims, values = record.fields[name]
        record = replace(record, fields={**record.fields, name: (dims, values * factor)})
    figures = judge(draw, [replace(runs[0], record=record)])
    assert not all(figure.right for figure in figures.values())


def test_fitted_rings_meet_and_do_not_pull() -> None:
    given = {"E": 2e5, "nu": 0.3, "plane_strain": True}
    rings = [Ring(inner=1.0, outer=2.0, **given), Ring(inner=2.0, outer=3.0, **given)]
    bore, between, outside = fitted(rings, [1e-3], 10.0)
    gap = rings[1].grows(2.0, between, outside) - rings[0].grows(2.0, bore, between)
    assert (bore, outside) == (10.0, 0.0)
    assert gap == pytest.approx(1e-3)
    assert fitted(rings, [-1.0], 10.0)[1] == 0.0
