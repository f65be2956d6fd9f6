"""Entries of a scene file, each in a run whose numbers are known in closed form."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.studies.scenes.conftest import blocks, built

pytestmark = pytest.mark.solves


def numbers(content: dict[str, Any]) -> dict[str, Any]:
    """Return the numbers of a run."""
    scene = built(content)
    (*_, record) = scene.path(scene.parameters(), [0.0], lambda done: None)
    assert record.status.name == "OK", record.message
    return record.scalars


def test_a_pair_is_there_in_its_active_stages_alone() -> None:
    """Two blocks in plane stress, without friction: the upper one is moved down and stays there."""
    content = blocks() | {"kinematics": "plane_stress"}
    content["parameters"]["mu"]["default"] = 0.0
    content["bodies"]["lower"]["supports"] = {"bottom": "y", "left": "x"}
    content["contacts"][0]["active"] = ["on"]
    content["loads"] = [{"body": "upper", "kind": "displacement", "boundary": "top", "y": -0.001}]
    stages = ("on", "off", "away")
    content["stages"] = [{"name": stage, "increments": 1} for stage in stages]
    content["outputs"] = {
        f"force_{stage}": {"of": "normal_force", "contact": "face", "stage": stage}
        for stage in stages
    }
    found = numbers(content)
    exact = [2e5 * 0.001 / 4 * 4, 0.0, 0.0]
    assert [found[f"force_{s}"] for s in stages] == pytest.approx(exact, rel=1e-9, abs=1e-9)


ARC = {"kind": "arc", "centre": [1.0, 2.0], "radius": 10.0, "angles": [210.0, 330.0]}


def test_springs_shorten_by_pressure_over_stiffness_and_a_rotation_is_stored_in_radians() -> None:
    content = blocks()
    del content["contacts"], content["bodies"]["lower"], content["parameters"]["mu"]
    content["results"] = {}
    content["links"] = [{"slave": "upper.bottom", "components": "y", "stiffness": 5e3}]
    content["rigid"] = {"vane": {"surfaces": {"rim": ARC}, "rotation": {"moved": 30.0}}}
    content["outputs"] = {
        "sunk": {"of": "displacement.y", "take": "maximum", "body": "upper", "stage": "pressed"},
        "turned": {"of": "motion.rotation", "part": "vane", "stage": "pressed"},
    }
    found = numbers(content)
    assert found["sunk"] == pytest.approx(-150.0 / 5e3, rel=1e-9)
    assert found["turned"] == pytest.approx(np.pi / 6, rel=1e-12)


@pytest.mark.parametrize("angle", [30.0, "30 deg", "0.5235987755982988 rad"])
def test_an_arc_lies_between_its_angles_and_a_rotation_is_in_degrees(angle: float | str) -> None:
    content = blocks()
    content["rigid"] = {"tool": {"surfaces": {"rim": ARC}, "rotation": {"moved": angle}}}
    scene = built(content)
    (tool,) = scene.model(scene.parameters()).rigid
    ends = np.asarray(tool.surfaces["rim"].points)[:, [0, -1]]
    np.testing.assert_allclose(ends, [[1 - 75**0.5, 1 + 75**0.5], [-3.0, -3.0]], atol=1e-12)
    assert tool.rotation.value == pytest.approx(np.pi / 6, rel=1e-12)
