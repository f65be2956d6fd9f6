"""Scenes that the package brings as files."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest

from solver.contact.system import System
from solver.shipped import SCENES
from studies import Store, Study, StudyError
from studies.errors import SceneError
from studies.scenes.description import Description
from studies.scenes.registry import attributes, name_of, scene_named, scene_of
from studies.scenes.scene import FileScene, file_scene, read_scene
from studies.scenes.shipped import SHIPPED
from tests.counted import counted


@pytest.mark.parametrize("name", SHIPPED)
def test_a_scene_of_the_package_is_called_by_its_name(name: str) -> None:
    scene = scene_named(name)
    assert isinstance(scene, FileScene) and name not in SCENES
    assert scene.name == name_of(scene) == name
    assert attributes(scene) == {"scene": name}
    assert scene_of(attributes(scene)) is scene


@pytest.mark.parametrize("name", SHIPPED)
def test_its_bodies_can_be_built(name: str) -> None:
    assert file_scene(Description.read(SHIPPED[name], shipped=True), built=True).name == name


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("rigid_punch", {}),
        ("rigid_punch", {"half_plane_size": 30.0, "growth": 1.4}),
        ("ball", {}),
        ("ball", {"yielding": "ball", "radius": 3.0}),
        ("elastic_punch", {}),
        ("elastic_punch", {"element": "quad9", "punch_groove": 0.3, "friction": 0.1}),
        ("elastic_punch", {"element": "tri3", "half_plane_groove": 0.5, "xi": 0.9}),
        ("shaft_hub", {}),
        ("shaft_hub", {"loading": "pressure", "shaft_groove": 0.3, "xi": 0.5}),
        ("shaft_hub", {"shaft_groove": 0.3, "hub_groove": 0.2, "eta": 2.0}),
    ],
)
def test_the_work_of_a_run_is_told_as_it_is(name: str, changes: dict[str, Any]) -> None:
    scene = scene_named(name)
    parameters = scene.parameters(accuracy="draft", **changes)
    system = System(scene.model(parameters))
    assert scene.effort is not None
    told = scene.effort(parameters, [getattr(parameters, scene.branch)])
    assert told.elements == sum(body.mesh.nelements for body in system.model.bodies)
    assert told.unknowns == system.n_unknowns


@pytest.mark.solves
@pytest.mark.divides
@pytest.mark.parametrize(
    ("name", "changes", "values"),
    [
        ("rigid_punch", {"friction": 0.3}, [10.0, 200.0]),
        ("elastic_punch", {"friction": 0.3, "growth": 2.0}, [10.0, 200.0]),
        ("ball", {"load_ratio": 2.0}, [1, 2]),
    ],
)
def test_increments_are_those_that_are_walked(
    name: str, changes: dict[str, Any], values: list[float]
) -> None:
    scene = scene_named(name)
    parameters = scene.parameters(accuracy="draft", **changes)
    calls: list[float] = []
    (*_, last) = scene.path(parameters, values, calls.append)
    assert scene.effort is not None
    told = scene.effort(parameters, values)
    assert last.status.name == "OK"
    assert last.scalars["cut_increments"] == 0
    assert last.scalars["degrees_of_freedom"] == told.unknowns
    assert len(calls) == told.increments + 1  # the end is told too


def test_a_hundred_paths_on_as_many_lines_share_meshes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A mesh for each path would take ten times as long; a mesh is made of a few others."""
    scene = scene_named("ball")
    paths = [scene.parameters(radius=300.0 + k) for k in range(100)]
    assert scene.effort is not None
    meshes: list[None] = []
    monkeypatch.setattr("skfem.MeshQuad.__post_init__", lambda self: meshes.append(None))
    with counted() as calls:
        for each in paths:
            scene.effort(each, [1, 2])
    assert len(meshes) < 20
    assert calls < 6_000_000


def test_its_runs_follow_the_content_of_its_file(monkeypatch: pytest.MonkeyPatch) -> None:
    study = Study.from_dict({"name": "a", "scene": "rigid_punch", "sweep": {"friction": [0.1]}})
    assert Study.known(study.to_dict()).id == study.id
    text = SHIPPED["rigid_punch"].read_text()
    assert study.problem.source == read_as("rigid_punch", text).source
    changed = text.replace("[0, 10]", "[0, 9]")
    assert changed != text
    assert study.problem.source != read_as("rigid_punch", changed).source


def read_as(name: str, text: str) -> FileScene:
    return file_scene(Description(f"{name}.toml", tomllib.loads(text), {}, shipped=True))


def test_nobody_else_gives_a_scene_its_name(tmp_path: Path) -> None:
    own = tmp_path / "own.toml"
    own.write_bytes(SHIPPED["rigid_punch"].read_bytes())
    with pytest.raises(SceneError, match="name = 'rigid_punch': a built-in scene has this name"):
        read_scene(own)
    with pytest.raises(StudyError, match=r"scene = 'rigid_punsh': .*rigid_punch"):
        scene_named("rigid_punsh")


def test_a_store_keeps_no_copy_of_it(tmp_path: Path) -> None:
    scene = scene_named("rigid_punch")
    assert isinstance(scene, FileScene)
    store = Store(tmp_path)
    store.save_scene(scene)
    assert store.scene(scene.id) is None
