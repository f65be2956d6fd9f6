"""The punches reach every extreme there is."""

from __future__ import annotations

import pytest

from tests.stability.families import NAMES
from tests.stability.kinds.punches import COUNT, extreme_scenes

PUNCHES = [name for name in NAMES if name.startswith("punch-")]


def test_the_punches_reach_every_extreme() -> None:
    p = extreme_scenes()
    assert len(p) == len(PUNCHES) == COUNT
    assert {q.state for q in p} == {"plane_stress", "plane_strain", "axisymmetric"}
    assert {q.hardening for q in p} == {"none", "isotropic", "kinematic", "mixed"}
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
