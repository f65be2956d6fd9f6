"""The fretting pad of the scene file against Cattaneo and Mindlin, forth, back and forth again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from solver import Record, Status
from studies.scenes.scene import read_scene
from tests.reference.cattaneo import SlidingCylinders
from tests.verification.closed_forms import plane_strain_modulus

PAD = Path(__file__).parents[2] / "data/scenes/fretting.toml"
# the pad is 160 mm wide and high: one of 20 mm bends, and its pressure is not quite even
SIZES = {"width": 160.0, "radius": 200.0, "pressed_in": 0.012, "element": 0.03}
PUSH, BACK = 80.0, -0.5
STAGES = ("pressed", "pushed", "back", "again")


@pytest.fixture(scope="module")
def record() -> Record:
    scene = read_scene(PAD)
    parameters = scene.parameters(tangential_force=PUSH, turned_to=BACK, **SIZES)
    (found,) = scene.path(parameters, [None], lambda share: None)
    assert found.status is Status.OK, found.message
    return found


def field(record: Record, name: str) -> np.ndarray:
    return record.fields[name][1]


def forces(record: Record, stage: str) -> tuple[float, float]:
    """Return normal force, and tangential force on the half-plane, at the end of a stage [N]."""
    at = np.argmin(np.abs(field(record, "moment_time") - STAGES.index(stage) - 1))
    names = ("contact_normal_force", "contact_tangential_force")
    normal, tangential = (float(field(record, name)[0, at]) for name in names)
    return normal, -tangential


def exact(record: Record, stage: str) -> SlidingCylinders:
    force, _ = forces(record, stage)
    modulus = plane_strain_modulus(2e5, 0.3) / 2
    return SlidingCylinders(force=force, radius=SIZES["radius"], modulus=modulus, friction=0.3)


def miss(found: np.ndarray, wanted: np.ndarray, x: np.ndarray) -> float:
    """Return the area between two curves / area under the second."""
    return float(np.trapezoid(np.abs(found - wanted), x) / np.trapezoid(np.abs(wanted), x))


@pytest.mark.parametrize("stage", STAGES)
def test_the_pressure_is_that_of_hertz(record: Record, stage: str) -> None:
    x, pressure = field(record, "pair_x")[0], field(record, "pair_pressure")
    found = pressure[0, STAGES.index(stage)]
    curve = exact(record, stage)
    assert miss(found, curve.pressure(x), x) < 0.02
    assert found.max() == pytest.approx(curve.peak_pressure, rel=0.005)


def test_the_contact_is_as_wide_as_by_hertz(record: Record) -> None:
    wanted = 2 * exact(record, "pushed").half_width
    assert record.scalars["contact_width"] == pytest.approx(wanted, rel=0.02)


@pytest.mark.parametrize("stage", STAGES[1:])
def test_the_shear_is_that_of_cattaneo_forth_and_of_mindlin_back(
    record: Record, stage: str
) -> None:
    x, shear = field(record, "pair_x")[0], field(record, "pair_shear")
    found = -shear[0, STAGES.index(stage)]  # on the half-plane
    (_, push), (_, now) = forces(record, "pushed"), forces(record, stage)
    curve = exact(record, stage)
    back = stage == "back"
    assert (
        miss(found, curve.reversed_shear(x, now, push) if back else curve.shear(x, now), x) < 0.02
    )
    assert push == pytest.approx(PUSH, rel=1e-3)
    assert now / push == pytest.approx(BACK if back else 1.0, abs=1e-4)


def test_tension_is_behind_the_contact(record: Record) -> None:
    """The pad is pushed to the right: the surface behind it is pulled."""
    half_width = exact(record, "pushed").half_width
    assert record.scalars["tension"] > 0.0
    assert record.scalars["tension_x"] == pytest.approx(-half_width, rel=0.1)


def test_slip_is_at_the_edges_alone(record: Record) -> None:
    x, slip = field(record, "pair_x")[0], np.abs(field(record, "pair_slip")[0, 1])
    curve = exact(record, "pushed")
    _, push = forces(record, "pushed")
    stick, width = curve.stick_width(push), curve.half_width
    before = np.abs(field(record, "pair_slip")[0, 0])
    gone = np.abs(slip - before)
    assert gone[np.abs(x) < 0.9 * stick].max() < 0.02 * gone[np.abs(x) < width].max()
