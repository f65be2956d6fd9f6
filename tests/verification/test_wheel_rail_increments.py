"""The wheel of the thesis on its rail by increments leaves what its steady pass leaves.

In increments material stands still, and nothing is assumed to be steady: the wheel is set down,
rolled and taken off. Rail, stations, and far field are the same. A wheel that is held across moves
the rail, which is soft that way, aside for metres; so it has the lateral force of the pass.
`test_prism_increments.py` has increments of a small block in less time.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from solver.linear.solvers import one_thread
from solver.rolling.passing import Pass, passing
from solver.rolling.rail.flow import PrismState
from solver.rolling.rail.track import PrismTrack
from solver.rolling.scenes.rail_passes import contact_of
from solver.rolling.scenes.wheel_rail import WheelRailParameters
from solver.rolling.scenes.wheel_rail_setup import load_on
from solver.rolling.scenes.wheel_rail_track import geometry, track_of
from tests.verification.stepped_patch import SteppedPatch
from tests.verification.stepped_prism import SteppedIncrement, SteppedPrism

pytestmark = pytest.mark.long

STEPS = 37
ACCELERATING = WheelRailParameters(
    accuracy="draft", hardening="kinematic", hardening_ratio=0.0196, friction=0.3, traction=-0.75
)


def rail() -> PrismTrack:
    """The rail of the scene, 104 mm long: it is rolled over 74."""
    return track_of(geometry(ACCELERATING), 104.0)


@cache
def both() -> tuple[Pass[PrismState], SteppedIncrement]:
    """The pass, and the state after increments, on the same rail."""
    law = ACCELERATING.material()
    of, body = load_on(rail(), ACCELERATING), SteppedPrism(rail(), law)
    with one_thread():
        found = passing(rail(), law, of, rail().virgin(law))
        wheel = SteppedPatch(
            grid=rail().grid, compliance=rail().compliance, wheel=of.wheel, friction=of.friction,
            load=replace(of.load, lateral_force=float(contact_of(found).force[2])),
        )  # fmt: skip
        return found, body.rolled(body.virgin, wheel, STEPS)


def off(from_start: float) -> tuple[float, float]:
    """How far increments are from the pass: plastic strain, of the largest; stress [MPa]."""
    found, end = both()
    station = rail().before + STEPS - round(from_start / ACCELERATING.spacing)
    plastic, steady = end.state.plastic_strain[:, station], found.after.plastic_strain
    C = ACCELERATING.material().stiffness(6)
    elastic = end.state.strain[:, station] - plastic - (found.after.strain - steady)
    apart = np.linalg.norm(plastic - steady, axis=1).max()
    return float(apart / np.linalg.norm(steady, axis=1).max()), float(np.abs(elastic @ C).max())


def test_increments_leave_what_the_pass_leaves() -> None:
    """Plastic strain of 0.0019, residual stress of -102 MPa, in 0.3 % and 0.6 MPa."""
    plastic, stress = off(40.0)
    assert both()[0].after.accumulated.max() > 0.0018
    assert plastic < 0.005
    assert stress < 1.0


def test_rolling_is_steady_after_20_mm() -> None:
    """Where the wheel was set down it leaves a third less, and other stress by 55 MPa."""
    assert off(0.0)[0] > 0.3
    assert off(0.0)[1] > 40.0
    assert off(10.0)[0] > 0.02
    assert off(20.0)[0] < 0.015
    assert off(20.0)[1] < 2.0


def test_the_contact_becomes_that_of_the_pass() -> None:
    found, end = both()
    steady = contact_of(found)
    assert np.abs(end.contact.traction - steady.traction).max() < 3.0  # MPa, of 1 015
    assert end.contact.creepage == pytest.approx(steady.creepage, rel=0.005)
    assert end.contact.lateral_creepage == pytest.approx(0.0, abs=1e-5)
