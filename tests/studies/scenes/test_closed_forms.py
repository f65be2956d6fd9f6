"""Entries of a scene file, each in a run whose numbers are known in closed form."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.studies.scenes.conftest import blocks, built

pytestmark = pytest.mark.solves

E, SIDE, HEIGHT, MOVED = 2e5, 4.0, 2.0, -0.001


def numbers(content: dict[str, Any]) -> dict[str, Any]:
    """Return the numbers of a run."""
    scene = built(content)
    (*_, record) = scene.path(scene.parameters(), [0.0], lambda done: None)
    assert record.status.name == "OK", record.message
    return record.scalars


def pressed(*stages: str, **outputs: dict[str, Any]) -> dict[str, Any]:
    """Return two blocks without friction in plane stress, their top moved down in the first stage.

    Stress is uniform.
    """
    content = blocks()
    del content["parameters"]["mu"], content["contacts"][0]["friction"]
    content["kinematics"] = "plane_stress"
    content["bodies"]["lower"]["supports"] = {"bottom": "y", "left": "x"}
    content["loads"] = [
        {"body": "upper", "kind": "displacement", "boundary": "top", "y": MOVED},
    ]
    content["stages"] = [{"name": stage, "increments": 1} for stage in stages]
    content["outputs"] = outputs
    return content


def of_face(stage: str) -> dict[str, Any]:
    return {"of": "normal_force", "contact": "face", "stage": stage}


ARC = {"kind": "arc", "centre": [1.0, 2.0], "radius": 10.0, "angles": [210.0, 330.0]}
FORCE = -E * MOVED / (2 * HEIGHT) * SIDE


def test_a_pair_is_there_in_its_active_stages_alone() -> None:
    stages = ("on", "off", "away")
    content = pressed(*stages, **{f"force_{stage}": of_face(stage) for stage in stages})
    content["contacts"][0]["active"] = ["on"]
    found = numbers(content)
    assert [found[f"force_{s}"] for s in stages] == pytest.approx([FORCE, 0, 0], rel=1e-9, abs=1e-9)


def test_a_region_carries_its_share_until_the_end_of_the_stage_that_removes_it() -> None:
    stages = ("on", "cut", "later")
    wanted = {
        f"force_{stage}": {"of": "reaction.y", "part": "plate", "stage": stage} for stage in stages
    }
    content = pressed(*stages, **wanted)
    del content["contacts"], content["bodies"]["upper"], content["loads"]
    content["bodies"]["lower"] |= {
        "supports": {"bottom": "y", "right": "x"}, "regions": {"half": {"x": [0.0, SIDE / 2]}},
    }  # fmt: skip
    content["rigid"] = {"plate": {"y": {"moved": MOVED}}}
    content["links"] = [{"slave": "lower.top", "rigid": "plate", "components": "y"}]
    content["stages"][1]["remove"] = ["lower.half"]
    found = numbers(content)
    whole = E * MOVED / HEIGHT * SIDE
    assert [found[f"force_{s}"] for s in stages] == pytest.approx(np.multiply([1, 0.5, 0.5], whole))


def test_springs_shorten_by_pressure_over_stiffness_and_a_rotation_is_stored_in_radians() -> None:
    wanted = {
        "sunk": {"of": "displacement.y", "take": "maximum", "body": "lower", "stage": "on"},
        "turned": {"of": "motion.rotation", "part": "vane", "stage": "on"},
    }
    content = pressed("on", **wanted)
    del content["contacts"], content["bodies"]["upper"]
    content["bodies"]["lower"]["supports"] = {"left": "x"}
    content["loads"] = [
        {"body": "lower", "kind": "pressure", "boundary": "top", "value": 150.0},
    ]
    content["links"] = [{"slave": "lower.bottom", "components": "y", "stiffness": 5e3}]
    content["rigid"] = {"vane": {"surfaces": {"rim": ARC}, "rotation": {"moved": 30.0}}}
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
