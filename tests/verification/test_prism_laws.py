"""Passes over a prism of every law: against increments, by their audit, and what they tend to."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from solver.linear.solvers import one_thread
from solver.materials import SmoothMaterial, Voce
from solver.materials.hardening_rules import HARDENING
from solver.materials.law import Law
from solver.results.shakedown import ShakedownState, classify
from solver.rolling.audit.plain_rail import PlainPrism
from solver.rolling.audit.rail import audit_prism
from solver.rolling.load import RollingLoad
from solver.rolling.passing import Pass, passing
from solver.rolling.rail.track import PrismTrack
from solver.rolling.scenes.initial_stress import OverHeight
from solver.rolling.scenes.wheel_rail import WheelRailParameters
from tests.solver.yield_surfaces import Hosford
from tests.verification.prism_blocks import AHEAD, PERFECT, RE, A, block, residual, stressed
from tests.verification.stepped_prism import SteppedEllipse, SteppedPrism

CURVE = ((0.0, RE), (0.002, 560.0), (0.02, 640.0))
WORDS: dict[str, dict[str, Any]] = {
    "none": {},
    "isotropic": {"hardening_ratio": 0.02},
    "kinematic": {"hardening_ratio": 0.02},
    "mixed": {"hardening_ratio": 0.02},
    "voce": {"saturation": 100.0, "saturation_rate": 50.0},
    "power": {"hardening_exponent": 0.1},
    "table": {"curve": CURVE},
    "chaboche": {"back_stresses": ((60_000.0, 600.0), (4000.0, 20.0))},
    "layered": {"curve": CURVE},
}
SPACING, LENGTH, ADVANCE, FROM_START = 2.0, 96.0, 48.0, 28.0


def law(word: str, condition: str = "mises") -> Law:
    """The law of a rail with this hardening."""
    return WheelRailParameters(hardening=word, yield_condition=condition, **WORDS[word]).material()


LAWS: dict[str, Law] = {
    **{word: law(word) for word in WORDS},
    "tresca": law("voce", "tresca"),
    "hosford": SmoothMaterial(
        elasticity=PERFECT.elasticity,
        curve=Voce(yield_stress=RE, saturation=100.0, rate=50.0),
        surface=Hosford(8.0),
    ),
}


@cache
def track() -> PrismTrack:
    """A block of 16 elements of 5 by 3.5 mm in its zone."""
    return block(4.0, LENGTH, spacing=SPACING, far=40.0, growth=2.0)


@cache
def plain(of: PrismTrack) -> PlainPrism:
    """The second evaluation of a block."""
    return PlainPrism(of)


def pressure(peak: float, a: float = A, b: float = 4.0) -> SteppedEllipse:
    """The pressure of an ellipse, as wide as the coarse block allows."""
    return SteppedEllipse(
        grid=track().grid, load=RollingLoad(force=2 * np.pi * a * b * peak / 3), a=a, b=b
    )


def compared(own: PrismTrack, material: Law) -> None:
    """Assert that increments leave the state of a steady pass, and that the next one is sound."""
    load = pressure(1360.0)
    body = SteppedPrism(own, material, parts=1)
    with one_thread():
        found = passing(own, material, load, own.virgin(material), parts=1)
        end = body.rolled(body.virgin, pressure(1360.0), round(ADVANCE / SPACING))
    station = round((AHEAD + ADVANCE - FROM_START) / SPACING)
    plastic, steady = end.state.plastic_strain[:, station], found.after.plastic_strain
    largest = np.linalg.norm(steady, axis=1).max()
    assert largest > 1e-3
    assert np.linalg.norm(plastic - steady, axis=1).max() < 0.02 * largest
    stress = material.stiffness(6) @ (end.state.strain[:, station] - plastic).T
    assert np.abs(stress - residual(material, found.after)).max() < 0.02 * RE
    with one_thread():
        again = passing(own, material, load, found.after, found.strain)
    audit = audit_prism(own, material, again, found.left, plain(own))
    assert audit.passed, audit.violations


# the first four words are one compiled law, which mixes both; tresca has the curve of voce
@pytest.mark.parametrize("name", [n for n in LAWS if n not in ("isotropic", "kinematic", "voce")])
def test_increments_of_any_law_leave_the_state_of_its_pass(name: str) -> None:
    compared(track(), LAWS[name])


def test_so_do_increments_over_initial_stress() -> None:
    own = stressed(track(), OverHeight(stress_over_height=((-30.0, -150.0), (0.0, 200.0))))
    compared(own, LAWS["chaboche"])


def test_every_word_is_here() -> None:
    assert {*HARDENING} == {*WORDS}


@pytest.mark.parametrize(
    ("word", "peak", "b", "state"),
    [
        ("kinematic", 2100.0, 3.5, ShakedownState.PLASTIC_SHAKEDOWN),
        ("mixed", 1600.0, 3.0, ShakedownState.ELASTIC_SHAKEDOWN),
    ],
)
def test_a_surface_that_grows_without_bound_ends_the_flow(
    word: str, peak: float, b: float, state: int
) -> None:
    """Where it only moves, every pass of a high load shears the material to and fro.

    The largest pressures fit the coarse block: nothing may yield at the rim of its zone.
    """
    own, material, load = track(), LAWS[word], pressure(peak, 5.0, b)
    found: Pass[Any] | None = None
    accumulated, plastic = [], []
    with one_thread():
        for _ in range(10):
            before = own.virgin(material) if found is None else found.after
            found = passing(own, material, load, before, None if found is None else found.strain)
            accumulated.append(found.after.accumulated - before.accumulated)
            plastic.append(found.after.plastic_strain - before.plastic_strain)
    net = np.sqrt(2 / 3 * (np.array(plastic) ** 2).sum(axis=2))
    found_state = classify(np.array(accumulated), net, RE / 2e5, hardens=material.hardens).state
    assert found_state is state
