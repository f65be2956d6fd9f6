"""Stress under the load outside the zone that may yield."""

from __future__ import annotations

import numpy as np
import pytest

from solver.linear.solvers import one_thread
from solver.mesh import grid, within
from solver.rolling.audit import plain_rail as plain_prism
from solver.rolling.audit.plain_rail import PlainPrism
from solver.rolling.audit.rail import audit_prism
from solver.rolling.passing import passing
from solver.rolling.rail.section import Section
from solver.rolling.rail.track import PrismTrack
from tests.verification.prism_blocks import HARDENS, PERFECT, block, ellipse

PEAK = 1360.0


@pytest.mark.parametrize(("left_out", "error"), [(0.0, 1e-6), (plain_prism._LEFT_OUT, 0.01)])
def test_strain_outside_a_zone_is_that_of_a_deeper_zone(
    left_out: float, error: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With eigenstress and tractions; small waves may be left out."""
    monkeypatch.setattr(plain_prism, "_LEFT_OUT", left_out)
    small, large = (block(levels=2, zone_depth=depth) for depth in (6.0, 14.0))
    points, window = small.modes.points, small.weights.shape[1]
    at = np.searchsorted(large.modes.points, points)
    near = np.exp(-((np.arange(window) - small.before) ** 2) / 8.0)
    left = np.random.default_rng(1).normal(size=(len(points), 1, 6)) * near[:, None] * 200.0
    eigenstress = np.zeros((len(large.modes.points), window, 6))
    eigenstress[at] = left
    traction = ellipse(large, PEAK).on(large.at_rest, large.virgin(PERFECT)).contact.traction
    one, other = PlainPrism(small), PlainPrism(large)
    whole = other.strain(other.waves(eigenstress, traction))[:, large.before]
    found = one.beside(one.waves(left, traction))
    outside = np.setdiff1d(np.arange(small.section.weights.size), points)
    both, here, there = np.intersect1d(outside, large.modes.points, return_indices=True)
    assert len(both) > 100
    largest = np.abs(whole).max()
    np.testing.assert_allclose(found[here], whole[there], rtol=0.0, atol=error * largest)


def test_yield_under_the_load_below_the_zone_is_told() -> None:
    """Rows of the zone are elastic, so that no other check can see it."""
    track = block(levels=0, zone_depth=2.0)
    with one_thread():
        found = passing(track, HARDENS, ellipse(track, 900.0), track.virgin(HARDENS))
    assert not found.most_added
    audit = audit_prism(track, HARDENS, found, None)
    assert audit.figures["audit_yield"] == pytest.approx(0.62 * 900.0 / 502.0 - 1.0, abs=0.05)
    assert any("yield" in each for each in audit.violations)
    deep = block(levels=0)
    with one_thread():
        found = passing(deep, PERFECT, ellipse(deep, 750.0), deep.virgin(PERFECT))
    assert audit_prism(deep, PERFECT, found, None).passed


def test_a_section_that_may_yield_everywhere_has_nothing_outside() -> None:
    mesh = within(grid(np.linspace(-12, 12, 13), np.linspace(-6, 0, 4)), "running", ["top"])
    section = Section(mesh, HARDENS.elasticity, supports={"bottom": "xyz"})
    track = PrismTrack(section, np.ones(36, dtype=bool), "running", length=64.0, spacing=2.0,
                       ahead=20.0, behind=24.0, reach=10.0, levels=0)  # fmt: skip
    found = passing(track, HARDENS, ellipse(track, 300.0), track.virgin(HARDENS))
    assert audit_prism(track, HARDENS, found, None).figures["audit_yield"] < 1e-6
