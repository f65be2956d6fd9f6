"""Meshes of long, unequal or crooked elements: uniform stress must pass through all of them."""

from __future__ import annotations

from functools import partial

from tests.stability.closed import Column, judge_column
from tests.stability.trial import Scene, brief


def _limit(column: Column) -> float:
    """Return the limit of stress: 1e-8 of the force, on sides 1e-6 of the width, may be more."""
    return 1e-7 if column.grading == 1 else 1e-6


def scenes() -> list[Scene]:
    """Return columns under uniform pressure."""
    columns = (
        # sides of 1:200, flat and upright
        Column(width=400.0, heights=(2.0, 3.0), cells=((2, 1), (3, 2))),
        Column(width=0.2, heights=(20.0, 30.0), cells=((4, 2), (5, 1)), state="plane_strain"),
        Column(width=400.0, heights=(2.0, 3.0), cells=((2, 1), (3, 2)), element="tri6"),
        # sizes that differ by 1e6
        Column(grading=1e6, cells=((12, 2), (9, 3))),
        Column(grading=1e-6, cells=((9, 2), (14, 3)), state="axisymmetric", element="quad9"),
        Column(perturb=0.25, cells=((5, 4), (4, 6)), seed=1),
        Column(perturb=0.25, cells=((5, 4), (4, 6)), seed=2, element="quad4"),
        Column(perturb=0.25, cells=((4, 4), (5, 3)), seed=3, element="tri3", state="plane_strain"),
    )
    return [
        Scene(
            what=brief(column),
            run=column.solve,
            judge=partial(judge_column, column, -column.pressure, limit=_limit(column)),
        )
        for column in columns
    ]
