"""Load factors within a stage: listed, or in a CSV file beside the scene."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from solver import ModelError
from studies.errors import SceneError
from studies.scenes.description import Description
from studies.scenes.meshfile import MeshFile
from studies.scenes.scene import FileScene, file_scene
from tests.studies.scenes.conftest import blocks, built

CSV = {"pulse.csv": MeshFile("pulse.csv", b"time, half, factor\n0,0.25,0.5\n2,0.5,1\n10,0.1,0.2\n")}


def pulsed(course: Any, files: dict[str, MeshFile] | None = None) -> FileScene:
    """Return the blocks with a second stage of five increments, before it half of the load."""
    content = blocks()
    content["stages"] += [{"name": "pulse", "increments": 5}]
    content["loads"][0]["amplitude"] = {"pressed": 0.5, "pulse": course}
    return file_scene(Description("blocks.toml", content, files or {}), built=True)


@pytest.mark.solves
def test_the_force_follows_the_course_and_an_increment_ends_at_each_of_its_knots() -> None:
    """Times of a table are from the beginning of the stage to its end, in any unit."""
    scene = pulsed([[0.2, 1.0], [1.0, 0.2]])
    (*_, record) = scene.path(scene.parameters(), [0.0], lambda done: None)
    assert record.status.name == "OK", record.message
    time, force = record.fields["increment_time"][1], record.fields["contact_normal_force"][1][0]
    np.testing.assert_allclose(time, [0, 0.5, 1, 1.2, 1.4, 1.6, 1.8, 2])
    np.testing.assert_allclose(force / 600.0, [0, 0.25, 0.5, 1, 0.8, 0.6, 0.4, 0.2], rtol=1e-9)


@pytest.mark.solves
def test_outputs_take_values_at_the_ends_of_stages() -> None:
    """A block of 4 mm under 150 MPa, of which half is left, and under a plate pushed by 60 N."""
    content = blocks()
    content["stages"] += [{"name": "eased", "increments": 1}]
    content["loads"][0]["amplitude"] = {"pressed": 1.0, "eased": 0.5}
    content["rigid"] = {"plate": {"centre": [2.0, 2.0], "y": {"pushed": -60.0}, "x": {"moved": 0}}}
    content["rigid"]["plate"]["rotation"] = {"moved": 0.0}
    content["links"] = [{"slave": "upper.top", "rigid": "plate", "components": "y"}]
    wanted = {
        "pressed": {"of": "normal_force", "contact": "face", "stage": "pressed"},
        "less": {"of": "normal_force", "contact": "face", "stage": "eased", "minus": "pressed"},
        "shear": {"of": "tangential_force", "contact": "face", "stage": "pressed"},
        "held": {"of": "reaction.y", "part": "lower", "stage": "eased"},
        "moved": {"of": "motion.y", "part": "plate", "stage": "pressed"},
        "turned": {"of": "motion.rotation", "part": "plate", "stage": "eased"},
    }
    content["outputs"] |= wanted
    scene = built(content)
    (*_, record) = scene.path(scene.parameters(), [0.0], lambda done: None)
    assert record.status.name == "OK", record.message
    found = record.scalars
    assert found["pressed"] == pytest.approx(660.0, rel=1e-9)
    assert found["less"] == pytest.approx(-300.0, rel=1e-9)
    assert found["held"] == pytest.approx(360.0, rel=1e-9)
    assert found["turned"] == pytest.approx(0.0, abs=1e-12)
    motion, shear = (record.fields[n][1] for n in ("motion_y", "contact_tangential_force"))
    assert found["moved"] == motion[2, 2] < -1e-4
    assert found["shear"] == shear[0, 2]
    units = {each.name: each.units for each in scene.quantities}
    assert [units[n] for n in ("pressed", "moved", "turned")] == ["N", "mm", "rad"]
    assert "pressed_x" not in units and "least_x" in units


@pytest.mark.parametrize(
    "course", [[[0, 0.5], [2, 1.0], [10, 0.2]], {"file": "pulse.csv"}, [[0.2, 1.0], [1, 0.2]]]
)
def test_a_list_and_a_file_are_the_same_course(course: Any) -> None:
    scene = pulsed(course, CSV)
    parameters = scene.parameters()
    (load,) = scene.model(parameters).bodies[0].loads
    np.testing.assert_allclose(load.amplitude.time, [0, 1, 1.2, 2])
    np.testing.assert_allclose(load.amplitude.value, [0, 0.5, 1, 0.2])
    times = [target.time for target in scene.program(parameters).targets]
    np.testing.assert_allclose(times, [0.5, 1, 1.2, 1.4, 1.6, 1.8, 2])
    assert scene.program(parameters).count == len(times)


@pytest.mark.parametrize(
    ("course", "words"),
    [
        ([[0, 0.3], [1, 1]], "pulse.factor = 0.3: must be 0.5, with which the stage begins"),
        ([[1, 0.3], [0.5, 1]], "pulse.time = .*must increase"),
        ({"file": "other.csv"}, "pulse.file = 'other.csv': there is no such file"),
        ({"file": "pulse.csv", "column": "third"}, "must have the columns time, third"),
        ({"file": "pulse.csv", "column": "half"}, "pulse.factor = 0.25: must be 0.5"),
    ],
)
def test_a_wrong_course_is_refused(course: Any, words: str) -> None:
    with pytest.raises(SceneError, match=words):
        pulsed(course, CSV)


def test_a_course_of_a_repeated_stage_is_the_same_in_each_cycle_and_wrong_once() -> None:
    def repeated(course: Any) -> FileScene:
        content = blocks()
        content["stages"] += [{"name": "pulse", "increments": 2}]
        content["repeat"] = {"stages": ["pulse"], "times": 4}
        content["loads"][0]["amplitude"] = {"pulse": course}
        return file_scene(Description("blocks.toml", content, {}), built=True)

    scene = repeated([[0.5, 1.0], [1.0, 0.2]])
    (load,) = scene.model(scene.parameters()).bodies[0].loads
    np.testing.assert_allclose(load.amplitude.time, [0, 1, 1.5, 2, 2.5, 3, 3.5, 4, 4.5, 5])
    np.testing.assert_allclose(load.amplitude.value, [0, 0, *([1.0, 0.2] * 4)])
    with pytest.raises(SceneError, match=r"has a mistake:\n.*must be 0\.2"):
        repeated([[0.0, 0.0], [0.5, 1.0], [1.0, 0.2]])


def test_courses_and_cycles_that_make_too_many_increments_are_refused_before_they_are_made() -> (
    None
):
    """A course of many times, gone through in many cycles, and steps that are too short."""
    course = [[float(k), 0.5 + 0.4 * (k % 2)] for k in range(1, 500)]
    cycles = {"stages": ["pressed", "pulse"], "times": "$often"}

    def repeated(**changes: Any) -> FileScene:
        content = blocks()
        content["stages"] += [{"name": "pulse", "increments": 5}]
        content["loads"][0]["amplitude"] = {"pressed": 0.5, "pulse": course}
        content["parameters"]["often"] = {"default": 100, "range": [2, 1000]}
        content["repeat"] = cycles
        content |= changes
        return file_scene(Description("blocks.toml", content, {}), built=True)

    scene = repeated()
    assert scene.program(scene.parameters(often=300)).count == 300 * (2 + 499)
    told = r"repeat\.times = 1000: makes more than 200000 increments: take fewer cycles"
    with pytest.raises(ModelError, match=told):
        scene.parameters(often=1000)
    with pytest.raises(SceneError, match="loading = '': makes more than 200000"):
        content = blocks()
        del content["stages"]
        content["outputs"]["least"]["stage"] = "loaded"
        content["loading"] = {"factor": 1e7, "step": 1e-3}
        file_scene(Description("blocks.toml", content, {}), built=True)
