"""A steady pass that Newton's method does not find at once is found by way of easier ones."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from solver import LimitLoad, Material
from solver.errors import NotConverged, WindowTooSmall
from solver.fem.fields import recovery
from solver.rolling import search as steady_search
from solver.rolling.load import PassingLoad, RollingLoad
from solver.rolling.passing import passing, searched
from solver.rolling.plane.lines import wheel_nodes
from solver.rolling.plane.rolling import Expected
from solver.rolling.plane.track import track_of
from solver.rolling.results.plane import TrackBody
from solver.rolling.scenes.rolling import RollingParameters
from solver.rolling.scenes.rolling_endless import load_on, track_for
from solver.rolling.search import _HARDEST, _LIGHTER, _SOFTEST, _approached, _fading, search


class Weight(PassingLoad):
    """A load that knows its force alone."""

    def on(self, u, before, start=None):
        raise NotImplementedError


WEIGHT = Weight(load=RollingLoad(force=1.0))


def solver(steps, failures, near=0.94):
    """A pass that is found from one whose load is nearly its own, and fails as told otherwise."""

    def solve(load, guess=None):
        steps.append(load.force)
        if load.force in failures:
            raise failures[load.force]
        if load.force == 1.0 and (guess is None or abs(1.0 - guess) > 1.0 - near):
            raise LimitLoad("flows without bound")
        return SimpleNamespace(strain=load.force)

    return solve


LOST = LimitLoad("flows without bound")


def approached(solve, shares=_LIGHTER, begun=None):
    return _approached(solve, WEIGHT.load.scaled, shares, begun, LOST)


def test_lighter_loads_lead_to_what_seemed_a_limit():
    steps = []
    assert approached(solver(steps, {})).strain == 1.0
    assert steps == [0.8, 0.9, 0.95, 1.0]


def test_heavier_loads_lead_down_to_it():
    steps = []
    begun = SimpleNamespace(strain=1.1)
    assert approached(solver(steps, {}), (1.06, 1.03), begun).strain == 1.0
    assert steps == [1.06, 1.03, 1.0]


def test_it_is_a_limit_where_other_loads_do_not_lead_there():
    steps = []
    failures = {0.9: NotConverged("lost")}
    assert approached(solver(steps, failures)) is LOST
    assert steps == [0.8, 0.9]
    assert approached(solver(steps, {}), (1.06, 1.03), NotConverged("lost")) is LOST
    assert steps == [0.8, 0.9]


def test_a_window_that_is_too_small_for_a_lighter_load_is_told():
    with pytest.raises(WindowTooSmall):
        approached(solver([], {0.9: WindowTooSmall("below")}))


# -- hardening that fades away ---------------------------------------------------------------------


def faded(hardest_to_find=0.0, own=0.0, largest=np.inf, step=0.3):
    """The ratios tried; a pass is found from one whose hardening is not too much larger."""
    tried = []

    def eased(ratio, guess):
        tried.append(ratio)
        if ratio <= hardest_to_find or (guess is not None and ratio < step * guess):
            raise NotConverged("lost")
        return SimpleNamespace(strain=ratio, most_added=0.01 / ratio)

    found = _fading(eased, lambda guess: SimpleNamespace(strain=guess), own, largest)
    return tried, found.strain


def test_hardening_fades_by_thirds_and_the_last_guess_is_the_softest():
    tried, guess = faded()
    np.testing.assert_allclose(np.diff(np.log(tried)), np.log(1 / 3))
    assert tried[0] == _HARDEST
    assert guess == tried[-1] < 3 * _SOFTEST


def test_it_fades_down_to_the_hardening_of_the_material():
    tried, _ = faded(own=2e-3)
    assert min(tried) > 2e-3


def test_it_fades_more_slowly_where_a_pass_is_hard_to_find():
    tried, _ = faded(step=0.5)
    assert tried[1] < 0.5 * tried[0] < tried[2]
    assert tried[-1] < 3 * _SOFTEST


def test_a_pass_that_is_not_found_however_slowly_it_fades_is_told():
    with pytest.raises(NotConverged, match="lost"):
        faded(hardest_to_find=1e-3)


def test_where_a_material_hardens_more_hardening_fades_if_the_hardest_pass_is_not_found():
    tried = []

    def eased(ratio, guess):
        tried.append(ratio)
        if guess is None and ratio < 0.2:
            raise NotConverged("lost")
        return SimpleNamespace(strain=ratio, most_added=0.01)

    def exactly(guess):
        return SimpleNamespace(strain=guess)

    found = _fading(eased, exactly, 0.005, np.inf)
    np.testing.assert_allclose(tried, _HARDEST * np.array([1, 3, 9, 3, 1, 1 / 3]))
    assert found.strain == tried[-1]
    with pytest.raises(NotConverged, match="lost"):
        _fading(eased, exactly, 0.0, np.inf)


@pytest.mark.parametrize("ratio", [0.0, 1e-3])
def test_only_what_does_not_harden_is_at_its_limit_where_it_gathers_much(monkeypatch, ratio):
    found = SimpleNamespace(strain=1.0, most_added=0.5, loading=SimpleNamespace(start=None))
    monkeypatch.setattr(steady_search, "passing", lambda *given, **settings: found)
    steel = Material(
        youngs_modulus=2e5, poisson_ratio=0.3, yield_stress=500.0,
        hardening="mixed" if ratio else "none", hardening_ratio=ratio,
    )  # fmt: skip
    virgin = SimpleNamespace(accumulated=np.zeros(1))
    if ratio:
        assert search(None, steel, WEIGHT, virgin) is found
    else:
        with pytest.raises(LimitLoad, match="more than 30%"):
            search(None, steel, WEIGHT, virgin)


def test_passes_of_fading_hardening_that_gather_too_much_are_at_their_limit():
    limit = r"more than 30% of plastic strain, even if the material hardens by 0\.0"
    with pytest.raises(LimitLoad, match=limit):
        faded(largest=1.0)


# -- bad guesses -----------------------------------------------------------------------------------


@pytest.mark.parametrize("failure", [LimitLoad, NotConverged])
def test_a_bad_guess_does_not_make_a_limit_of_a_pass_that_exists(monkeypatch, failure):
    found = SimpleNamespace(strain=1.0, most_added=0.01, loading=SimpleNamespace(start=None))

    def passing(track, material, load, before, guess=None, **settings):
        if guess is not None:
            raise failure("flows without bound")
        return found

    monkeypatch.setattr(steady_search, "passing", passing)
    rolled = SimpleNamespace(accumulated=np.ones(1))
    steel = Material(youngs_modulus=2e5, poisson_ratio=0.3, yield_stress=500.0)
    assert search(None, steel, WEIGHT, rolled, guess=np.ones(1)) is found


# -- passes that repeat ----------------------------------------------------------------------------


def test_a_pass_is_expected_to_go_on_as_those_before():
    strains = [np.array([1.0, -2.0]) * size for size in (1.0, 1.5, 1.75, 1.875)]
    expected = Expected(strains[0])
    np.testing.assert_array_equal(expected.next, strains[0])
    for strain in strains[1:3]:
        expected = expected.after(strain)
    np.testing.assert_allclose(expected.next, strains[3])


def test_a_change_that_turns_back_or_grows_is_not_carried_further():
    turned = Expected(np.ones(1)).after(2 * np.ones(1)).after(np.ones(1))
    np.testing.assert_array_equal(turned.next, [1.0])
    grown = Expected(np.ones(1)).after(2 * np.ones(1)).after(5 * np.ones(1))
    np.testing.assert_array_equal(grown.next, [8.0])


# -- what a half-plane is made of ------------------------------------------------------------------


def test_nodes_of_the_surface_have_values_of_their_own():
    track = track_of(8.0, 4.0, 1.3, RollingParameters().material().elasticity)
    half_plane = TrackBody(track, 1)
    part = half_plane.full("half_space")
    depth = -part.points[1].ravel()
    x = part.points[0].ravel()
    recover, top = half_plane.recovery("half_space"), part.X[1] == 0
    values = recover @ np.append(depth, np.zeros(len(track.rows.highest)))
    np.testing.assert_array_equal(values[top], 0.0)
    along = recover @ np.append(x, x[track.rows.highest])
    near = abs(part.X[0]) < 2 * track.half_width
    np.testing.assert_allclose(along[top & near], part.X[0, top & near], atol=1e-9)
    below = recovery(part) @ depth
    np.testing.assert_allclose(values[~top], below[~top])
    assert abs(below[top]).max() < 0.1 * depth.min()


@pytest.mark.parametrize(
    ("sizes", "share"),
    [
        ({1: 0.9, 1 / 2: 0.5}, 1),
        ({1: 2.4, 1 / 2: 1.3, 1 / 4: 0.996, 1 / 8: 0.85, 1 / 16: 0.9, 1 / 32: 0.8}, 1 / 8),
        ({1: 2.4, 1 / 2: 0.99, 1 / 4: 0.95, 1 / 8: 0.9, 1 / 16: 0.8, 1 / 32: 0.7}, 1 / 32),
        ({1: 2.4, 1 / 2: 1.3, 1 / 4: 1.2, 1 / 8: 1.1, 1 / 16: 1.1, 1 / 32: 1.1}, 1),
        ({1: 3.4, 1 / 2: 1.3, 1 / 4: 1.2, 1 / 8: 1.1, 1 / 16: 1.2, 1 / 32: 1.3}, 1 / 8),
        ({1: 2.4, 1 / 2: 0.9, 1 / 4: np.nan, 1 / 8: 0.8, 1 / 16: 0.9, 1 / 32: 1.0}, 1 / 8),
    ],
    ids=["whole", "least", "shortest", "none lowers", "none may grow", "no contact"],
)
def test_shares_of_a_step_are_halved_as_long_as_that_lowers_the_residual(sizes, share):
    def at(tried):
        if np.isnan(sizes[tried]):
            raise NotConverged("no contact")
        return SimpleNamespace(size=sizes[tried], share=tried)

    assert searched(at, 1.0).share == share


def test_newtons_method_finds_a_pass_with_little_hardening():
    """A step that barely lowers the residual led to plastic strain without end."""
    p = RollingParameters(
        hardening="mixed", hardening_ratio=0.005, traction=-0.9, friction=0.05, load_ratio=6.0,
        element_size=6.5, growth=1.6,
    )  # fmt: skip
    track = track_for(p, 2.5)
    found = passing(track, p.material(), load_on(track, p, p), track.rows.virgin(p.material()))
    assert found.steps < 40
    assert 0.2 < found.most_added < 0.4


def test_rim_and_track_have_sides_of_one_length():
    """Rolling by one side is the same on both, however reach over side is rounded."""
    for number in range(300):
        radius = 33.492 * (1 + number / 97)
        a = RollingParameters(radius=radius, element_size=0.1).half_width
        p = RollingParameters(radius=radius, element_size=a / 5)
        angle, _ = wheel_nodes(radius, p.reach, p.element_size)
        sides = np.diff(angle[np.abs(angle) <= p.reach / radius * (1 + 1e-9)]) * radius
        np.testing.assert_allclose(sides, p.element_size, rtol=1e-9)
