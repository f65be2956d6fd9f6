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
from solver.prism.stepped import SteppedPrism
from solver.prism.track import PrismTrack
from solver.steady.passing import passing
from tests.verification.prism_blocks import (
    AHEAD,
    HARDENS,
    PERFECT,
    block,
    ellipse,
    residual,
)

SPACING, ADVANCE, FROM_START = 2.0, 100.0, 60.0


@cache
def track() -> PrismTrack:
    """The coarse block, long enough to roll."""
    return block(SPACING, 128.0)


@pytest.mark.parametrize("law", [PERFECT, HARDENS], ids=["perfect", "hardens"])
def test_increments_leave_the_state_of_a_steady_pass(law: Law) -> None:
    body = SteppedPrism(track(), law)
    with one_thread():
        found = passing(track(), law, ellipse(track(), 1360.0), track().virgin(law), parts=1)
        traction = found.loading.contact.traction  # type: ignore[attr-defined]
        left = body.rolled(body.virgin, traction, round(ADVANCE / SPACING))
    station = round((AHEAD + ADVANCE - FROM_START) / SPACING)
    plastic, steady = left.plastic_strain[:, station], found.after.plastic_strain
    largest = np.linalg.norm(steady, axis=1).max()
    assert largest > 0.009
    assert np.linalg.norm(plastic - steady, axis=1).max() < 0.005 * largest
    stress = law.stiffness(6) @ (left.strain[:, station] - plastic).T
    off = stress - residual(law, found.after)
    assert np.sqrt(np.average((off**2).sum(axis=0), weights=track().modes.weights)) < 2.5  # MPa
    assert np.abs(off).max() < 3.5


def test_a_load_that_yields_nothing_leaves_nothing() -> None:
    """First yield under this ellipse is near 1.6 Re."""
    body, load = SteppedPrism(track(), PERFECT), ellipse(track(), 600.0)
    traction = load.on(track().at_rest).contact.traction
    left = body.rolled(body.virgin, traction, 3)
    assert not left.accumulated.any()
    assert not left.strain.any()


def test_a_load_cannot_roll_round_the_length_into_its_start() -> None:
    body, n = SteppedPrism(track(), PERFECT), track().grid.stations
    with pytest.raises(ModelError, match=f"in 0 to {track().modes.stations - n} stations"):
        body.rolled(body.virgin, np.zeros((n, len(track().grid.z), 3)), 60)


def test_a_far_field_is_refused() -> None:
    with pytest.raises(ModelError, match="levels"):
        SteppedPrism(block(SPACING, levels=1), PERFECT)


def test_a_zone_that_is_too_small_is_told() -> None:
    small = block(SPACING, zone_depth=4.0)
    body, load = SteppedPrism(small, HARDENS), ellipse(small, 1360.0)
    with pytest.raises(WindowTooSmall, match="rim"), one_thread():
        body.rolled(body.virgin, load.on(small.at_rest).contact.traction, 2)
