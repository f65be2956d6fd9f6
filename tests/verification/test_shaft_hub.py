"""Shaft and hub: power of the edge against the wedge problem, grooves, Lame, hoop stress."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from solver import Record, Status
from solver.errors import ModelError
from studies.scenes.registry import scene_named
from tests.records import kept
from tests.reference.tube import PressFit, Tube
from tests.reference.wedge import singular_power

SCENE = scene_named("shaft_hub")
SLIP: dict[str, Any] = {"pressure": "outward", "interference": "inward"}
FRICTIONS = {"pressure": (0.0, 0.1, 0.2), "interference": (0.0, 0.05, 0.1)}


def run(pressure: float = 100.0, **parameters: Any) -> Record:
    given = {"accuracy": "draft"} | parameters
    (record,) = SCENE.path(SCENE.parameters(**given), [pressure], lambda share: None)
    assert record.status is Status.OK, record.message
    return record


@cache
def standard(loading: str, friction: float) -> Record:
    return kept(run(loading=loading, friction=friction, accuracy="standard"))


@pytest.mark.parametrize(
    ("loading", "friction"), [(loading, f) for loading in FRICTIONS for f in FRICTIONS[loading]]
)
def test_friction_changes_the_power_as_the_wedge_problem_says(
    loading: str, friction: float
) -> None:
    """It lowers the power under a pressure and raises it in a fit: the hub slips the other way."""
    record = standard(loading, friction)
    found, exact = record.scalars["singular_power"], singular_power(friction, slip=SLIP[loading])
    assert found == pytest.approx(exact, abs=2e-3)
    assert abs(found - exact) < record.scalars["singular_power_error"] < 0.01
    assert (exact < singular_power()) == (loading == "pressure" and friction > 0)


def test_no_power_is_told_where_the_edge_sticks_and_another_term_is_larger() -> None:
    """Its power is that of a notch, 0.5445, but only nearer to the edge than the mesh resolves."""
    found = run(loading="interference", friction=0.4).scalars
    assert found["stick_fraction"] > 0.999
    assert np.isnan([found["singular_power"], found["singular_power_error"]]).all()
    assert 0.8 < found["apparent_power"] < 0.9


@pytest.mark.parametrize("loading", ["pressure", "interference"])
def test_friction_moves_what_is_seen_of_the_power(loading: str) -> None:
    seen = [standard(loading, f).scalars["apparent_power"] for f in FRICTIONS[loading]]
    assert (np.diff(seen) < 0).all() if loading == "pressure" else (np.diff(seen) > 0).all()


# without friction both loadings press alike, as a test below has it
@pytest.mark.parametrize(("loading", "friction"), [("pressure", 0.0), ("interference", 0.1)])
def test_a_groove_in_the_shaft_at_the_edge_takes_the_singularity_away(
    loading: str, friction: float
) -> None:
    """As published, p rises to 1 at xi = 0.5: there the groove begins at the edge of the hub."""
    given: dict[str, Any] = {"loading": loading, "friction": friction, "shaft_groove": 0.5}
    far, near, there = (run(xi=xi, **given).scalars for xi in (1.5, 0.6, 0.5))
    assert near["apparent_power"] > far["apparent_power"] + 0.02
    assert there["singular_power"] == pytest.approx(1.0, abs=2e-3)
    assert there["peak_contact_pressure"] < 104.0


def test_a_groove_in_the_hub_takes_intensity_until_the_edge_lifts_off() -> None:
    given = {"loading": "pressure", "hub_groove": 0.2}
    far, near, lifted = (run(eta=eta, **given) for eta in (5.0, 3.0, 1.0))
    for each in (far, near):
        off = abs(each.scalars["singular_power"] - singular_power())
        assert off < each.scalars["singular_power_error"]
    assert near.scalars["singular_intensity"] < 0.8 * far.scalars["singular_intensity"]
    assert lifted.scalars["contact_half_width"] < 49.0
    assert "lifted off" in lifted.message


@pytest.mark.parametrize("loading", ["pressure", "interference"])
def test_without_friction_both_loadings_press_alike(loading: str) -> None:
    """Hub and shaft of one material: a uniform pressure differs from a fit by no shear."""
    record = standard(loading, 0.0)
    pressure, hoop = record.fields["contact_pressure"][1][0], record.fields["hoop_stress"][1]
    other = standard("interference", 0.0).fields["contact_pressure"][1][0]
    np.testing.assert_allclose(pressure, other, rtol=1e-6, atol=1e-4)
    # only the fit pulls the hub around, and only the edge is pressed there too
    s = record.coordinates["s"]
    middle = hoop[0, 0]
    assert middle < 0 if loading == "pressure" else middle > 100.0
    assert hoop[0, s == 50.0] < 0
    assert (hoop[1, s <= 50.0] < 0).all()


def test_a_hub_as_long_as_its_shaft_has_the_pressure_of_lame() -> None:
    """A groove from the edge on, nearly as deep as the shaft, leaves no shaft beside the hub."""
    parameters = SCENE.parameters(accuracy="draft", shaft_groove=0.95, xi=0.5)
    (pair,) = SCENE.model(parameters).contacts
    hub, shaft = (
        Tube(inner=a, outer=b, youngs_modulus=2e5, poisson_ratio=0.3)
        for a, b in ((50.0, 125.0), (0.0, 50.0))
    )
    lame = PressFit(shaft=shaft, hub=hub, interference=100.0 * pair.interference)
    # the reference holds the length of both bodies, here they are free: E in place of E/(1-nu^2)
    assert lame.pressure * (1 - 0.3**2) == pytest.approx(100.0, rel=1e-9)
    record = run(shaft_groove=0.95, xi=0.5)
    s, pressure = record.coordinates["s"], record.fields["contact_pressure"][1][0]
    assert pressure[s < 49.0] == pytest.approx(100.0, rel=2e-3)


@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({"hub_groove": 1.0}, "hub_groove"),
        ({"shaft_groove": 1.0}, "shaft_groove"),
        ({"hub_groove": 0.5, "eta": 2.5}, "eta"),
        ({"shaft_groove": 0.5, "xi": 6.0}, "xi"),
        ({"shaft_groove": 0.5, "xi": 0.4}, "xi"),
    ],
)
def test_a_groove_that_does_not_fit_is_refused(changes: dict[str, Any], name: str) -> None:
    with pytest.raises(ModelError, match=f"^{name} = "):
        SCENE.parameters(**changes)
