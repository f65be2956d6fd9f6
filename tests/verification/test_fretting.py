"""The fretting pad of the scene file against Cattaneo and Mindlin, forth, back and forth again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from solver import Record, Status
from tests.verification.scene_files import (
    BACK,
    PUSH,
    STAGES,
    cattaneo,
    changed,
    forces,
    fretting,
    shear,
)


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Record:
    folder = tmp_path_factory.mktemp("scenes")
    changed("fretting.toml", "increments = 8", "increments = 2", folder)
    found = fretting(element=0.036, folder=folder)
    assert found.status is Status.OK, found.message
    return found


def field(record: Record, name: str) -> np.ndarray:
    return record.fields[name][1]


def miss(found: np.ndarray, wanted: np.ndarray, x: np.ndarray) -> float:
    """Return the area between two curves / area under the second."""
    return float(np.trapezoid(np.abs(found - wanted), x) / np.trapezoid(np.abs(wanted), x))


@pytest.mark.parametrize("stage", STAGES)
def test_the_pressure_is_that_of_hertz(record: Record, stage: str) -> None:
    x, pressure = field(record, "contact_x")[0], field(record, "contact_pressure")
    found = pressure[0, STAGES.index(stage)]
    curve = cattaneo(record, stage)
    assert miss(found, curve.pressure(x), x) < 0.02
    assert found.max() == pytest.approx(curve.peak_pressure, rel=0.005)


def test_the_contact_is_as_wide_as_by_hertz(record: Record) -> None:
    wanted = 2 * cattaneo(record, "pushed").half_width
    assert record.scalars["contact_width"] == pytest.approx(wanted, rel=0.02)


@pytest.mark.parametrize("stage", STAGES[1:])
def test_the_shear_is_that_of_cattaneo_forth_and_of_mindlin_back(
    record: Record, stage: str
) -> None:
    x, found, wanted = shear(record, stage)
    (_, push), (_, now) = forces(record, "pushed"), forces(record, stage)
    assert miss(found, wanted, x) < 0.02
    assert push == pytest.approx(PUSH, rel=1e-3)
    assert now / push == pytest.approx(BACK if stage == "back" else 1.0, abs=1e-4)


def test_tension_is_behind_the_contact(record: Record) -> None:
    """The pad is pushed to the right: the surface behind it is pulled."""
    half_width = cattaneo(record, "pushed").half_width
    assert record.scalars["tension"] > 0.0
    assert record.scalars["tension_x"] == pytest.approx(-half_width, rel=0.1)


def test_slip_is_at_the_edges_alone(record: Record) -> None:
    x, slip = field(record, "contact_x")[0], np.abs(field(record, "contact_slip")[0, 1])
    curve = cattaneo(record, "pushed")
    _, push = forces(record, "pushed")
    stick, width = curve.stick_width(push), curve.half_width
    before = np.abs(field(record, "contact_slip")[0, 0])
    gone = np.abs(slip - before)
    assert gone[np.abs(x) < 0.9 * stick].max() < 0.02 * gone[np.abs(x) < width].max()


def test_wear_and_slip_are_those_of_half_a_cycle(record: Record) -> None:
    """Half of a cycle with the same amplitude about zero: a change counts, not its place.

    Slip is that of the last point that touches, up to an element inside the edge.
    """
    (_, push), (_, back) = forces(record, "pushed"), forces(record, "back")
    amplitude, curve = (push - back) / 2, cattaneo(record, "pushed")
    x = np.linspace(-curve.half_width, curve.half_width, 20_001)
    slip, pressure = curve.slip(x, amplitude), curve.pressure(x)
    found = record.scalars
    assert found["wear_depth"] == pytest.approx(2e-8 * (pressure * slip).max(), rel=0.02)
    inside = curve.slip(np.array([curve.half_width - 0.036]), amplitude)[0]
    assert inside < found["slip_length"] / 2 < slip.max()
    work = 2 * curve.friction * pressure * slip
    assert found["slip_work"] == pytest.approx(work.max(), rel=0.02)
    share = 1 - curve.stick_width(amplitude) / curve.half_width
    assert found["slip_share"] == pytest.approx(share, abs=0.03)


@pytest.mark.long
def test_fretting_does_not_depend_on_the_slave_but_by_its_tension(
    record: Record, tmp_path: Path
) -> None:
    """The half-plane as the slave; its tension is also that of the line along its surface.

    The largest parameter lies inside the last two elements, where pressure falls to zero.
    """
    changed("fretting.toml", "increments = 8", "increments = 2", tmp_path)
    scene = tmp_path / "fretting.toml"
    sides = 'slave = "pad.bottom"\nmaster = "half_plane.top"'
    text = scene.read_text()
    assert sides in text
    scene.write_text(text.replace(sides, 'slave = "half_plane.top"\nmaster = "pad.bottom"'))
    other = fretting(element=0.036, folder=tmp_path)
    for name in ("wear_depth", "slip_work", "slip_share"):
        assert other.scalars[name] == pytest.approx(record.scalars[name], rel=0.03), name
    (_, push), (_, back) = forces(record, "pushed"), forces(record, "back")
    curve, x = cattaneo(record, "pushed"), other.fields["line_x"][1][0]
    work = 2 * curve.friction * curve.pressure(x) * curve.slip(x, (push - back) / 2)
    tension = other.fields["line_stress"][1][0, 1:3, 0].max(axis=0)
    assert other.scalars["fretting_parameter"] == pytest.approx((tension * work).max(), rel=0.25)
