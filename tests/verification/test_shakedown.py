"""Shakedown of a half-space under a rolling and sliding contact, against Melan's limits.

K.L. Johnson, Contact Mechanics (1985), section 9.2: without friction a line contact shakes down
elastically up to p0 = 4 k.
"""

from __future__ import annotations

from functools import cache
from math import pi, sqrt

import numpy as np
import pytest

from solver import SCENES, Status
from solver.results.shakedown import Limit, classify
from solver.results.shakedown import ShakedownState as State
from solver.results.sliding_limits import (
    johnson_limit,
    largest_shear,
    melan_limit,
    sliding_contact,
)
from solver.rolling.scenes.rolling import RollingParameters
from tests.records import kept

YIELD_STRAIN = 502.0 / 2e5
ENDS = {
    "track": 40.0, "element_size": 2.0, "growth": 2.0, "advance_step": 4.0, "press_steps": 2,
    "unload_steps": 1,
}  # fmt: skip
"""A track of given length, coarse."""


@cache
def rolled(pressure, passes, *, half_width=8.0, status=None, **fields):
    """The record of passes at p0 / k = ``pressure``, on an endless track by default."""
    p0, modulus = pressure * 502.0 / sqrt(3), 2e5 / (2 * (1 - 0.3**2))
    parameters = RollingParameters(
        **{
            "load": "hertz",
            "friction": 0.0,
            "load_ratio": p0 / 502.0,
            "radius": half_width * modulus / (2 * p0),
            "element_size": half_width / 8,
            "passes": passes,
        }
        | fields
    )
    assert parameters.half_width == pytest.approx(half_width)
    (record,) = SCENES["rolling"].path(parameters, [passes], lambda share: None)
    assert record.status is status if status else record.status.solved, record.message
    return kept(record)


def state(record):
    return State(record.scalars["shakedown_state"])


def of_passes(record, name):
    return record.fields[f"pass_{name}"][1]


# -- limits in closed form ---------------------------------------------------------------------


@pytest.mark.parametrize("friction", [0.0, 0.4])
@pytest.mark.parametrize("depth", [0.2, 0.8])
def test_stress_under_a_sliding_contact_is_flamants_summed_up(friction, depth):
    n = 20_000
    angle = (np.arange(n) + 0.5) * pi / n
    s, weight = np.cos(angle), np.sin(angle) ** 2 * pi / n  # p ds
    x = np.linspace(-2, 2, 9)
    away = x[:, None] - s
    radial = -2 / pi * weight * (depth + friction * away) / (away**2 + depth**2) ** 2
    flamant = ((radial * of).sum(axis=1) for of in (away**2, depth**2, away * depth))
    for exact, found in zip(flamant, sliding_contact(x, depth, friction), strict=True):
        assert found == pytest.approx(exact, abs=1e-6)


def test_frictionless_limit_is_four_and_its_depth_half_the_half_width():
    assert johnson_limit(0.0) == pytest.approx(4.0, rel=1e-4)
    assert melan_limit(0.0, 0.3) == pytest.approx(4.0, rel=1e-4)
    assert largest_shear(0.0)[1] == pytest.approx(0.5, abs=0.01)


def test_friction_lowers_the_limit_and_from_0_37_on_the_surface_governs():
    limits = [johnson_limit(mu) for mu in (0.0, 0.1, 0.2, 0.3, 0.36)]
    assert (np.diff(limits) < 0).all()
    assert limits[-1] < 1 / 0.36
    assert johnson_limit(0.37) == pytest.approx(1 / 0.37)
    # the stress out of plane lets the surface govern earlier under von Mises' criterion
    assert melan_limit(0.2, 0.3) == pytest.approx(johnson_limit(0.2), rel=1e-3)
    assert melan_limit(0.4, 0.3) < 0.95 * johnson_limit(0.4)


# -- the state from what cycles do -------------------------------------------------------------


@pytest.mark.parametrize(
    ("accumulated", "net", "expected"),
    [
        ([0, 0, 0, 0], [0, 0, 0, 0], State.ELASTIC),
        ([1e-3, 1e-5, 0, 0], [1e-3, 1e-5, 0, 0], State.ELASTIC_SHAKEDOWN),
        ([8e-4, 4e-4, 2e-4, 1e-4], [8e-4, 4e-4, 2e-4, 1e-4], State.ELASTIC_SHAKEDOWN),
        ([3e-3, 2e-3, 2e-3, 2e-3], [1e-3, 4e-4, 2e-4, 1e-4], State.PLASTIC_SHAKEDOWN),
        ([3e-3, 2e-3, 2e-3, 2e-3], [1e-3, 8e-4, 7e-4, 6.5e-4], State.RATCHETTING),
        ([3e-3, 2.5e-3, 2e-3, 1.5e-3], [1e-3, 8e-4, 6e-4, 4e-4], State.UNDECIDED),
        ([3e-3, 2e-3], [3e-3, 2e-3], State.UNDECIDED),
        # by how much each cycle opens is not known, but that it does
        ([0.148, 0.150, 0.153, 0.158], [0.140, 0.142, 0.144, 0.150], State.RATCHETTING),
        ([0.09, 0.10, 0.093, 0.095], [0.08, 0.087, 0.079, 0.082], State.RATCHETTING),
        (
            [3e-3, 3e-3, 3e-3, 3e-3],
            [1.3e-4, 1.27e-4, 1.24e-4, 1.21e-4],
            State.PLASTIC_SHAKEDOWN,
        ),
        # what it tends to depends on which of its values are asked
        ([9e-4, 6e-4, 3e-4, 2e-4], [9e-4, 6e-4, 3e-4, 2e-4], State.UNDECIDED),
    ],
)
def test_state_follows_from_where_the_cycles_tend_to(accumulated, net, expected):
    flow = np.array(accumulated, float)
    found = classify(one_depth(flow), one_depth(net), YIELD_STRAIN)
    assert found.state is expected


def one_depth(cycles):
    return np.array(cycles, float)[:, None]


@pytest.mark.parametrize(
    ("sequence", "low", "high"),
    [
        ([7.0, 3.0, 2.0, 2.0, 2.0, 2.0], 2.0, 2.0),
        ([2.4, 2.0, 2.0, 2.0], 2.0, 2.0),  # at rest, if not for half of its cycles
        ([9.0, 7.0, 6.0, 5.5], 0.0, 5.0),  # halves its distance to 5, but has fallen far
        ([7.0, 6.0, 5.5, 5.25], 5.0, 5.0),
        ([1.0, 2.0, 2.5, 2.75], 3.0, 3.0),
        ([9.0, 4.0, 3.0, 4.1, 3.5], 3.0, 4.1),
        ([1.0, 2.0, 3.0, 4.0], 3.0, np.inf),
        ([4.0, 3.0, 2.0, 1.0], 0.0, 2.0),
        ([2.0, 1.0], 0.0, np.inf),
        ([1.0], 0.0, np.inf),
    ],
)
def test_a_sequence_is_bounded_by_what_its_last_values_show(sequence, low, high):
    assert Limit.of(np.array(sequence)) == Limit(pytest.approx(low), pytest.approx(high))


def test_a_limit_is_a_number_where_its_bounds_are_close():
    assert Limit(1.9, 2.0).value == pytest.approx(1.95)
    assert np.isnan(Limit(1.0, 2.0).value)
    assert np.isnan(Limit(1.0, np.inf).value)
    assert Limit(0.0, 0.0).value == 0.0


def test_linear_hardening_cannot_go_on_ratchetting():
    cycles = (one_depth(v) for v in ([3e-3, 2e-3, 2e-3, 2e-3], [1e-3, 8e-4, 7.9e-4, 7.8e-4]))
    flow, left = cycles
    assert classify(flow, left, YIELD_STRAIN).state is State.RATCHETTING
    assert classify(flow, left, YIELD_STRAIN, hardens=True).state is State.UNDECIDED


def test_a_closed_cycle_does_not_hide_another_depth_that_ratchets():
    flow = np.tile([1e-2, 7e-4], (4, 1))
    left = np.tile([4.5e-4, 7e-4], (4, 1))
    assert classify(flow[:, :1], left[:, :1], YIELD_STRAIN).state is State.PLASTIC_SHAKEDOWN
    assert classify(flow, left, YIELD_STRAIN).state is State.RATCHETTING


@pytest.mark.parametrize("still", [0.0, 1e-6, -1e-4])
@pytest.mark.parametrize("left", [[1e-4, 2e-4, 3e-4, 4e-4], [3e-4] * 4, [1e-3] * 4])
def test_a_depth_where_nothing_flows_has_no_say(left, still):
    flow, left = one_depth([1e-2] * 4), one_depth(left)
    alone = classify(flow, left, YIELD_STRAIN)
    beside = classify(
        np.hstack([flow, np.full_like(flow, still)]),
        np.hstack([left, np.full_like(left, abs(still))]),
        YIELD_STRAIN,
    )
    assert beside.state is alone.state
    assert beside.net == pytest.approx(alone.net, nan_ok=True)


@pytest.mark.parametrize(
    "slow",
    [
        *(n**-power for power in (0.5, 1.0, 2.0) for n in (np.arange(1.0, 4), np.arange(1.0, 11))),
        1 / np.arange(1.0, 61),
        0.985 ** np.arange(12),
    ],
)
def test_a_decay_is_never_taken_for_ratchetting(slow):
    cycles = one_depth(1e-2 * slow)
    assert classify(cycles, cycles, YIELD_STRAIN).state is State.UNDECIDED


# -- computed ----------------------------------------------------------------------------------


def test_frictionless_limit_lies_between_3_7_and_4_3():
    below, above = rolled(3.7, 6), rolled(4.3, 10)
    assert state(below) is State.ELASTIC_SHAKEDOWN
    assert (of_passes(below, "plastic_increment")[2:] < 1e-5 * YIELD_STRAIN).all()
    assert state(above) is State.RATCHETTING
    assert (of_passes(above, "plastic_increment") > 0.2 * YIELD_STRAIN).all()
    advance = of_passes(above, "surface_advance")
    assert (advance[1:] < 0).all()  # against the way the load goes
    assert advance[-1] == pytest.approx(advance[-2], rel=0.1)


def test_hardening_ends_ratchetting():
    kinematic = rolled(4.3, 40, hardening="kinematic", until="decided")
    assert state(kinematic) is State.PLASTIC_SHAKEDOWN
    isotropic = rolled(4.3, 20, hardening="isotropic")
    assert state(isotropic) is State.ELASTIC_SHAKEDOWN
    assert of_passes(kinematic, "plastic_increment")[-1] > 0.2 * YIELD_STRAIN
    assert of_passes(isotropic, "plastic_increment")[-1] < 0.01 * YIELD_STRAIN


def test_friction_lowers_the_computed_limit():
    friction, below, above = 0.3, 2.65, 3.15
    assert below < johnson_limit(friction) < above < 3.7
    shaken, moving = (rolled(p, 6, friction=friction, traction=1.0) for p in (below, above))
    assert state(shaken) is State.ELASTIC_SHAKEDOWN
    assert state(moving) is State.RATCHETTING
    # the surface goes with the traction
    assert of_passes(moving, "surface_advance")[-1] > 0


def test_with_high_friction_the_surface_yields_first():
    record = rolled(2.0, 3, friction=0.5, traction=1.0)
    assert record.scalars["highest_plastic_strain"] > 0
    assert record.scalars["depth_of_highest_plastic_strain"] < 0.15 * 8.0


def test_true_contact_shakes_down_below_the_limit_and_ratchets_less_above():
    below, above = (rolled(p, 6, load="contact") for p in (3.7, 4.3))
    assert state(below) is State.ELASTIC_SHAKEDOWN
    assert state(above) is State.RATCHETTING
    prescribed = of_passes(rolled(4.3, 10), "surface_advance")
    advance = of_passes(above, "surface_advance")
    assert prescribed[-1] < advance[-1] < 0


def test_a_track_with_ends_decides_nothing_but_elastic():
    assert state(rolled(3.0, 1, **ENDS)) is State.ELASTIC
    assert state(rolled(3.7, 3, **ENDS)) is State.UNDECIDED


def test_prescribed_shear_above_the_strength_is_a_limit_load():
    load = {"friction": 0.3, "traction": 0.75} | ENDS
    record = rolled(4.693, 1, status=Status.LIMIT_LOAD, **load)
    assert "305.9" in record.message or "306" in record.message
    assert "289.8" in record.message
    assert record.scalars["travel"] == 0.0
    rolled(4.693, 1, hardening="kinematic", **load)  # hardening bears it
