"""What acts between bodies, where nothing does."""

from __future__ import annotations

import numpy as np
import pytest

from solver import Body, Material, Model, System
from solver.mesh import grid
from solver.results.acting import acting_on, contact_patches

STEEL = Material(youngs_modulus=2e5, poisson_ratio=0.3)


def test_bodies_that_nothing_joins_have_no_contact_pressure_and_no_contact_width() -> None:
    side = np.linspace(0.0, 1.0, 3)
    bodies = tuple(
        Body(name=name, mesh=grid(side, side), material=STEEL, supports={"bottom": "xy"})
        for name in ("one", "other")
    )
    system = System(Model(bodies=bodies))
    acting = acting_on(system, symmetric=False)(system.initial())
    for values in acting.along(side):
        assert values.shape == side.shape
        assert np.isnan(values).all()
    assert np.isnan([acting.half_width, acting.peak, acting.force]).all()
    assert acting.centre == 0.0


S = np.arange(12.0)
"""Vertices along a surface."""


def opened(left: float, right: float) -> np.ndarray:
    """Gap beside a contact from ``left`` to ``right``, as beside one of Hertz."""
    return np.maximum(np.maximum(left - S, S - right), 0.0) ** 1.5


@pytest.mark.parametrize(("left", "right"), [(3.3, 7.4), (4.0, 7.0), (3.6, 7.9)])
def test_the_edges_of_a_contact_are_where_the_gap_closes(left: float, right: float) -> None:
    gap = opened(left, right)
    ((start, end),) = contact_patches(S, gap, gap == 0)
    assert (start, end) == pytest.approx((left, right))


def test_each_patch_has_its_own_edges() -> None:
    gap = np.minimum(opened(-5.0, 1.4), opened(9.7, 20.0))
    found = contact_patches(S, gap, gap == 0)
    assert np.ravel(found) == pytest.approx([0.0, 1.4, 9.7, 11.0])


@pytest.mark.parametrize("unknown", [np.nan, 0.0])
def test_without_a_gap_beside_it_a_contact_ends_at_its_last_vertex(unknown: float) -> None:
    closed = (S >= 3) & (S <= 7)
    assert contact_patches(S, np.where(closed, 0.0, unknown), closed) == [(3.0, 7.0)]


def test_an_edge_is_within_an_element_of_the_last_vertex() -> None:
    gap = opened(3.0, 7.0) + 4.0  # as if a part of the surface were missing
    closed = opened(3.0, 7.0) == 0
    ((start, end),) = contact_patches(S, gap, closed)
    assert (start, end) == (4.0, 6.0)


def test_nothing_closed_is_no_patch() -> None:
    assert contact_patches(S, opened(3.0, 7.0), np.zeros(12, dtype=bool)) == []
