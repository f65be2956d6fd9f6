"""Traffic over a rail: passes of different wheels, in turn and at random."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from solver import ModelError, Record
from solver.results.record import Status
from solver.results.shakedown import ShakedownState
from solver.rolling.scenes.rail_passes import RailPasses
from solver.rolling.scenes.sequence import CUT, deviations
from solver.rolling.scenes.wheel_rail import WheelRailParameters
from solver.rolling.scenes.wheel_rail_contact import expected_contact
from solver.rolling.scenes.wheel_rail_setup import load_on, prism, view
from solver.rolling.scenes.wheel_rail_track import geometry
from solver.shipped import SCENES
from tests.records import kept

SCENE = SCENES["wheel_rail"]
USUAL = {
    "accuracy": "draft", "hardening": "kinematic", "hardening_ratio": 0.0196, "friction": 0.3,
    "load": 110e3,
}  # fmt: skip
HEAVY, LIGHT = {"load": 140e3, "traction": 0.5}, {"load": 70e3, "traction": -0.3}
RANDOM = {"load_spread": 0.1, "lateral_spread": 1.0, "traction_spread": 0.1, "seed": 7}


@cache
def of_turns(*order: str) -> Record:
    """The record of so many passes of heavy and light wheels."""
    entries = {"heavy": HEAVY, "light": LIGHT}
    return rolled(passes=4, sequence=tuple(entries[name] for name in order))[0]


@cache
def scattered() -> tuple[Record, ...]:
    """The records of 2 and of 8 random passes."""
    return rolled(2, passes=8, **RANDOM)


def rolled(*also: int, **changes: Any) -> tuple[Record, ...]:
    """The records of a wheel on a rail, after ``also`` and after all passes."""
    parameters = SCENE.parameters(**USUAL | changes)
    found = tuple(SCENE.path(parameters, [*also, parameters.passes], lambda share: None))
    assert all(record.status is Status.OK for record in found), found[-1].message
    return tuple(map(kept, found))


def field(record: Record, name: str) -> np.ndarray:
    """A field of a record."""
    return record.fields[name][1]


# -- a sequence -----------------------------------------------------------------------------------


def test_a_sequence_of_one_wheel_is_that_many_plain_passes() -> None:
    (plain,), (turns,) = rolled(passes=2), rolled(passes=2, load=50e3, sequence=({"load": 110e3},))
    assert plain.fields.keys() == turns.fields.keys()
    for name, (_, values) in plain.fields.items():
        np.testing.assert_array_equal(values, field(turns, name), err_msg=name)
    for name in plain.scalars.keys() - {"cpu_seconds"}:
        np.testing.assert_array_equal(plain.scalars[name], turns.scalars[name], err_msg=name)


def test_passes_take_turns() -> None:
    record = of_turns("heavy", "light")
    np.testing.assert_array_equal(field(record, "pass_load"), [140e3, 70e3, 140e3, 70e3])
    np.testing.assert_array_equal(field(record, "pass_traction"), [0.5, -0.3, 0.5, -0.3])
    force = -0.3 * 0.3 * 70e3
    assert record.scalars["longitudinal_force"] == pytest.approx(force, rel=2e-3)
    creepage = field(record, "pass_creepage")
    assert creepage[1] < 0 < creepage[0]


def test_what_is_left_depends_on_the_order() -> None:
    heavy_first, light_first = of_turns("heavy", "light"), of_turns("light", "heavy")
    lowest = [field(each, "pass_residual_min")[0] for each in (heavy_first, light_first)]
    assert lowest[0][0] < lowest[1][0] - 20.0, "the heavy wheel leaves more stress"
    strain = [field(each, "pass_max_plastic_strain") for each in (heavy_first, light_first)]
    assert strain[0][1] == strain[0][0], "a light wheel adds nothing after a heavy one"
    assert strain[1][1] > strain[1][0]


def test_increments_are_those_of_the_whole_sequence() -> None:
    record = of_turns("heavy", "light")
    strain = field(record, "pass_max_plastic_strain")
    # one point has the largest strain, and gains most
    assert field(record, "pass_plastic_increment")[:2] == pytest.approx(strain[:2])
    # its third pass adds what the cycle of light and heavy adds
    assert field(record, "pass_plastic_increment")[2] >= strain[2] - strain[0]
    assert record.parameters.cycle == 2  # type: ignore[attr-defined]


def test_wheels_share_the_influences_of_the_rail() -> None:
    """They depend on the elasticity of the wheel alone, and the load is that of one made anew."""
    conical = {"wheel_profile": "conical", "lateral_position": 1.0, "wheel_radius": 500.0}
    both = WheelRailParameters(**USUAL, passes=2, sequence=({}, conical))
    track, passes = prism(both, 1.0), RailPasses(prism, load_on, both, view(both), 1.0)
    first, second = (passes.load(number) for number in (0, 1))
    assert second._influence is first._influence
    alone = load_on(track, WheelRailParameters(**USUAL, **conical))
    u = np.zeros((track.grid.stations, len(track.grid.z), 3))
    np.testing.assert_array_equal(second.solve(u).traction, alone.solve(u).traction)


def test_wheels_in_turn_may_push_with_different_lateral_forces() -> None:
    pushed = [{"lateral_control": "force", "given_lateral_force": force} for force in (0.0, 5e3)]
    both = WheelRailParameters(**USUAL, passes=2, sequence=tuple(pushed))
    track, passes = prism(both, 1.0), RailPasses(prism, load_on, both, view(both), 1.0)
    u = np.zeros((track.grid.stations, len(track.grid.z), 3))
    found = [passes.load(number).solve(u).force[2] for number in (0, 1)]
    np.testing.assert_allclose(found, [0.0, 5e3], atol=1.0)


@pytest.mark.parametrize(
    ("sequence", "told"),
    [
        (({}, {"load": -1.0}), r"sequence\[1\]\.load = -1\.0: must be greater than 0"),
        (({"cant": 0.1},), r"sequence\[0\]\.cant = 0\.1: must be one of load, lateral_position"),
        (
            ({"wheel_profile": "flat"},),
            r"sequence\[0\]\.wheel_profile = 'flat': must be one of",
        ),
        (({}, {}, {"load": "much"}), r"sequence\[2\]\.load = 'much': must be a number"),
        (({"traction": 0.5, "friction": 0.0},), r"sequence\[0\]\.traction = 0\.5: must be 0"),
        (({"times": 0},), r"sequence\[0\]\.times = 0: must be an integer"),
        (({},) * 1001, r"sequence\[1000\]\.times = 1: must make at most 1000 passes in all"),
        (({"times": 600}, {"times": 500}), r"sequence\[1\]\.times = 500: must make at most"),
        ((5.0,), r"sequence\[0\] = 5\.0: must be a dict"),
        ("heavy", r"sequence = 'heavy': must be a tuple of a dict"),
    ],
)
def test_wrong_entries_are_refused_by_name(sequence: Any, told: str) -> None:
    with pytest.raises(ModelError, match=told):
        WheelRailParameters(sequence=sequence)


# -- the zone -------------------------------------------------------------------------------------


def test_of_the_loads_at_a_place_the_heaviest_decides() -> None:
    """A thousand wheels at two places cost as much as two."""
    entries = [{"load": 5e4 + 1e3 * (k % 50), "lateral_position": -6.0 + k % 2} for k in range(60)]
    many = WheelRailParameters(accuracy="draft", sequence=tuple(entries))
    assert len(many.outermost) == 2
    whole = expected_contact(many)
    for entry in entries[::7]:
        own = expected_contact(WheelRailParameters(accuracy="draft", **entry))  # type: ignore[arg-type]
        assert whole.ends[0] <= own.ends[0] and own.ends[1] <= whole.ends[1]
        assert whole.near[0] <= own.near[0] and own.near[1] <= whole.near[1]
        assert own.along <= whole.along and own.widest <= whole.widest and whole.gap <= own.gap


def test_the_zone_holds_the_contacts_of_all_passes() -> None:
    positions = (-6.0, -1.0)
    wheels = [WheelRailParameters(lateral_position=each) for each in positions]
    both = WheelRailParameters(sequence=tuple({"lateral_position": each} for each in positions))
    own, zone = [expected_contact(each) for each in wheels], geometry(both)
    for contact in own:
        assert zone.at - zone.half_width < contact.middle - contact.across
        assert zone.at + zone.half_width > contact.middle + contact.across
        assert zone.reach > contact.along
    assert zone.half_width > max(geometry(each).half_width for each in wheels)


def test_random_passes_of_every_seed_and_number_share_a_zone() -> None:
    one, other = (
        geometry(WheelRailParameters(**RANDOM | {"seed": seed}, passes=passes))
        for seed, passes in ((1, 1), (2, 1000))
    )
    assert one == other
    widest = WheelRailParameters(load=150e3 * (1 + CUT * RANDOM["load_spread"]))
    assert one.half_width > geometry(widest).half_width


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"lateral_position": 8.0}, r"^lateral_position = 8\.0: must leave the flange"),
        ({"sequence": ({}, {"lateral_position": 8.0})},
         r"^sequence\[1\]\.lateral_position = 8\.0: must leave the flange"),
        ({"sequence": ({},), "lateral_position": 8.0}, r"^lateral_position = 8\.0: must leave"),
        ({"lateral_spread": 4.0},
         r"^lateral_spread = 4\.0: takes passes to lateral_position = 4\.0: must leave the"),
    ],
)  # fmt: skip
def test_a_pass_that_does_not_fit_is_refused_with_what_gives_its_position(
    given: dict[str, Any], told: str
) -> None:
    with pytest.raises(ModelError, match=told):
        geometry(WheelRailParameters(**given))


# -- random traffic -------------------------------------------------------------------------------


def test_deviations_are_those_of_a_cut_normal_distribution() -> None:
    drawn = deviations(0, 20_000, 3)
    assert np.abs(drawn).max() <= CUT
    # standard errors are 0.007; cut at 3 the deviation is 0.9866
    np.testing.assert_allclose(drawn.mean(axis=0), 0.0, atol=0.03)
    np.testing.assert_allclose(drawn.std(axis=0), 0.9866, atol=0.02)
    assert np.abs(np.corrcoef(drawn.T) - np.eye(3)).max() < 0.03


def test_a_pass_is_drawn_alike_whatever_follows() -> None:
    def drawn(passes: int, seed: int) -> list[tuple[float, float, float]]:
        each = WheelRailParameters(**RANDOM | {"seed": seed, "passes": passes}).each_pass()
        return [(own.load, own.lateral_position, own.traction) for own in each]

    assert drawn(30, 7)[:3] == drawn(3, 7)
    assert drawn(3, 8) != drawn(3, 7)


def test_a_sequence_scatters_about_its_entries() -> None:
    each = WheelRailParameters(
        **RANDOM, passes=200, sequence=({"load": 50e3}, {"load": 100e3})
    ).each_pass()
    loads = np.array([own.load for own in each]).reshape(-1, 2)
    np.testing.assert_allclose(loads.mean(axis=0), [50e3, 100e3], rtol=0.03)
    np.testing.assert_allclose(loads.std(axis=0), [5e3, 10e3], rtol=0.2)


def test_random_passes_are_told_and_carried() -> None:
    some, record = scattered()
    each = record.parameters.each_pass()  # type: ignore[attr-defined]
    np.testing.assert_array_equal(field(record, "pass_load"), [own.load for own in each])
    for name in ("pass_load", "pass_lateral_position", "pass_traction", "pass_creepage"):
        np.testing.assert_array_equal(field(some, name), field(record, name)[:2], err_msg=name)
    assert np.ptp(field(record, "pass_lateral_position")) > 1.0
    last = each[-1]
    expected = last.load * last.friction * last.traction
    assert record.scalars["longitudinal_force"] == pytest.approx(expected, abs=1e-3 * last.load)
    dims, pressure = record.fields["patch_pressure"]
    step = [np.diff(record.coordinates[name])[0] for name in dims]
    assert pressure.sum() * np.prod(step) == pytest.approx(last.load, rel=0.03)


def test_random_passes_decide_no_state_but_tell_a_mean() -> None:
    _, record = scattered()
    assert record.scalars["shakedown_state"] == ShakedownState.UNDECIDED
    assert np.isnan(record.scalars["steady_plastic_increment"])
    added = np.diff(field(record, "pass_max_plastic_strain"), prepend=0.0)
    mean = record.scalars["mean_plastic_increment"]
    assert added[4:].sum() / 4 <= mean <= field(record, "pass_plastic_increment")[4:].sum() / 4


def test_a_pass_where_nothing_yields_takes_one_solve() -> None:
    (record,) = rolled(passes=3, yield_stress=3000.0, hardening="none", **RANDOM)
    assert record.scalars["shakedown_state"] == ShakedownState.ELASTIC
    assert record.scalars["iterations"] == 3  # a pass counts as one at least
    assert record.scalars["mean_plastic_increment"] == 0.0


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"load_spread": 0.5}, r"load_spread = 0\.5: must be at least 0 and at most 0\.33"),
        ({"load": 9e5, "load_spread": 0.1}, r"load_spread = 0\.1: makes load = 1\.17e\+06 at 3"),
        ({"traction": 0.9, "traction_spread": 0.1}, r"traction_spread = 0\.1: makes traction"),
        ({"friction": 0.0, "traction_spread": 0.1}, r"traction_spread .* must be 0 without frict"),
        ({"seed": -1}, r"seed = -1: must be at least 0"),
    ],
)
def test_spreads_beyond_limits_are_refused(given: dict[str, Any], told: str) -> None:
    with pytest.raises(ModelError, match=told):
        WheelRailParameters(**given)
