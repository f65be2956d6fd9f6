"""Rolling on a track without ends: the records of steady passes, their symmetries, their audit."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from solver import SCENES, ModelError, Status
from solver.errors import NotConverged, TooLong, WindowTooSmall
from solver.rolling import search
from solver.rolling.audit.plane import audit_pass
from solver.rolling.passing import SolveBudget
from solver.rolling.plane.rolling import rolling
from solver.rolling.scenes import pass_runner, rolling_endless
from solver.rolling.scenes.rolling import RollingParameters
from solver.rolling.scenes.rolling_endless import load_on, track_for
from tests.records import kept

COARSE = {"element_size": 3.0, "growth": 1.3}
USUAL = {"element_size": 2.0}
CASES = {
    "free": {},
    "driven": {"traction": -0.5, "hardening": "isotropic"},
    "locked": {"traction": 1.0, "friction": 0.1},
    "creeping": {"control": "creepage", "given_creepage": 0.002, "hardening": "kinematic"},
    "limited": {"traction": 1.0, "friction": 0.5, "shear_limit": 0.5},
    "frictionless": {"friction": 0.0},
    "hertz": {"load": "hertz", "traction": 0.4},
}


@cache
def records(passes=(1,), **fields):
    """The records after so many passes."""
    parameters = RollingParameters(**COARSE | fields | {"passes": max(passes)})
    return tuple(map(kept, SCENES["rolling"].path(parameters, passes, lambda share: None)))


def roll(**fields):
    """The record of one run."""
    of = records.__wrapped__ if "sequence" in fields else records  # tables cannot be cached
    (record,) = of((fields.pop("passes", 1),), **fields)
    assert record.status.solved, record.message
    return record


def one_pass(**fields):
    """The parameters, the track and the first pass of a run."""
    parameters = RollingParameters(**COARSE | fields)
    track = track_for(parameters)
    (found,) = rolling(track, parameters.material(), load_on(track, parameters, parameters), [1])
    return parameters, track, found


def with_states(found, strain=1.0, gathered=0.0):
    """A pass with plastic strain times a factor, and more of it accumulated."""
    states = found.states
    other = replace(
        states,
        plastic_strain=strain * states.plastic_strain,
        accumulated=states.accumulated + gathered,
    )
    return replace(found, states=other)


@pytest.mark.parametrize("case", CASES)
def test_a_pass_has_the_results_of_a_run(case):
    record = roll(**CASES[case])
    assert record.scalars["increments"] == 1
    assert record.scalars["max_plastic_strain"] > 1e-3
    assert -700 < record.scalars["lowest_residual_x"] < -100
    assert list(record.coordinates["station"]) == [0.0]
    for name, (dims, values) in record.fields.items():
        assert len(values.shape) == len(dims), name
        gap = name in ("contact_gap", "pass_creepage")
        place = "residual_m" in name and name[-2:] in ("_x", "_y", "_s")  # of no stress: none
        assert gap or np.isfinite(values[..., :1] if place else values).all(), name


def test_a_run_has_the_variables_of_one_on_a_track_with_ends():
    length = RollingParameters(
        element_size=4.0, advance_step=4.0, track=16.0, growth=1.5, traction=0.1
    )
    (other,) = SCENES["rolling"].path(length, [1], lambda share: None)
    here = roll(traction=0.1)
    assert here.fields.keys() == other.fields.keys()
    for name, (dims, _) in here.fields.items():
        assert dims == other.fields[name][0], name
    lacks = other.scalars.keys() - here.scalars.keys()
    assert {n for n in lacks if not n.startswith("audit_")} == {
        "travel",
        "advance",
        "advance_error",
    }
    own = here.scalars.keys() - other.scalars.keys()
    assert own == {"audit_inflow", "audit_outflow", "audit_steadiness"}


def test_a_load_that_goes_back_leaves_the_mirror_image():
    there, back = (roll(traction=0.5, heading=heading) for heading in ("forward", "backward"))
    ends, mirrored = (np.unique(record.fields["outline_x"][1]) for record in (there, back))
    np.testing.assert_allclose(ends, -mirrored[::-1])
    for name in there.fields.keys() - {"outline_x"}:
        dims, values = there.fields[name]
        seen = back.fields[name][1].copy()
        for along in {"x", "s"} & set(dims):
            seen = np.flip(seen, dims.index(along))
        if "component" in dims:
            np.moveaxis(seen, dims.index("component"), 0)[3] *= -1
        if name in ("contact_shear", "pass_net_shear", "pass_surface_advance"):
            seen = -seen
        # of shear, what is largest on one side is smallest on the other
        each = slice(None, 3 if "residual_m" in name else None)
        np.testing.assert_allclose(
            values[..., each], seen[..., each], rtol=1e-9, atol=1e-9, err_msg=name
        )
    for name in ("surface_residual_x", "first_row_residual_z", "creepage", "axle_height"):
        assert there.scalars[name] == pytest.approx(back.scalars[name], rel=1e-9), name
    assert there.scalars["longitudinal_force"] == -back.scalars["longitudinal_force"] > 100


def test_the_surface_advances_by_the_plastic_shear_below_it():
    """Behind the load there is no shear stress: engineering shear is the slope of displacement."""
    record = roll(traction=0.5, heading="forward")
    shear = 2 * record.fields["plastic_flow_profile"][1][0, 0, 3]
    advance = record.fields["pass_surface_advance"][1][0]
    assert advance == pytest.approx(np.trapezoid(shear, record.coordinates["depth"]), rel=0.01)
    assert record.fields["pass_net_shear"][1][0] == pytest.approx(shear.max(), rel=1e-9)


def test_the_state_is_uniform_along_the_track_and_that_of_the_profile():
    record = roll()
    residual = record.fields["residual_stress"][1]
    assert np.ptp(residual, axis=2).max() < 1e-9
    depth, y = record.coordinates["depth"], record.coordinates["y"]
    profile = record.fields["residual_profile"][1][-1, 0]
    for component in (0, 2):
        on_map = np.interp(depth[:100], -y, residual[component, :, 0])
        assert abs(on_map[2:] - profile[component, 2:100]).max() < 12.0  # between grid points
    assert abs(profile[[1, 3]]).max() < 1e-9


def test_under_load_the_map_shows_the_load():
    record = roll(load="hertz", friction=0.0, load_ratio=1.0, element_size=0.5)
    p0, a = 502.0, record.parameters.half_width
    loaded = list(record.coordinates["stage"]).index("loaded")
    mises = record.fields["map_mises"][1][loaded]
    at = np.unravel_index(mises.argmax(), mises.shape)
    assert mises.max() == pytest.approx(0.558 * p0, rel=0.03)  # von Mises 0.558 p0 at 0.704 a
    assert -record.coordinates["y"][at[0]] == pytest.approx(0.704 * a, abs=0.12 * a)
    assert abs(record.coordinates["x"][at[1]]) < 0.15 * a
    s = record.coordinates["s"]
    hertz = p0 * np.sqrt(np.maximum(1 - (s / a) ** 2, 0.0))
    np.testing.assert_allclose(record.fields["contact_pressure"][1][loaded], hertz, atol=1e-9)
    assert not record.fields["contact_pressure"][1][1 - loaded].any()


def test_runs_of_one_path_are_those_computed_alone():
    together = records((1, 2), direction="back_and_forth")
    assert [len(r.coordinates["pass"]) for r in together] == [1, 2]
    for record, passes in zip(together, (1, 2), strict=True):
        alone = roll(passes=passes, direction="back_and_forth")
        for name, (_, values) in record.fields.items():
            np.testing.assert_array_equal(values, alone.fields[name][1], err_msg=name)


def test_passes_end_when_the_state_is_decided():
    fields = {"load": "hertz", "hardening": "kinematic", "until": "decided"}
    record = roll(passes=50, **fields)
    assert record.scalars["shakedown_state"] == 2
    assert 3 <= len(record.coordinates["pass"]) < 20
    assert len(roll(passes=2, **fields).coordinates["pass"]) == 2, "not decided by then"


def test_all_runs_with_one_mesh_share_it():
    one, other = (RollingParameters(**COARSE, hardening=h) for h in ("none", "kinematic"))
    assert track_for(one) is track_for(other)
    assert track_for(replace(one, element_size=2.5)) is not track_for(one)


@pytest.mark.parametrize(
    ("broken", "figure"),
    [
        (lambda p: with_states(p, strain=1.01), "audit_residual"),
        (lambda p: replace(p, strain=p.strain * 1.01), "audit_law"),
        (lambda p: replace(p, strain=p.strain * 1.05), "audit_yield"),
        (lambda p: replace(p, loading=replace(p.loading, u=p.loading.u * 1.01)), "audit_residual"),
        (
            lambda p: replace(p, loading=replace(p.loading, force=p.loading.force * 0.9)),
            "audit_residual",
        ),
        (lambda p: with_states(p, gathered=1e-2), "audit_inflow"),
        (lambda p: with_states(p, gathered=1e-6), "audit_law"),
        (lambda p: replace(p, left_over=1e-4), "audit_steadiness"),
        (
            lambda p: replace(p, loading=replace(p.loading, normal=p.loading.normal - 1.0)),
            "audit_tension",
        ),
        (
            lambda p: replace(p, loading=replace(p.loading, tangential=p.loading.normal)),
            "audit_friction_excess",
        ),
    ],
)
def test_the_audit_finds_what_is_wrong(broken, figure):
    parameters, track, found = one_pass(traction=0.3)
    material = parameters.material()
    assert audit_pass(track, material, found, None, 1).violations == ()
    violations = audit_pass(track, material, broken(found), None, 1).violations
    assert any(text.startswith(figure) for text in violations), violations


def test_a_pass_whose_surface_strains_by_more_than_a_tenth_is_outside_theory():
    """The surface has a row of its own, which may strain more than all points below it."""
    parameters, track, found = one_pass(traction=0.3)
    within = audit_pass(track, parameters.material(), found, None, 1)
    assert within.outside == ()
    largest = found.after.whole.accumulated.max()
    assert within.figures["audit_plastic_strain"] == pytest.approx(largest, rel=1e-12)
    top = found.after.top

    def sheared(**state):
        surface = replace(top, state=replace(top.state, **state))
        beyond = replace(found, after=replace(found.after, surface=surface))
        return audit_pass(track, parameters.material(), beyond, None, 1)

    strain = 0.14 * np.array([[0.0], [0.0], [0.0], [np.sqrt(1.5)]])
    (message,) = sheared(plastic_strain=strain).outside
    assert message.startswith("equivalent plastic strain reaches 14% in half_space at (0, 0): ")
    assert sheared(accumulated=np.array([0.14])).outside == (), "of many passes, to and fro"


@pytest.mark.parametrize(
    ("fields", "name"),
    [
        ({"advance_tolerance": 0.01}, "advance_tolerance"),
        ({"track": 50.0, "until": "decided"}, "until"),
        ({"track": "long"}, "track"),
        ({"track": 0.0}, "track"),
        ({"element_size": 0.01}, "element_size"),
        ({"radius": 335.5, "element_size": 4.151}, "element_size"),
        ({"yield_stress": 3e4, "element_size": 10.0}, "load_ratio"),
    ],
)
def test_bad_input_is_named(fields, name):
    with pytest.raises(ModelError, match=f"^{name} = "):
        RollingParameters(**fields)


def test_what_no_track_bears_is_a_limit():
    (record,) = records((1,), load="hertz", traction=1.0, friction=0.6)
    assert record.status is Status.LIMIT_LOAD
    assert "load_ratio" in record.message


# -- sequences of different loads ----------------------------------------------------------------


def test_a_shear_that_hardening_carries_only_far_beyond_small_strains_is_not_searched(monkeypatch):
    """Else the search, and passes by increments after it, take minutes and find none."""
    monkeypatch.setattr(rolling_endless, "by_increments", None)
    shear = {"load": "hertz", "friction": 0.5, "traction": -0.9, "load_ratio": 2.5}
    hardens = {"hardening": "kinematic", "hardening_ratio": 1e-5}
    (record,) = records(**shear, **hardens)
    assert record.status is Status.NOT_CONVERGED
    usual = RollingParameters(**COARSE, **shear, **hardens)
    modulus = usual.youngs_modulus * 1e-5 / (1 - 1e-5)
    carried = (usual.yield_stress + modulus) / 3**0.5
    assert f"above {carried:.4g} MPa, which the surface carries at a plastic strain of 100%" in (
        record.message
    )


def test_a_sequence_of_equal_passes_is_that_many_passes():
    plain, sequence = roll(passes=3), roll(passes=3, sequence=({"times": 3},))
    for name, (_, values) in plain.fields.items():
        if not name.startswith("pass_"):
            np.testing.assert_array_equal(values, sequence.fields[name][1], err_msg=name)


def test_what_a_sequence_leaves_depends_on_its_order():
    light, heavy = {"load_ratio": 2.2, "traction": 0.3}, {"load_ratio": 3.0, "times": 2}
    one, other = (roll(**USUAL, passes=3, sequence=s) for s in ((light, heavy), (heavy, light)))
    assert [len(r.coordinates["pass"]) for r in (one, other)] == [3, 3]
    assert one.scalars["longitudinal_force"] == pytest.approx(0.0, abs=5.0)
    alone = RollingParameters(**USUAL, load_ratio=2.2)
    expected = 0.3 * 0.3 * alone.force
    assert other.scalars["longitudinal_force"] == pytest.approx(expected, rel=0.05)
    assert other.scalars["contact_half_width"] < 0.9 * one.scalars["contact_half_width"]
    profiles = [r.fields["residual_profile"][1][-1, 0, 0] for r in (one, other)]
    assert abs(profiles[0] - profiles[1]).max() > 20.0
    creepage = other.fields["pass_creepage"][1]
    assert creepage[2] > creepage[1] + 5e-4, "the last pass brakes"


def test_the_state_is_that_of_the_whole_sequence():
    """Back and forth in one block is a cycle of two passes, as it is without a sequence."""
    ways = ({"heading": "forward"}, {"heading": "backward"})
    plain = roll(passes=6, direction="back_and_forth")
    block = roll(passes=6, sequence=ways)
    for name in ("residual_profile", "pass_net_increment", "pass_plastic_increment"):
        np.testing.assert_allclose(
            plain.fields[name][1], block.fields[name][1], rtol=0.02, atol=1e-4, err_msg=name
        )


@pytest.mark.parametrize(
    ("sequence", "name"),
    [
        (({"load_ratio": -1.0},), "sequence[0].load_ratio"),
        (({}, {"radius": 100.0}), "sequence[1].radius"),
        (({"times": 0},), "sequence[0].times"),
        (({"times": 1.5},), "sequence[0].times"),
        (({"traction": "much"},), "sequence[0].traction"),
        (({"load_ratio": 0.3},), "sequence[0].element_size"),
    ],
)
def test_bad_sequences_are_named(sequence, name):
    with pytest.raises(ModelError) as caught:
        RollingParameters(sequence=sequence, element_size=1.0)
    assert caught.value.field == name


# -- where no steady pass is found ---------------------------------------------------------------


def test_a_run_without_a_steady_pass_is_rolled_by_increments_and_says_so(monkeypatch):
    def fails(parameters, reach, budget):
        raise NotConverged("no steady pass was found")
        yield

    monkeypatch.setattr(rolling_endless, "steady_passes", fails)
    fields = {"element_size": 4.0, "growth": 1.5, "load": "hertz", "friction": 0.0}
    record = roll(**fields, passes=1)
    assert "no steady pass was found: rolled by increments instead, over 49." in record.message
    assert record.parameters.endless
    assert len(record.coordinates["station"]) == 3
    assert record.scalars["travel"] == pytest.approx(6 * record.parameters.half_width)
    (many,) = records((5,), **fields)
    assert many.status is Status.NOT_CONVERGED, "that many would take too long"
    assert "element_size" in many.message
    assert "advance_step" not in many.message, "a steady pass has none"


HEAVY = {
    "element_size": 9.0, "growth": 2.0, "load_ratio": 10.0,
    "hardening": "isotropic", "hardening_ratio": 0.1,
}  # fmt: skip


@pytest.mark.parametrize("traction", [-0.98, 0.99])
def test_a_heavy_wheel_is_turned_by_almost_all_of_its_friction(traction):
    """It needs a deep window; on an elastic track no contact bears the larger moment."""
    record = roll(**HEAVY, traction=traction)
    assert "increments" not in record.message
    p = record.parameters
    force = record.scalars["longitudinal_force"] / (p.friction * p.force)
    assert force == pytest.approx(traction, abs=0.02)  # along x, on the arm of a pressed rim
    assert 0.05 < record.scalars["max_plastic_strain"] < 0.2


def test_a_wheel_that_is_turned_by_more_than_full_slip_bears_spins():
    """It is a limit of the moment, whatever the material: full slip itself has its pass."""
    (record,) = records((1,), **HEAVY, traction=-0.99)
    assert record.status is Status.LIMIT_LOAD
    told = re.match(r"the wheel spins: all of its contact slips at (\S+)% of", record.message)
    assert told, record.message
    spinning = RollingParameters(**COARSE | HEAVY, control="creepage", given_creepage=-0.1)
    track = track_for(spinning, 4.0)
    (found,) = rolling(track, spinning.material(), load_on(track, spinning, spinning), [1])
    full = 0.99 * spinning.friction * spinning.force
    assert -found.loading.moment / full == pytest.approx(float(told[1]) / 100, abs=2e-3)
    assert -found.loading.moment < 0.995 * full


@pytest.mark.long
def test_what_hardens_has_no_limit_but_leaves_small_strain_theory():
    """All five passes are made: each strains more, on and on."""
    record = roll(
        element_size=9.0, growth=1.6, load_ratio=6.0, friction=0.05, traction=-0.9,
        hardening="mixed", hardening_ratio=0.005, passes=5,
    )  # fmt: skip
    assert record.status is Status.OUTSIDE_THEORY
    assert "plastic strain reaches" in record.message
    assert "increments" not in record.message
    strain = record.fields["pass_max_plastic_strain"][1]
    assert len(strain) == 5
    assert 0.2 < strain[0] < 0.4
    assert (np.diff(strain) > 0.05).all()


def test_a_pass_that_is_not_found_ends_after_so_many_solves(monkeypatch):
    """Of all its attempts on a mesh together; coarser ones on the way have their own."""
    made: list[search.SolveBudget] = []

    def little():
        made.append(SolveBudget(30))
        return made[-1]

    for place in (search, pass_runner):
        monkeypatch.setattr(place, "SolveBudget", little)
    (record,) = records.__wrapped__((5,), **HEAVY, traction=-0.9)
    assert record.status is Status.NOT_CONVERGED
    assert record.message.startswith("no steady pass was found in 30 solves")
    assert record.message.endswith("more hardening it is easier to find")  # not by a finer mesh
    assert {each.solves for each in made} == {30}


def test_windows_of_all_sizes_share_their_solves(monkeypatch):
    tried = []

    def beyond(parameters, reach, budget):
        tried.append(reach)
        for _ in range(20):
            budget.solve(100)
        raise WindowTooSmall("the window is too small below for a steady pass")
        yield

    monkeypatch.setattr(pass_runner, "SolveBudget", lambda: SolveBudget(30))
    monkeypatch.setattr(rolling_endless, "steady_passes", beyond)
    (record,) = records.__wrapped__((5,), **HEAVY)
    assert tried == [1.0, 1.5]
    assert record.status is Status.NOT_CONVERGED
    assert record.message.startswith("no steady pass was found in 30 solves")


def test_a_solve_in_a_larger_window_counts_by_its_points():
    budget = SolveBudget(10)
    for points in (30_000, 100, 120_000, 60_000):  # 1, 1, 4 and 2 of 10
        budget.solve(points)
    budget.solve(120_000)
    assert budget.solves == 5
    with pytest.raises(TooLong, match=r"in 10 solves with the stiffness \(fewer in larger"):
        budget.solve(100)
    budget.renew()
    budget.solve(120_000)
    assert budget.solves == 1


def test_a_coarser_mesh_that_takes_too_long_does_not_end_the_run(monkeypatch):
    fields = USUAL | {"load": "hertz", "friction": 0.05}
    usual = roll(**fields)
    tried = []

    def never(*given, **more):
        tried.append(given)
        raise TooLong("no steady pass was found in so many solves")

    monkeypatch.setattr(rolling_endless, "search", never)
    other = records.__wrapped__((1,), **fields)[0]
    assert tried
    assert other.status is usual.status
    assert "increments" not in other.message
    for name in ("first_row_residual_x", "lowest_residual_x"):
        assert other.scalars[name] == pytest.approx(usual.scalars[name], abs=0.1), name


def test_a_pass_beyond_its_window_is_found_in_a_larger_one(monkeypatch):
    tried = []
    found = rolling_endless.steady_passes

    def needs_more(parameters, reach, budget):
        tried.append(reach)
        if reach < 2:
            raise WindowTooSmall("the window is too small ahead for a steady pass")
        yield from found(parameters, reach)

    monkeypatch.setattr(rolling_endless, "steady_passes", needs_more)
    (larger,) = records.__wrapped__((1,), load="hertz", friction=0.05)
    assert tried == [1.0, 1.5, 2.5]
    monkeypatch.undo()
    usual = roll(load="hertz", friction=0.05, heading="forward", control="moment")
    # the lines of the larger mesh lie at other depths
    for name in ("first_row_residual_x", "lowest_residual_x", "lowest_residual_z"):
        assert larger.scalars[name] == pytest.approx(usual.scalars[name], abs=15.0), name
