"""Steady passes of any law: against the compiled one, limits of laws, one increment, and its audit.

The law of linear hardening is compiled. Any other one is asked for its response from column to
column; both ways give the same numbers where both can go.
"""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from functools import cache
from math import sqrt
from pathlib import Path

import numpy as np
import pytest

from solver import Material
from solver.materials import (
    ArmstrongFrederick,
    Chaboche,
    Elasticity,
    Layered,
    SmoothMaterial,
    TrescaMaterial,
    Voce,
)
from solver.rolling import flow
from solver.rolling.audit.plane import audit_pass
from solver.rolling.flow import CompiledSweep, SteppedSweep
from solver.rolling.plane.rolling import rolling
from solver.rolling.plane.rows import RowFlow
from solver.rolling.plane.track import track_of, under_load
from solver.rolling.scenes.rolling import RollingParameters
from solver.rolling.scenes.rolling_endless import load_on, track_for
from solver.shipped import SCENES
from tests.solver.yield_surfaces import Hosford
from tests.verification.interleaved import InterleavedTrack
from tests.verification.steady_increment import SteadyIncrement

YIELD, RATIO = 502.0, 0.024
K = YIELD / sqrt(3)
A = 8.0
ELASTIC = Elasticity(youngs_modulus=2e5, poisson_ratio=0.3)
MODULUS = 2e5 * RATIO / (1 - RATIO)
FADING = ((60_000.0, 600.0), (4000.0, 20.0))
ROOT = Path(__file__).parents[2]
LINEAR = ("none", "isotropic", "kinematic", "mixed")


def linear(hardening):
    return Material(
        youngs_modulus=2e5,
        poisson_ratio=0.3,
        yield_stress=YIELD,
        hardening=hardening,
        hardening_ratio=RATIO,
    )


def chaboche(*pairs, saturation=0.0):
    return Chaboche(
        elasticity=ELASTIC,
        curve=Voce(yield_stress=YIELD, saturation=saturation, rate=30.0),
        back_stresses=tuple(ArmstrongFrederick(*pair) for pair in pairs),
    )


LAWS = {
    "fading": chaboche(*FADING, saturation=80.0),
    "layered": Layered.of_curve(ELASTIC, (YIELD / 2e5, 0.005, 0.02), (YIELD, 560.0, 650.0)),
    "tresca": TrescaMaterial(elasticity=ELASTIC, curve=Voce(yield_stress=YIELD, modulus=MODULUS)),
    "hosford": SmoothMaterial(
        elasticity=ELASTIC, curve=Voce(yield_stress=YIELD, modulus=MODULUS), surface=Hosford(8.0)
    ),
}


@pytest.fixture
def exactly(monkeypatch):
    """Passes are found to rounding, so that both ways of finding them can be compared."""
    module = sys.modules["solver.rolling.plane.rolling"]
    monkeypatch.setattr(module, "TOLERANCE", 1e-11)


def place(size=4.0):
    return track_of(A, size, 1.3, ELASTIC)


def passes(law, ways, *, shear=0.1, pressure=4.7, parts=None):
    track = place()
    return list(rolling(track, law, track.hertz(pressure * K, shear), ways, parts=parts))


# -- the linear law both ways --------------------------------------------------------------------


@pytest.mark.parametrize("hardening", LINEAR)
@pytest.mark.parametrize("parts", [1, 4, 16])
def test_rows_stepped_by_the_law_flow_as_the_compiled_ones(hardening, parts):
    law, rows = linear(hardening), place().rows
    added = rows.strain(place().hertz(5.0 * K, 0.1).u)
    before = passes(law, [1])[0].after
    at_rest = before.strain(ELASTIC)[:, None]
    strain = np.concatenate([at_rest, at_rest + added], axis=1)
    compiled = CompiledSweep(law, strain, before.state, parts)
    stepped = SteppedSweep(law, strain, before.state, parts)
    assert (compiled.states.accumulated[:, -1] > before.accumulated).any()
    for name in ("states", "ago"):
        one, other = (getattr(each, name).packed for each in (compiled, stepped))
        np.testing.assert_allclose(one, other, atol=1e-15, err_msg=name)


def _by_both(run, monkeypatch):
    compiled = run()
    monkeypatch.setattr(flow, "sweep_of", SteppedSweep)
    return zip(compiled, run(), strict=True)


@pytest.mark.usefixtures("exactly")
@pytest.mark.parametrize("hardening", ["none", "mixed"])
def test_passes_there_and_back_are_the_same_both_ways(hardening, monkeypatch):
    for one, other in _by_both(lambda: passes(linear(hardening), [1, -1, 1], parts=4), monkeypatch):
        seen, left = one.after.whole.state.packed, other.after.whole.state.packed
        assert one.after.accumulated.max() > 1e-3
        np.testing.assert_allclose(seen, left, atol=1e-9 * np.abs(seen).max())


@pytest.mark.usefixtures("exactly")
def test_so_are_those_of_a_wheel(monkeypatch):
    p = RollingParameters(element_size=3.0, growth=1.5, traction=0.3, hardening="kinematic")
    track = track_for(p)
    for one, other in _by_both(
        lambda: list(rolling(track, p.material(), load_on(track, p, p), [1, 1], parts=4)),
        monkeypatch,
    ):
        np.testing.assert_allclose(one.plastic_strain, other.plastic_strain, atol=1e-9)
        assert one.loading.creepage == pytest.approx(other.loading.creepage, rel=1e-8)


# -- limits of laws ------------------------------------------------------------------------------


@pytest.mark.usefixtures("exactly")
def test_a_back_stress_without_recall_is_kinematic_hardening():
    # a second one, of no size, keeps the law from the closed form
    prager, kinematic = chaboche((MODULUS, 0.0), (0.0, 1.0)), linear("kinematic")
    # every law takes the same number of increments
    for one, other in zip(
        *(passes(law, [1, -1], parts=4) for law in (prager, kinematic)), strict=True
    ):
        for left, own in ((one.left, other.left), (one.left.top, other.left.top)):
            np.testing.assert_allclose(left.plastic_strain, own.plastic_strain, atol=1e-9)
            back = 2 / 3 * MODULUS * own.plastic_strain.T
            np.testing.assert_allclose(left.state.back[0], back, atol=1e-4)  # MPa


@pytest.mark.usefixtures("exactly")
def test_two_back_stresses_alike_are_one_of_twice_the_modulus():
    (one,), (both,) = (
        passes(chaboche(*pairs), [1], parts=4) for pairs in ([(2e4, 300.0)], [(1e4, 300.0)] * 2)
    )
    np.testing.assert_allclose(one.after.plastic_strain, both.after.plastic_strain, atol=1e-9)


def test_recall_makes_a_load_ratchet_that_prager_s_rule_shakes_down():
    def nets(law):
        found = passes(law, [1] * 8, parts=4)
        return [
            abs(one.after.plastic_strain - one.before.plastic_strain).max() for one in found[-4:]
        ]

    ratchets, closes = nets(chaboche((60_000.0, 600.0))), nets(chaboche((60_000.0, 0.0)))
    assert min(ratchets) > 0.5 * max(ratchets) > 1e-4
    assert max(closes) < 0.01 * min(ratchets)


# -- the way of other laws -----------------------------------------------------------------------


@pytest.mark.parametrize("name", LAWS)
def test_the_derivative_of_one_increment_a_column_is_that_of_differences(name):
    law, rows = LAWS[name], place(2.0).rows
    loaded = rows.strain(place(2.0).hertz(4.7 * K, 0.1).u)
    change = loaded * np.random.default_rng(3).normal(size=loaded.shape)
    step = 1e-6

    def at(strain):
        return RowFlow(rows, law, rows.virgin(law), strain, 1)

    more, less = (at(loaded + s * step * change).force for s in (1, -1))
    differences, exact = (more - less) / (2 * step), at(loaded).along(change)
    # edges of Tresca's surface are kinks, across which some differences go
    most = 1e-2 if name == "tresca" else 1e-4
    assert np.linalg.norm(exact - differences) < most * np.linalg.norm(differences)


@cache
def twice(name):
    """Two passes of a law, the same way."""
    return passes(LAWS[name], [1, 1], parts=2)


@pytest.mark.parametrize("name", LAWS)
def test_material_at_rest_behind_the_load_carries_no_stress_across(name):
    law = LAWS[name]
    after = twice(name)[0].after
    for layers in (after, after.top):
        found = law.respond(layers.strain(ELASTIC).T, layers.state)
        assert abs(found.stress[[1, 3]]).max() < 1e-6 * YIELD
        assert law.yield_value(found.stress, layers.state).max() < 1e-6
        np.testing.assert_allclose(found.stress.T, layers.stress(ELASTIC), atol=1e-6)


@pytest.mark.parametrize("name", LAWS)
def test_passes_the_other_way_leave_the_mirror_image(name):
    first, second = twice(name)[-1].left, passes(LAWS[name], [-1, -1], parts=2)[-1].left
    for seen, left in ((second.mirrored, first), (second.mirrored.top, first.top)):
        np.testing.assert_allclose(seen.state.packed, left.state.packed, atol=1e-9)
    assert abs(first.plastic_strain[:, 3]).max() > 1e-3


@pytest.mark.parametrize("name", LAWS)
def test_a_steady_pass_is_a_fixed_point_of_one_increment(name):
    """By the law at every point, with all its internal variables.

    An increment of one element takes each point to the place of the one two columns before.
    """
    law = LAWS[name]
    track = InterleavedTrack(A, 4.0, 1.3, ELASTIC)
    (one,) = rolling(track, law, track.hertz(4.7 * K, 0.09), [1], parts=1)
    whole, points = np.arange(track.part.weights.size), track.rows.points
    state = under_load(track, one).plastic.at(whole)
    upstream = np.concatenate(
        [one.before.state.packed[..., None], one.states.packed[..., :-1]], axis=2
    )
    packed = state.packed
    packed[:, points] = upstream
    strain = track.part.strain(under_load(track, one).u)
    now = law.respond(strain, state.unpacked(packed)).state.plastic_strain[:, points]
    change = np.moveaxis(now, 0, 2) - one.plastic_strain
    assert 2 * ELASTIC.shear_modulus * abs(change).max() < 0.1


def test_a_pass_of_a_wheel_on_fading_back_stresses_is_one_too():
    one = SteadyIncrement(
        element_size=3.0, traction=0.3, hardening="chaboche", back_stresses=FADING
    )
    found = one.solve(from_touch=False)
    assert one.change(found) < 1.0  # MPa
    assert (found.state.contacts[0].status == one.found.loading.status).all()


# -- scenes, and their audit ---------------------------------------------------------------------

CURVE = ((0.0, YIELD), (0.002, 560.0), (0.02, 640.0))
WORDS = {
    "voce": {"hardening": "voce", "saturation": 150.0},
    "table": {"hardening": "table", "curve": CURVE},
    "chaboche": {"hardening": "chaboche", "back_stresses": FADING, "saturation": 80.0},
    "layered": {"hardening": "layered", "curve": CURVE},
    "tresca": {"hardening": "isotropic", "yield_condition": "tresca"},
}


@pytest.mark.parametrize(
    ("word", "load"), [*((word, "hertz") for word in WORDS), ("chaboche", "contact")]
)
def test_every_word_rolls_and_its_audit_agrees(word, load):
    p = RollingParameters(
        element_size=4.0, growth=2.0, traction=0.2, load=load, passes=2, yield_stress=YIELD,
        direction="back_and_forth", **WORDS[word],
    )  # fmt: skip
    (record,) = SCENES["rolling"].path(p, [2], lambda share: None)
    assert record.status.solved, record.message
    assert record.scalars["max_plastic_strain"] > 1e-3
    for name in ("audit_law", "audit_history", "audit_yield"):
        assert record.scalars[name] < 1e-9, name


@cache
def _two():
    p = RollingParameters(
        element_size=4.0, growth=2.0, traction=0.3, load="hertz", **WORDS["chaboche"]
    )
    track = track_for(p)
    first, second = rolling(track, p.material(), load_on(track, p, p), [1, -1])
    return track, p.material(), first, second


def _with_back(layers, back):
    return replace(layers, state=replace(layers.state, back=back))


@pytest.mark.parametrize(
    ("broken", "figure"),
    [
        (
            lambda p: replace(p, states=replace(p.states, back=1.01 * p.states.back)),
            "audit_law",
        ),
        (lambda p: replace(p, parts=p.parts // 2), "audit_law"),
        (
            lambda p: replace(p, after=_with_back(p.after, 0 * p.after.state.back)),
            "audit_law",
        ),
        (
            lambda p: replace(p, before=_with_back(p.before, 0 * p.before.state.back)),
            "audit_history",
        ),
        (
            lambda p: replace(p, before=p.before.mirrored),
            "audit_history",
        ),
    ],
)
def test_the_audit_finds_what_is_wrong_with_internal_variables(broken, figure):
    track, law, first, second = _two()
    assert audit_pass(track, law, second, first.left, -1).violations == ()
    violations = audit_pass(track, law, broken(second), first.left, -1).violations
    assert any(text.startswith(figure) for text in violations), violations


OWN = """
from solver.shipped import SCENES
from solver.rolling.scenes.rolling import RollingParameters

p = RollingParameters(
    element_size=4.0, growth=3.0, load="hertz", passes=1, hardening="threshold", threshold=30.0,
)
(record,) = SCENES["rolling"].path(p, [1], lambda share: None)
assert record.status.solved, record.message
assert record.scalars["max_plastic_strain"] > 1e-3
print(record.scalars["audit_law"] < 1e-6)
"""


@pytest.mark.processes
def test_a_back_stress_of_one_s_own_rolls_by_its_word():
    own = ROOT / "examples" / "own_back_stress.py"
    setting = os.environ | {"RESIDUA_PARTS": str(own), "PYTHONPATH": str(ROOT)}
    run = subprocess.run(
        [sys.executable, "-c", OWN], env=setting, capture_output=True, text=True, check=False
    )
    assert run.stdout.strip() == "True", run.stderr


class SweptTo:
    """A sweep that ends in given states, whose changes are given."""

    def __init__(self, end):
        self.states = end.unpacked(end.packed[..., None])

    def along(self, change):
        """Return no changes along the rows, and those of the last column."""
        return change[:, None, :4], change


@pytest.mark.parametrize("hardening", LINEAR)
def test_the_state_behind_has_the_derivative_of_differences(hardening, monkeypatch):
    """Of plastic strain by all internal variables, in rows of which many flow as they unload."""
    monkeypatch.setattr(flow, "sweep_of", lambda law, strain, start, parts: SweptTo(start))
    law = linear(hardening)
    random = np.random.default_rng(0)

    def shear(size):
        values = size * random.normal(size=(4, 40))
        values[:3] -= values[:3].mean(axis=0)
        return values

    plastic = shear(3e-3)
    last = law.initial(40, 4).unpacked(np.vstack([plastic, 0.8 * np.linalg.norm(plastic, axis=0)]))

    def behind(state):
        return flow.Flow(law, np.zeros((40, 2, 4)), state, 1)

    here = behind(last)
    flows = here.after.accumulated > last.accumulated
    assert 10 < flows.sum() < 30
    way = np.concatenate([shear(1e-3), 1e-3 * random.normal(size=(1, 40))])
    high, low = (
        behind(last.unpacked(last.packed + step * way)).after.plastic_strain
        for step in (1e-5, -1e-5)
    )
    exact = (high - low) / 2e-5
    _, found = here.along(way.T)
    assert np.abs(found - exact.T).max() < 1e-6 * np.abs(exact).max()
