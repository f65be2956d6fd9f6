"""A load that rolls over a prism by increments leaves what a steady pass leaves.

In increments material stands still, and nothing is assumed to be steady. Both take one increment
from station to station. A pass is endless. The load rolls over 100 mm of a length of 128 mm; 60 mm
from its start the ends of that still change stress by 2 MPa.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from solver.errors import ModelError, WindowTooSmall
from solver.linear.threads import one_thread
from solver.materials.law import Law
from solver.prism.given_patch import EllipticPatch
from solver.prism.patch import RollingPatch
from solver.prism.patch_passing import PatchPassing
from solver.prism.stepped import SteppedLoad, SteppedPrism
from solver.prism.stepped_patch import SteppedPatch
from solver.prism.track import PrismTrack
from solver.steady.passing import passing
from tests.verification.prism_blocks import AHEAD, HARDENS, PERFECT, A, B, block, crowned, residual

SPACING, ADVANCE, FROM_START = 2.0, 100.0, 60.0


@cache
def track() -> PrismTrack:
    """The coarse block, long enough to roll."""
    return block(SPACING, 128.0)


def compare(law: Law, passes: PatchPassing, steps: SteppedLoad) -> None:
    """Assert that increments leave the state of the steady pass, and have its tractions."""
    body = SteppedPrism(track(), law)
    with one_thread():
        found = passing(track(), law, passes, track().virgin(law), parts=1)
        end = body.rolled(body.virgin, steps, round(ADVANCE / SPACING))
    station = round((AHEAD + ADVANCE - FROM_START) / SPACING)
    plastic, steady = end.state.plastic_strain[:, station], found.after.plastic_strain
    largest = np.linalg.norm(steady, axis=1).max()
    assert largest > 0.005
    assert np.linalg.norm(plastic - steady, axis=1).max() < 0.005 * largest
    stress = law.stiffness(6) @ (end.state.strain[:, station] - plastic).T
    off = stress - residual(law, found.after)
    assert np.sqrt(np.average((off**2).sum(axis=0), weights=track().modes.weights)) < 2.5  # MPa
    assert np.abs(off).max() < 3.5
    traction = found.loading.contact.traction  # type: ignore[attr-defined]
    assert np.abs(end.contact.traction - traction).max() < 5.0  # MPa, of 1 200 or more


def test_increments_leave_the_state_of_a_steady_pass() -> None:
    load = EllipticPatch(grid=track().grid, force=2 * np.pi * A * B * 1300.0 / 3, a=A, b=B)
    compare(PERFECT, PatchPassing(load), load)


def test_so_do_increments_of_a_wheel_with_friction(monkeypatch: pytest.MonkeyPatch) -> None:
    """Slip counts from the last increment; creepage of 0.2 % takes 58 % of the friction.

    That is a difference of two stations, of first order, here for the steady pass too.
    """
    monkeypatch.setattr("solver.prism.patch._UPSTREAM", (1.0, -1.0))
    of, wheel = (track().grid, track().compliance), crowned()
    given = {"friction": 0.3, "force": 150e3, "creepage": 0.002}
    steady, stepped = RollingPatch(*of, wheel, **given), SteppedPatch(*of, wheel, **given)
    compare(HARDENS, PatchPassing(steady), stepped)


def test_a_load_that_yields_nothing_leaves_nothing() -> None:
    """First yield under this ellipse is near 1.6 Re."""
    load = EllipticPatch(grid=track().grid, force=65e3, a=A, b=B)
    body = SteppedPrism(track(), PERFECT)
    left = body.rolled(body.virgin, load, 3).state
    assert not left.accumulated.any()
    assert np.abs(left.strain).max() < 1e-12


def test_a_load_cannot_roll_round_the_length_into_its_start() -> None:
    body, n = SteppedPrism(track(), PERFECT), track().grid.stations
    with pytest.raises(ModelError, match=f"in 0 to {track().modes.stations - n} stations"):
        body.rolled(body.virgin, EllipticPatch(grid=track().grid, force=1.0, a=A, b=B), 60)


def test_a_far_field_is_refused() -> None:
    with pytest.raises(ModelError, match="levels"):
        SteppedPrism(block(SPACING, levels=1), PERFECT)


def test_a_zone_that_is_too_small_is_told() -> None:
    small = block(SPACING, zone_depth=4.0)
    body = SteppedPrism(small, HARDENS)
    load = EllipticPatch(grid=small.grid, force=150e3, a=A, b=B)
    with pytest.raises(WindowTooSmall, match="rim"), one_thread():
        body.rolled(body.virgin, load, 2)
