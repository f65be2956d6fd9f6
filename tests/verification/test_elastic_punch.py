"""The elastic punch: power of the corner against the wedge problem, stick, grooves, fringes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from solver import Record, Status, solve
from solver.contact.problem import FORWARD
from solver.errors import ModelError
from solver.loading.program import PathControl
from solver.results.singularity import fit_singularity
from studies.scenes.registry import scene_named
from tests.records import kept
from tests.reference.wedge import singular_power, sticking_friction

SCENE = scene_named("elastic_punch")
FRICTIONS = (0.0, 0.2, 0.4)
COARSE: dict[str, Any] = {"accuracy": "draft", "half_plane_size": 20.0}

MESH = 1e-3
"""Error of the power by the coarse mesh, all over the range of the fit."""


def run(pressure: float = 100.0, **parameters: Any) -> Record:
    (record,) = SCENE.path(SCENE.parameters(**parameters), [pressure], lambda share: None)
    assert record.status is Status.OK, record.message
    return kept(record)


@pytest.fixture(scope="module")
def runs() -> dict[float, Record]:
    return {friction: run(friction=friction) for friction in FRICTIONS}


def test_frictionless_corner_has_the_power_of_dundurs_and_lee(runs: dict[float, Record]) -> None:
    """Measured 0.7742 against 0.7740."""
    found = runs[0.0].scalars
    assert found["singular_power"] == pytest.approx(singular_power(), abs=5e-4)
    assert found["singular_power_error"] < 5e-4


@pytest.mark.parametrize("friction", FRICTIONS[1:])
def test_friction_lowers_the_power_as_the_wedge_problem_says(
    runs: dict[float, Record], friction: float
) -> None:
    """Measured 0.6800, 0.5975 against 0.6799, 0.5983."""
    found = runs[friction].scalars
    exact = singular_power(friction, slip="outward")
    assert abs(found["singular_power"] - exact) < min(1e-3, found["singular_power_error"])
    assert found["singular_power_error"] < 5e-3


def test_the_punch_slips_outward_at_the_corner(runs: dict[float, Record]) -> None:
    """The slip that the wedge problem is solved for: shear draws the half-plane outward."""
    for friction in FRICTIONS[1:]:
        record = runs[friction]
        s, (_, pressure), (_, shear) = (
            record.coordinates["s"],
            *(record.fields[name] for name in ("contact_pressure", "contact_shear")),
        )
        near = (s > 50.0 * 0.97) & (s < 50.0)
        assert shear[0, near] == pytest.approx(friction * pressure[0, near], rel=1e-6)


def test_with_enough_friction_the_corner_sticks() -> None:
    """Then its power is that of a notch of 270 degrees, 0.5445; the next one is near, 0.9085."""
    found = run(friction=0.7).scalars
    assert sticking_friction() < 0.7
    assert found["stick_fraction"] == 1.0
    assert found["singular_power"] == pytest.approx(singular_power(slip="stuck"), abs=5e-3)
    assert 5e-3 < found["singular_power_error"] < 0.1


def test_what_sticks_grows_with_friction(runs: dict[float, Record]) -> None:
    found = [runs[friction].scalars["stick_half_width"] for friction in FRICTIONS]
    assert found[0] == 0.0
    assert (np.diff(found) > 0).all()
    assert found[1:] == pytest.approx([14.3, 45.8], abs=0.3)  # half an element: 0.25


def test_fields_are_proportional_to_the_load(runs: dict[float, Record]) -> None:
    one, other = runs[0.4], run(250.0, friction=0.4)
    for name in ("contact_pressure", "contact_shear", "stress_difference"):
        (_, small), (_, large) = one.fields[name], other.fields[name]
        np.testing.assert_allclose(large, 2.5 * small, rtol=1e-6, atol=1e-6 * np.nanmax(large))


def test_one_increment_is_exact_also_with_friction() -> None:
    model = SCENE.model(SCENE.parameters(friction=0.3, **COARSE))
    tractions = []
    for steps in (1, 4):
        control = PathControl(load_step=100.0 / steps, unload_steps=1)
        found = solve(model, load=100.0, control=control)
        tractions.append(np.stack([found.contact().pressure, found.contact().shear]))
        status = found.loaded.state.contacts[0].status
        assert (status[-20:] == FORWARD).any()
    np.testing.assert_allclose(tractions[1], tractions[0], atol=1e-6 * tractions[0].max())


def test_tractions_do_not_depend_on_the_elastic_constants() -> None:
    """Bodies of the same material under given forces: J.H. Michell, Proc. LMS 31 (1899) 100-124."""
    changes = {"poisson_ratio": 0.1, "youngs_modulus": 7e4, "state": "plane_stress"}
    steel, other = (run(friction=0.2, **COARSE, **own) for own in ({}, changes))
    far = steel.coordinates["s"] < 50.0 * 0.99  # twenty elements and more from the corner
    (_, expected) = steel.fields["contact_pressure"]
    _, pressure = other.fields["contact_pressure"]
    np.testing.assert_allclose(pressure[0, far], expected[0, far], rtol=1e-3)
    assert other.scalars["singular_power"] == pytest.approx(
        steel.scalars["singular_power"], abs=1e-3
    )


@pytest.mark.long
def test_a_groove_in_the_half_plane_leaves_the_corner_its_power_and_takes_its_intensity() -> None:
    """What the thesis plots (fig. 4.16) is the power that the pressure seems to have."""
    distances = (2.5, 1.1, 0.6)
    found = [run(half_plane_groove=0.5, xi=xi, **COARSE).scalars for xi in distances]
    apparent = np.array([each["apparent_power"] for each in found])
    intensity = [each["singular_intensity"] for each in found]
    for each in found[:2]:  # the last one is nearer than this mesh resolves
        error = abs(each["singular_power"] - singular_power())
        assert error < each["singular_power_error"] + MESH
    assert (np.diff(apparent) > 0).all()
    # nearly constant, then steep
    assert apparent[1] - apparent[0] < 0.03
    assert apparent[2] - apparent[1] > 0.08
    assert intensity[1] < 0.95 * intensity[0]


@pytest.mark.parametrize("friction", [0.0, 0.2])
def test_a_groove_that_begins_at_the_corner_takes_the_singularity_away(friction: float) -> None:
    """As published, p rises to 1: two quarter-planes of one material meet in a right angle each."""
    found = run(half_plane_groove=0.5, xi=0.5, friction=friction, **COARSE).scalars
    assert found["singular_power"] == pytest.approx(1.0, abs=0.02)
    assert abs(found["singular_power"] - 1.0) < found["singular_power_error"]


@pytest.mark.long
def test_a_groove_in_the_punch_takes_intensity_until_the_corner_lifts_off() -> None:
    heights = (4.0, 2.0, 0.75)
    records = [run(punch_groove=0.2, eta=eta, friction=0.1, **COARSE) for eta in heights]
    far, near, lifted = (record.scalars for record in records)
    for each in (far, near):
        error = abs(each["singular_power"] - singular_power(0.1))
        assert error < each["singular_power_error"] + MESH
    assert near["singular_intensity"] < 0.7 * far["singular_intensity"]
    assert np.isnan([lifted["singular_power"], lifted["apparent_power"]]).all()
    assert lifted["contact_half_width"] < 50.0
    assert "lifted off" in records[2].message


def test_isochromatics_far_from_the_contact_are_those_of_a_bar(runs: dict[float, Record]) -> None:
    """Half-way up the punch, one half-width from the contact: 3 % is what is left of its end."""
    record = runs[0.0]
    (_, field), x, y = record.fields["stress_difference"], *map(record.coordinates.get, "xy")
    assert field[y.argmax(), x < 45.0] == pytest.approx(100.0, rel=0.12)
    assert np.isnan(field[np.ix_(y > 0, x > 50.0)]).all()


@pytest.mark.parametrize("friction", [0.0, 0.4])
def test_isochromatics_near_the_corner_have_its_power(
    runs: dict[float, Record], friction: float
) -> None:
    """Along a ray at 45 degrees into the punch, 0.06 to 1 mm from the corner."""
    record = runs[friction]
    (_, field), x, y = record.fields["stress_difference"], *map(record.coordinates.get, "xy")
    r = x[x > 50.0] - 50.0
    ray = np.array([field[np.argmin(np.abs(y - d)), np.argmin(np.abs(x - 50.0 + d))] for d in r])
    found = fit_singularity(r, ray, 0.06, 1.0)
    assert found.error < 3e-3
    assert abs(found.power - singular_power(friction)) < found.error


@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({"punch_groove": 1.0}, "punch_groove"),
        ({"punch_groove": 0.5, "eta": 3.0}, "eta"),
        ({"half_plane_groove": 5.0, "xi": 100.0}, "xi"),
    ],
)
def test_a_groove_that_does_not_fit_is_refused(changes: dict[str, Any], name: str) -> None:
    with pytest.raises(ModelError, match=f"^{name} = "):
        SCENE.parameters(**changes)
