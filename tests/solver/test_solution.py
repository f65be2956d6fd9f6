"""What a solution tells at places of the user's own, and while it is found."""

from __future__ import annotations

import logging

import numpy as np
import pytest

from solver import Body, ContactPair, Material, Model, ModelError, PathControl, Solution, solve
from solver.mesh import grid

pytestmark = pytest.mark.solves

STEEL = Material(youngs_modulus=2e5, poisson_ratio=0.3, yield_stress=300.0)
PRESSURE = 100.0


def model() -> Model:
    x = np.linspace(0.0, 4.0, 9)
    upper = Body(name="upper", mesh=grid(x, np.linspace(0.0, 2.0, 5)), material=STEEL,
                 supports={"left": "x"}, pressure={"top": PRESSURE})  # fmt: skip
    lower = Body(name="lower", mesh=grid(x, np.linspace(-2.0, 0.0, 5)), material=STEEL,
                 supports={"left": "x", "bottom": "y"})  # fmt: skip
    pair = ContactPair(slave=("upper", "bottom"), master=("lower", "top"))
    return Model(bodies=(upper, lower), contacts=(pair,))


@pytest.fixture(scope="module")
def solution() -> Solution:
    return solve(model())


def test_fields_at_places_are_those_of_uniaxial_pressure(solution: Solution) -> None:
    places = [[0.3, 1.7, 3.9, 5.0], [-0.4, -1.1, -1.9, -1.0]]
    found = solution.at("lower", places, "loaded")
    stress = found["stress"]
    assert stress.shape == (4, 4)
    assert stress[1, :3] == pytest.approx(-PRESSURE)
    assert stress[2, :3] == pytest.approx(-0.3 * PRESSURE)
    assert np.isnan(stress[:, 3]).all(), "this place is outside of the body"
    y = np.array(places[1][:3])
    shortened = PRESSURE * (1 - 0.3**2) / 2e5
    assert found["displacement"][1, :3] == pytest.approx(-shortened * (y + 2.0), rel=1e-6)
    assert (found["plastic_strain"][:3] == 0.0).all()
    nodes = solution.nodes("lower")
    at_nodes = solution.at("lower", nodes, "loaded")["stress"]
    assert at_nodes == pytest.approx(solution.stress("lower", "loaded"), abs=1e-9)


def test_what_acts_on_a_surface(solution: Solution) -> None:
    face = solution.contact()
    assert face.pressure == pytest.approx(PRESSURE)
    assert np.abs(face.shear).max() < 1e-9
    assert np.abs(face.gap).max() < 1e-9
    assert face.length == pytest.approx(4.0)
    assert face.s[-1] == pytest.approx(4.0)
    assert np.abs(face.slip).max() < 1e-9, "both blocks grow alike"


@pytest.mark.parametrize(
    ("body", "places", "stage", "field"),
    [
        ("middle", [[0.0], [0.0]], "loaded", "body = 'middle': must be one of upper, lower"),
        ("lower", [0.0, 0.0], "loaded", r"places = \(2,\): must be positions"),
        ("lower", [[0.0], [0.0]], "pressed", "stage = 'pressed': must be one of loaded, unloaded"),
    ],
)
def test_bad_places_are_refused(
    solution: Solution, body: str, places: list[list[float]], stage: str, field: str
) -> None:
    with pytest.raises(ModelError, match=field):
        solution.at(body, places, stage)


def test_progress_is_told_and_may_stop_the_work(caplog: pytest.LogCaptureFixture) -> None:
    told: list[float] = []
    with caplog.at_level(logging.INFO, "solver"):
        solve(yielding := model(), control=PathControl(load_step=0.25), progress=told.append)
    assert told == sorted(told)
    assert 0.0 < told[0] <= told[-1] <= 1.0
    assert len(caplog.records) == len(told)

    def stop(share: float) -> None:
        raise KeyboardInterrupt(share)

    with pytest.raises(KeyboardInterrupt):
        solve(yielding, progress=stop)
