"""The punches reach every extreme there is."""

from __future__ import annotations

from itertools import product

import pytest

from tests.stability.families import NAMES
from tests.stability.kinds.punches import HARDENING, SHORT, STATES, extreme_scenes

PUNCHES = [name for name in NAMES if name.startswith("punch-")]


def test_the_punches_reach_every_extreme() -> None:
    p = [q for number, q in enumerate(extreme_scenes(SHORT[-1] + 1)) if number in SHORT]
    assert len(p) == len(PUNCHES) == len(SHORT)
    assert {(q.state, q.hardening) for q in p} == set(product(STATES, HARDENING))
    assert {q.element for q in p} == {"quad8", "quad9", "quad4", "tri6", "tri3"}
    for name, low, high in (
        ("friction", 0.0, 1.0),
        ("hardening_ratio", 0.0, 0.5),
        ("poisson_ratio", 0.0, 0.499),
        ("punch_stiffness", 1e-3, 1e3),
    ):
        values = [getattr(q, name) for q in p]
        assert min(values) == pytest.approx(low)
        assert max(values) == pytest.approx(high)
    assert min(q.load_ratio for q in p) < 0.02
    assert max(q.load_ratio for q in p) > 2.0
    assert {q.elastic_punch for q in p} == {True, False}
    assert min(q.unload_steps for q in p) == 1
