"""Loads over a prism by increments, in which material stands still: steady, and what is not.

`tests/verification/test_wheel_rail_increments.py` rolls the wheel of the thesis over its rail.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from solver.errors import ModelError, NotConverged, WindowTooSmall
from solver.linear.solvers import one_thread
from solver.rolling.load import RollingLoad
from solver.rolling.passing import passing
from solver.rolling.rail.patch_contact import PatchContact
from solver.rolling.rail.patch_grid import PatchGrid
from solver.rolling.rail.profiled_wheel import ProfiledWheel
from solver.rolling.rail.track import PrismTrack
from tests.verification import stepped_prism
from tests.verification.hertz_ellipse import wheel_on
from tests.verification.prism_blocks import AHEAD, HARDENS, PERFECT, A, B, block, crowned, residual
from tests.verification.stepped_patch import SteppedPatch
from tests.verification.stepped_prism import (
    Bare,
    LoadAt,
    SteppedEllipse,
    SteppedIncrement,
    SteppedPrism,
)

Array = NDArray[np.float64]
SPACING = 2.0


@cache
def track() -> PrismTrack:
    """The coarse block, long enough to roll."""
    return block(SPACING, 104.0)


def ellipse(**given: Any) -> SteppedEllipse:
    """The pressure of the wheel on the rail of the thesis."""
    force = 2 * np.pi * A * B * 1360.0 / 3
    return SteppedEllipse(grid=track().grid, a=A, b=B, **{"load": RollingLoad(force=force)} | given)


def wheel(**given: Any) -> SteppedPatch:
    """A crowned wheel with friction."""
    of = track().grid, track().compliance, crowned()
    return wheel_on(*of, kind=SteppedPatch, **{"friction": 0.3, "force": 150e3} | given)


def rolled(path: list[LoadAt]) -> list[SteppedIncrement]:
    """The increments of a path over the block that hardens."""
    body = SteppedPrism(track(), HARDENS)
    with one_thread():
        return list(body.along(body.virgin, path))


# -- what is steady --------------------------------------------------------------------------------


def test_increments_leave_the_state_of_a_steady_pass() -> None:
    """Of one length of 104 mm, rolled over 80; a pass is endless.

    44 mm from the start; the ends of what is rolled over change the stress by 3 MPa there.
    """
    advance, from_start = 80.0, 44.0
    body = SteppedPrism(track(), PERFECT)
    with one_thread():
        load = ellipse()
        found = passing(track(), PERFECT, load, track().virgin(PERFECT)).after
        end = body.rolled(body.virgin, ellipse(), round(advance / SPACING)).state
    station = round((AHEAD + advance - from_start) / SPACING)
    plastic = end.plastic_strain[:, station]
    largest = np.linalg.norm(found.plastic_strain, axis=1).max()
    assert largest > 0.01
    assert np.linalg.norm(plastic - found.plastic_strain, axis=1).max() < 0.012 * largest
    stress = PERFECT.stiffness(6) @ (end.strain[:, station] - plastic).T
    off = stress - residual(PERFECT, found)
    assert np.sqrt(np.average((off**2).sum(axis=0), weights=track().modes.weights)) < 4.0  # MPa


class Rested(NamedTuple):
    """The contact of an increment over a body that stays elastic."""

    contact: PatchContact
    displacement: Array


def by_increments(load: SteppedPatch, advance: int, count: int = 40) -> Array:
    """Tractions of a wheel on the elastic block after so many increments."""
    u = np.zeros((load.grid.stations, len(load.grid.z), 3))
    contact = load.following([Bare(u)], 0).solve(u)
    before = [Rested(contact, u)]
    for _ in range(count):
        contact = load.following(before, advance).solve(u, contact)
        before = [Rested(contact, u), before[0]]
    return contact.traction


GIVEN: dict[str, dict[str, float]] = {
    "creepage": {"creepage": 0.002, "lateral_creepage": 0.001, "spin": 1e-4},
    "forces": {"drive": -0.75, "lateral_force": 5e3},
}


@pytest.mark.parametrize("given", GIVEN)
def test_an_elastic_wheel_rolls_into_its_steady_contact(given: str) -> None:
    """Slip counts from the last increment; creepage leaves 10 MPa after 40 mm, 0.1 after 80."""
    own = {"friction": 0.3, "force": 150e3} | GIVEN[given]
    steady = wheel_on(track().grid, track().compliance, crowned(), **own)
    exact = steady.solve(np.zeros((track().grid.stations, len(track().grid.z), 3))).traction
    assert np.abs(exact[..., 2]).max() > 40.0
    assert by_increments(wheel(**GIVEN[given]), 1) == pytest.approx(exact, abs=0.5)  # MPa


def test_rolling_back_is_the_mirror_image_of_rolling() -> None:
    forth = by_increments(wheel(creepage=0.002), 1, 6)
    back = by_increments(wheel(creepage=0.002), -1, 6)
    assert back == pytest.approx(forth[::-1] * [-1.0, 1.0, 1.0], abs=1e-5)


# -- what is not -----------------------------------------------------------------------------------


def test_a_wheel_that_stands_changes_nothing() -> None:
    """It is braked, stands for two increments, then is taken off: what its moment holds is free."""
    load = wheel(drive=0.5)
    path = [LoadAt(load, behind) for behind in (4, 3, 2, 2, 2)]
    *_, rolls, first, second, off = rolled([*path, LoadAt(None, 2)])
    for stands in (first, second):
        assert stands.contact.creepage == pytest.approx(0.0, abs=1e-6)
        assert np.abs(stands.contact.traction - rolls.contact.traction).max() < 0.5  # MPa
        assert np.abs(stands.state.plastic_strain - rolls.state.plastic_strain).max() < 1e-6
    assert not off.contact.traction.any()
    assert np.abs(off.state.strain).max() < 0.5 * np.abs(rolls.state.strain).max()


def test_a_wheel_is_set_down_on_the_surface_as_it_is() -> None:
    """Shear of what rolled there before is no slip; nor does a wheel roll through the air."""
    path = [LoadAt(wheel(drive=0.7), behind) for behind in (3, 2, 1, 0)]
    *_, off, again = rolled([*path, LoadAt(None, 0), LoadAt(wheel(creepage=0.002), 2)])
    moved = off.displacement[..., 0]
    assert np.ptp(moved) > 0.01  # mm; two stations with this creepage are 0.008
    assert np.abs(again.contact.shear).max() < 10.0  # MPa; 4, of 360 with full slip
    assert abs(again.contact.force[0]) < 50.0  # N; 11
    with one_thread():
        (begun,) = SteppedPrism(track(), HARDENS).along(
            off.state, [LoadAt(wheel(creepage=0.002), 2)]
        )
    assert begun.contact.traction == pytest.approx(again.contact.traction, abs=1e-6)


def test_braking_a_wheel_that_stands_shears_what_lies_under_it() -> None:
    """No more than that: a locked wheel creeps by its shear alone, far less than a station."""
    path = [LoadAt(wheel(drive=drive), 0) for drive in (0.0, 0.7, -0.7)]
    down, braked, turned = rolled(path)
    assert down.contact.force[0] == pytest.approx(0.0, abs=50.0)
    assert braked.contact.force[0] == pytest.approx(0.7 * 0.3 * 150e3, rel=2e-3)
    assert turned.contact.force[0] == pytest.approx(-0.7 * 0.3 * 150e3, rel=2e-3)
    assert 0.0 < braked.contact.creepage < -turned.contact.creepage < 0.05
    added = turned.state.accumulated - braked.state.accumulated
    assert added.min() >= 0.0 and added.max() > 1e-4


def test_a_load_that_grows_on_the_way_leaves_more_and_more() -> None:
    whole = ellipse()
    loads = [whole.changed(load=whole.load.scaled(share)) for share in np.linspace(0.6, 1.0, 9)]
    last = rolled([LoadAt(load, 8 - k) for k, load in enumerate(loads)])[-1]
    # the last ones that it has passed are not yet rolled over; stations are numbered downstream
    passed = last.state.accumulated.max(axis=0)[track().before :][3:9]
    assert (np.diff(passed) < 0.0).all()
    assert passed[0] > 3 * passed[-1]


def test_a_load_that_moves_across_leaves_its_trace() -> None:
    centres = np.linspace(-1.7, 1.7, 9)
    path = [LoadAt(ellipse(centre=z), 8 - k) for k, z in enumerate(centres.tolist())]
    state = rolled(path)[-1].state
    yielded = (state.accumulated * track().modes.weights[:, None])[:, track().before :][:, :9]
    middle = track().points[0] @ yielded / yielded.sum(axis=0)
    assert (np.diff(middle) < 0.0).all()
    assert middle[[0, -1]] == pytest.approx([1.4, -1.4], abs=0.4)


def test_a_wheel_beside_its_place_is_that_wheel() -> None:
    moved, own = wheel(creepage=0.002).changed(wheel=crowned(1.0)), crowned(1.0)
    other = wheel_on(track().grid, track().compliance, own, kind=SteppedPatch, friction=0.3,
                     force=150e3, creepage=0.002)  # fmt: skip
    assert by_increments(moved, 1, 2) == pytest.approx(by_increments(other, 1, 2), abs=1e-9)
    softer = replace(own, elasticity=replace(own.elasticity, youngs_modulus=1e5))
    other = wheel_on(track().grid, track().compliance, softer, kind=SteppedPatch, friction=0.3,
                     force=150e3, creepage=0.002)  # fmt: skip
    flat = np.zeros((track().grid.stations, len(track().grid.z), 3))
    same = moved.changed(wheel=softer).solve(flat).traction
    assert same == pytest.approx(other.solve(flat).traction, abs=1e-9)


def test_another_load_of_the_same_wheel_does_not_compute_its_motion_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    flat = np.zeros((track().grid.stations, len(track().grid.z), 3))
    one = wheel(creepage=0.002)
    before = one.solve(flat).traction
    half = one.changed(load=one.load.scaled(0.5))

    def computed_again(self: ProfiledWheel, grid: PatchGrid) -> None:
        raise AssertionError

    monkeypatch.setattr(ProfiledWheel, "rolling", computed_again)
    assert half.solve(flat).traction[..., 1].sum() == pytest.approx(before[..., 1].sum() / 2)
    with pytest.raises(AssertionError):
        one.changed(wheel=crowned(1.0)).solve(flat)


def test_a_load_that_yields_nothing_leaves_nothing() -> None:
    """First yield under this ellipse is near 1.6 Re."""
    body = SteppedPrism(track(), PERFECT)
    left = body.rolled(body.virgin, ellipse(load=RollingLoad(force=65e3)), 3).state
    assert not left.accumulated.any()
    assert np.abs(left.strain).max() < 1e-12


def test_a_load_cannot_roll_round_the_length_into_its_start() -> None:
    body = SteppedPrism(track(), PERFECT)
    assert body.most_behind == track().modes.stations - track().grid.stations
    with pytest.raises(ModelError, match=f"in 0 to {body.most_behind} stations"):
        body.rolled(body.virgin, ellipse(), body.most_behind + 1)
    with pytest.raises(ModelError, match="behind = -1"):
        list(body.along(body.virgin, [LoadAt(ellipse(), -1)]))


def test_a_zone_that_is_too_small_is_told() -> None:
    small = block(SPACING, zone_depth=4.0)
    body = SteppedPrism(small, HARDENS)
    load = SteppedEllipse(grid=small.grid, load=RollingLoad(force=150e3), a=A, b=B)
    with pytest.raises(WindowTooSmall, match="rim"), one_thread():
        body.rolled(body.virgin, load, 2)


def test_an_increment_without_equilibrium_tells_where_the_load_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(stepped_prism, "_STEPS", 1)
    body = SteppedPrism(track(), PERFECT)
    with one_thread(), pytest.raises(NotConverged, match="with the load 3 stations"):
        next(body.along(body.virgin, [LoadAt(ellipse(), 3)]))
