"""The ball: Hertz's contact, first yield, full plasticity, flattening, crater and reload."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from solver.results.record import Record, Status
from studies.scenes.registry import scene_named
from tests.records import kept
from tests.reference.flattening import HertzBall, PlasticBall, first_yield

BALL = scene_named("ball")
RE, E, NU, R = 410.0, 2.0e5, 0.3, 10.0
LOADED = {"unload_steps": 1}
"""For what is asked under load."""
COARSE = {"element_size": 1 / 8}
FINE = {"element_size": 1 / 16}


def pressed(status: Status = Status.OK, **own: Any) -> Record:
    return record_of(BALL.parameters(**({"accuracy": "draft", "load_step": 0.2} | own)), status)


@cache
def record_of(parameters: Any, status: Status) -> Record:
    (record,) = BALL.path(parameters, [parameters.cycles], lambda fraction: None)
    assert record.status is status, record.message
    return kept(record)


@pytest.mark.parametrize(
    ("yielding", "stiffness"), [("half_space", 1.0), ("half_space", 20.0), ("ball", 20.0)]
)
def test_an_elastic_ball_is_the_contact_of_hertz(yielding: str, stiffness: float) -> None:
    own = {"load_ratio": 1.4, "yielding": yielding, "ball_stiffness": stiffness} | LOADED
    found = pressed(load_step=1.0, **own).scalars
    modulus = E / (1 - NU**2) / (1 if yielding == "ball" else 1 + 1 / stiffness)
    force = np.pi**3 * R**2 * (1.4 * RE) ** 3 / (6 * modulus**2)
    a = (3 * force * R / (4 * modulus)) ** (1 / 3)
    assert found["force"] == pytest.approx(force, rel=1e-4)
    assert found["peak_contact_pressure"] == pytest.approx(1.4 * RE, rel=0.01)
    assert found["approach"] == pytest.approx(a**2 / R, rel=0.01)
    assert found["contact_half_width"] == pytest.approx(a, rel=0.01)
    assert HertzBall(interference=a**2 / R, radius=R, modulus=modulus).force == pytest.approx(force)


def test_the_half_space_first_yields_at_the_pressure_of_the_closed_form() -> None:
    ratio, _ = first_yield(NU)
    assert ratio == pytest.approx(1.613, abs=1e-3)
    for load, yields in ((0.97 * ratio, False), (1.03 * ratio, True)):
        found = pressed(load_ratio=load, load_step=0.25, **LOADED)
        assert (found.scalars["max_plastic_strain"] > 0) == yields


def test_a_contact_that_yields_all_over_has_the_mean_pressure_of_an_indentation() -> None:
    own: dict[str, Any] = {"load_ratio": 14.0, "ball_stiffness": 20.0} | FINE | LOADED
    found = pressed(Status.OUTSIDE_THEORY, **own).scalars
    assert 2.8 * RE < found["mean_contact_pressure"] < 3.1 * RE


@pytest.mark.parametrize(("load_ratio", "load_step"), [(1.66, 0.2), (3.0, 0.2), (10.0, 0.1)])
def test_a_ball_is_flattened_as_published(load_ratio: float, load_step: float) -> None:
    own = {"load_ratio": load_ratio, "load_step": load_step, "yielding": "ball"} | FINE | LOADED
    found = pressed(**own).scalars
    published = PlasticBall(radius=R, youngs_modulus=E, poisson_ratio=NU, yield_stress=RE)
    w, force = found["approach"], found["force"]
    critical = published.kogut_etsion_critical().interference
    assert 1.0 < w / critical < 62.0
    # the two fits differ by up to 5 % from each other
    assert published.kogut_etsion(w)[0] == pytest.approx(force, rel=0.05)
    assert published.jackson_green(w)[0] == pytest.approx(force, rel=0.05)


def test_without_hardening_the_crater_is_deepest_and_its_pile_up_highest() -> None:
    none, isotropic, kinematic = (
        pressed(**COARSE, hardening=rule, hardening_ratio=0.024 if rule != "none" else 0.0).scalars
        for rule in ("none", "isotropic", "kinematic")
    )
    for name in ("pile_up", "crater_depth"):
        assert none[name] > 1.05 * max(isotropic[name], kinematic[name])
    for found in (none, isotropic, kinematic):
        assert 1.0 < found["pile_up_radius"] / found["contact_half_width"] < 1.3
        assert found["crater_depth"] > 5 * found["pile_up"] > 0


def test_loaded_again_it_returns_to_the_same_point() -> None:
    """Errors of energy add up over cycles, and so does the work that they are compared with."""
    cycles = 2
    once, often = pressed(**COARSE), pressed(**COARSE, cycles=cycles)
    # what is left is the tolerance of the increments
    for name, share in (("approach", 1e-4), ("contact_half_width", 1e-4), ("crater_depth", 1e-3)):
        assert often.scalars[name] == pytest.approx(once.scalars[name], rel=share)
    force, approach = (often.fields[f"increment_{name}"][1] for name in ("force", "approach"))
    assert len(force) == cycles * (5 + 5) + 1
    # once unloaded the contact is elastic: it goes back the way it came
    down, up = (np.interp(200.0, force[part], approach[part])
                for part in (slice(10, 4, -1), slice(10, 16)))  # fmt: skip
    assert up == pytest.approx(down, rel=0.02)
