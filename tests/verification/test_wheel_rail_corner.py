"""A wheel on the gauge corner of a rail: on its side, at two places, and what is refused."""

from __future__ import annotations

import re
import time
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from solver import ModelError, Record
from solver.errors import NoContact, NotConverged, Runaway, WindowTooSmall
from solver.results.record import Status
from solver.rolling import search
from solver.rolling.scenes import rail_outputs
from solver.rolling.scenes import rail_passes as prism_passes
from solver.rolling.scenes.rail_outputs import ComputedAccuracy, remedies
from solver.rolling.scenes.wheel_rail import ELEMENT_SIZE, WheelRailParameters
from solver.rolling.scenes.wheel_rail_contact import expected_contact, rail_of, upper, wheel_of
from solver.rolling.scenes.wheel_rail_track import geometry
from solver.shipped import SCENES

SCENE = SCENES["wheel_rail"]
DRAFT = {"accuracy": "draft", "hardening": "kinematic", "hardening_ratio": 0.0196}


def rolled(**changes: object) -> Record:
    """The record of one pass."""
    (record,) = SCENE.path(SCENE.parameters(**DRAFT | changes), [1], lambda share: None)
    assert record.status is Status.OK, record.message
    return record


def test_the_gauge_corner_and_the_top_share_the_load() -> None:
    """Both contacts of S1002 at z = 2 mm; the audit sums their forces up anew."""
    record = rolled(lateral_position=2.0)
    dims, values = record.fields["patch_pressure"]
    z, pressure = record.coordinates["z"], values.max(axis=dims.index("x"))
    corner, top, between = (
        pressure[(z > low) & (z < high)] for low, high in ((-30, -24.5), (-21, -9), (-24.1, -22.9))
    )
    assert between.max() < 50.0 < 1000.0 < min(corner.max(), top.max())
    numbers = record.scalars
    assert numbers["audit_reactions"] < 1e-6
    assert numbers["audit_overlap"] < 1e-9
    # slopes of 20 and 5 degrees carry the load with a force to the outside of the track
    assert 0.05 < numbers["lateral_force"] / 150e3 < 0.2
    contact = expected_contact(record.parameters)  # type: ignore[arg-type]
    outline = rail_of(record.parameters).outline  # type: ignore[arg-type]
    right, left = outline.at(np.array(contact.ends))[0]
    assert (left, right) == pytest.approx((numbers["patch_left"], numbers["patch_right"]), abs=3.0)


def test_a_wheel_on_the_corner_alone_presses_along_its_normal() -> None:
    """A stiff foundation, which holds the rail: contact is at slopes of 15 to 45 degrees."""
    record = rolled(lateral_position=3.5, foundation=1e4, load=40e3, friction=0.0)
    numbers = record.scalars
    assert numbers["patch_left"] < numbers["patch_right"] < -24.0
    section = rail_of(record.parameters)  # type: ignore[arg-type]
    s = [section.place(numbers[name]) for name in ("patch_left", "patch_right")]
    dz, dy = section.outline.direction(np.array(s))
    steep, flat = dy / dz
    assert flat < numbers["lateral_force"] / 40e3 < steep
    assert numbers["audit_reactions"] < 1e-6


@pytest.mark.long
def test_easier_passes_lead_to_one_that_newtons_method_does_not_find(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """On elements of 2 mm friction leaves several balances of two contacts, or none.

    `test_steady_approach` makes the claim of passes in the plane, by the same search.
    """
    missed = 0
    own = search.passing

    def counted(*given: Any, **settings: Any) -> Any:
        nonlocal missed
        try:
            return own(*given, **settings)
        except NotConverged:
            missed += 1
            raise

    monkeypatch.setattr(search, "passing", counted)
    record = rolled(lateral_position=3.0, friction=0.3)
    assert missed
    assert record.scalars["audit_reactions"] < 1e-6


@pytest.mark.parametrize(
    ("error", "friction", "remedy"),
    [
        (NoContact("no contact forces were found"), 0.17, "lower load or traction"),
        (NoContact("no contact forces were found"), 0.4, "of 290 MPa: set shear_limit = 1"),
        (Runaway("plastic strain grows"), 0.4, "lower load or traction"),
        (WindowTooSmall("too small"), 0.4, "lower the load"),
    ],
)
def test_a_pass_that_is_not_found_names_the_one_remedy_of_its_reason(
    monkeypatch: pytest.MonkeyPatch, error: NotConverged, friction: float, remedy: str
) -> None:
    """With friction 0.4 at 2 mm no mesh has a contact, and with this limit there is one."""

    def lost(*given: object, **settings: object) -> None:
        raise error

    monkeypatch.setattr(search, "passing", lost)
    monkeypatch.setattr(rail_outputs, "FINER", {})
    parameters = SCENE.parameters(**{**DRAFT, "friction": friction})
    (record,) = SCENE.path(parameters, [1], lambda share: None)
    assert record.status is Status.NOT_CONVERGED
    assert record.message.startswith(str(error))
    assert record.message.endswith(remedy) and record.message.count("; ") == 1


def test_smaller_elements_are_tried_where_they_are_the_remedy(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Under two contacts draft elements often have no contact forces where smaller ones have."""
    own, tried, lost = search.passing, list[int](), list[float]()

    def coarse(track: Any, *given: Any, **settings: Any) -> Any:
        tried.append(len(track.points[0]))
        if tried[-1] == tried[0]:
            began = time.process_time()
            while time.process_time() < began + 0.02:
                pass
            lost.append(time.process_time() - began)
            raise NoContact("no contact forces were found")
        return own(track, *given, **settings)

    monkeypatch.setattr(search, "passing", coarse)
    monkeypatch.setitem(
        cast("dict[str, float]", ELEMENT_SIZE), "standard", 2.6
    )  # cheap; any other size than that of draft
    began = time.process_time()
    record = rolled(friction=0.17)
    assert record.message == (
        "no contact forces were found: computed with accuracy = standard instead"
    )
    assert record.scalars["computed_accuracy"] == ComputedAccuracy.STANDARD
    assert sum(lost) < record.scalars["cpu_seconds"] < time.process_time() - began
    assert getattr(record.parameters, "accuracy", "") == "draft"
    assert not record.state()  # passes go on with elements of draft, or with none


def test_bounds_know_the_elements_that_may_be_tried() -> None:
    """A draft of which a run is lost needs the unknowns and the memory of standard elements."""
    efforts = {
        accuracy: SCENE.effort(SCENE.parameters(**{**DRAFT, "accuracy": accuracy}), [1])
        for accuracy in ("draft", "standard", "fine")
    }
    draft, standard, fine = efforts.values()
    assert draft.unknowns == standard.unknowns < fine.unknowns
    assert draft.memory == standard.memory
    assert draft.seconds < standard.seconds


def test_a_limit_load_is_not_tried_with_smaller_elements() -> None:
    given = {"lateral_control": "force", "given_lateral_force": -1e5}
    parameters = SCENE.parameters(**DRAFT | given)
    (record,) = SCENE.path(parameters, [1], lambda share: None)
    assert record.status is Status.LIMIT_LOAD
    assert "with accuracy" not in record.message


def test_shear_beyond_yield_is_named_with_coulombs_law_alone() -> None:
    """Another law need not have this coefficient, nor `shear_limit`."""
    usual = SCENE.parameters(**{**DRAFT, "friction": 0.4})
    other = SimpleNamespace(
        material=usual.material, friction=0.4, friction_law="tanh", accuracy="draft"
    )
    assert "set shear_limit = 1" in remedies(usual, 1e3)[NoContact]
    assert remedies(other, 1e3)[NoContact] == "choose accuracy = standard"
    assert remedies(usual, 1e3)[Status.AUDIT_FAILED] == remedies(usual, 1e3)[NoContact]
    reasons = {"audit_yield": "shear_limit = 1", "audit_contact_resolution": "accuracy = standard"}
    for figure, remedy in reasons.items():
        assert SCENE.remedy(usual, None, Status.AUDIT_FAILED, [figure]).endswith(remedy)
    assert remedies(usual, 1e2)[Status.AUDIT_FAILED] == "choose accuracy = standard"


def test_a_lateral_force_that_no_contact_at_this_position_has_is_told_with_the_least() -> None:
    """The corner pushes the rail aside; creepage moves load from top to corner, not the force."""
    given = {"lateral_position": 2.0, "load": 60e3, "friction": 0.3, "lateral_control": "force"}
    (record,) = SCENE.path(SCENE.parameters(**DRAFT | given), [1], lambda share: None)
    assert record.status is Status.LIMIT_LOAD
    assert re.search(r"slides off: .* lateral force is 49\d\d N, not 0: give one", record.message)


def test_the_largest_zone_is_told_if_it_is_too_small(monkeypatch: pytest.MonkeyPatch) -> None:
    def beyond(*given: object, **settings: object) -> None:
        raise WindowTooSmall("the window is too small around for a steady pass")

    monkeypatch.setattr(prism_passes, "search", beyond)
    (record,) = SCENE.path(SCENE.parameters(**DRAFT), [1], lambda share: None)
    assert record.status is Status.NOT_CONVERGED
    told = r"steady pass, in the largest zone, \d\d.* mm wide and 13.* mm deep; lower the load"
    assert re.search(told, record.message)


@pytest.mark.parametrize("lateral_position", [-10.0, -4.0, 0.0, 2.0, 3.0, 3.6])
def test_the_zone_holds_the_expected_contact(lateral_position: float) -> None:
    p = WheelRailParameters(lateral_position=lateral_position, accuracy="draft")
    contact, own, section = expected_contact(p), geometry(p), rail_of(p)
    middle = section.place(own.at)
    right, left = upper(section)
    assert right <= middle - own.half_width < contact.ends[0] - own.size
    assert left >= middle + own.half_width > contact.ends[1] + own.size


def test_the_flange_touches_where_the_gap_along_normals_is_least() -> None:
    """Before the flange touches, the first contact moves from the top over the corner."""
    slopes = []
    for position in (-4.0, 1.0, 3.0, 3.6):
        p = WheelRailParameters(lateral_position=position)
        s = np.arange(*upper(rail_of(p)), 0.1)
        z, y = rail_of(p).outline.at(s)
        dz, dy = -rail_of(p).outline.direction(s)
        gap, _, height = wheel_of(p).above(0 * z, z, y, np.arctan2(dy, dz))
        assert height == pytest.approx(-expected_contact(p).gap, abs=1e-3)
        assert gap.min() == pytest.approx(0.0, abs=1e-12)
        slopes.append(np.degrees(np.arctan2(dy, dz))[gap.argmin()])
    assert (np.diff(slopes) > 1.0).all()


@pytest.mark.parametrize(
    ("position", "told"),
    [
        (4.5, r"about 0\.8\d* mm inside its side at z = -3"),
        (8.0, r"about 4\.\d* mm inside its side"),
        (20.0, "it would stand on it"),
    ],
)
def test_a_flange_inside_the_rail_is_told(position: float, told: str) -> None:
    parameters = WheelRailParameters(lateral_position=position)
    with pytest.raises(ModelError, match=rf"lateral_position = {position}: must leave.*{told}"):
        expected_contact(parameters)
