"""Scene files as scenes: swept, stored, read back, the same on every way."""

from __future__ import annotations

import json
import pickle
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
import xarray as xr
from fastapi.testclient import TestClient
from skfem import ElementQuad1

import studies.scenes.registry as registry
from residua.cli import main
from service.app import create_app
from service.settings import Settings
from solver import SCENES, ModelError, Record, Status, System
from solver.errors import LimitLoad
from solver.mesh.elements import ELEMENTS, ElementType
from solver.results.mesh_fields import write_vtu
from solver.scenes.punch import PUNCH, PunchParameters
from studies import Store, Study, StudyError, open_study, run_study, scene_schema
from studies.errors import SceneError
from studies.scenes.description import Description
from studies.scenes.registry import scene_named, scene_of
from studies.scenes.scene import FileScene, file_scene, read_scene
from studies.scenes.shipped import SHIPPED
from studies.views.plots.picture import picture
from studies.views.tables import runs_table
from tests.studies.scenes.conftest import BLOCKS, blocks, built

pytestmark = pytest.mark.usefixtures("one_worker")

ROOT = Path(__file__).parents[3]
FILES = sorted((ROOT / "data/scenes").glob("*.toml"))


def run(scene: FileScene, **values: Any) -> Record:
    """Return the record of a run."""
    parameters = scene.parameters(**values)
    (record,) = scene.path(parameters, [values.get(scene.branch)], lambda share: None)
    return record


@pytest.mark.solves
def test_a_block_under_pressure_has_the_stress_of_the_pressure(scene: FileScene) -> None:
    record = run(scene, mu=0.0)
    assert record.status is Status.OK, record.message
    dims, stress = record.fields["line_stress"]
    assert dims == ("line", "stage", "component", "fraction")
    # free to grow sideways but at the bottom: in the middle of the upper block all is uniaxial
    assert record.scalars["least"] < -150.0
    _, pressure = record.fields["contact_pressure"]
    assert pressure[0, 0].mean() == pytest.approx(150.0, rel=0.01)
    _, force = record.fields["contact_normal_force"]
    assert force[0] == pytest.approx([0.0, 300.0, 600.0], abs=1e-6)
    _, reaction = record.fields["reaction_y"]
    assert reaction[1] == pytest.approx([0.0, 300.0, 600.0], abs=1e-6)
    assert record.fields["increment_time"][1] == pytest.approx([0.0, 0.5, 1.0])
    assert stress.shape == (1, 1, 4, 11)


@pytest.mark.parametrize("own", [{}, {"limit_load": "press less"}])
def test_a_run_that_fails_says_what_to_do_also_without_advice_in_the_file(own: Any) -> None:
    scene = built({**blocks(), "advice": own})
    said = scene.remedy(scene.parameters(), LimitLoad("no equilibrium"), Status.LIMIT_LOAD)
    assert said == own.get("limit_load", "lower the load")
    assert scene.remedy(scene.parameters(), None, Status.AUDIT_FAILED) == "use smaller elements"


@pytest.mark.solves
def test_a_file_declares_singular_points_and_what_is_allowed() -> None:
    """Expressions and all; a study of the scene allows what its file does."""
    tables = blocks()
    assert built(tables).allow == ()
    tables["allow"] = ["large_strain"]
    tables["singular"] = [{"at": [0.0, "$wide"], "radius": "$side/2"}]
    scene = built(tables)
    assert scene.allow == ("large_strain",)
    assert Study.from_dict({"name": "own", "sweep": {"mu": [0.1]}}, scene=scene).allow
    (point,) = scene.model(scene.parameters(wide=8.0)).singular
    assert (point.at, point.radius) == ((0.0, 8.0), 1.0)
    record = run(scene)
    assert record.fields["singular_radius"][1] == pytest.approx([0.5])


def test_parameters_check_themselves(scene: FileScene) -> None:
    with pytest.raises(ModelError, match="mu = -1"):
        scene.parameters(mu=-1.0)
    with pytest.raises(ModelError, match="rule"):
        scene.parameters(rule="soft")
    tables = blocks()
    tables["contacts"][0]["friction"] = "$mu - 0.1"
    with pytest.raises(ModelError, match=r"contacts\[0\]\.friction = -0\.1"):
        built(tables).parameters(mu=0.0)


def test_a_swept_value_that_cannot_be_is_refused_before_it_is_computed() -> None:
    tables = blocks()
    tables["parameters"]["which"] = {"default": "upper", "choices": ["upper", "nobody"]}
    tables["loads"][0]["body"] = "$which"
    scene = built(tables)
    with pytest.raises(ModelError, match=r"loads\[0\].body.*must be one of"):
        scene.parameters(which="nobody")


def test_a_map_is_fine_where_it_is_asked_to_be() -> None:
    tables = blocks()
    along = {"start": -20.0, "stop": 30.0, "num": 120, "near": 1.0, "size": 0.02}
    tables["results"]["map"] = {"x": along, "y": along | {"size": 5.0}}
    scene = built(tables)
    view = scene.view(scene.parameters())
    assert (view.x[0], view.x[-1], len(view.x)) == (-20.0, 30.0, 120)
    steps = np.diff(view.x)
    middles = (view.x[1:] + view.x[:-1]) / 2
    assert np.interp(1.0, middles, steps) == pytest.approx(0.02, rel=0.01)
    assert np.argmin(steps) == np.abs(middles - 1.0).argmin()
    ratios = steps[1:] / steps[:-1]
    assert ratios.max() < 1.1
    assert ratios[-10:] == pytest.approx(ratios[-1], rel=1e-4)
    assert np.diff(view.y) == pytest.approx(50 / 119)  # closer than asked for already


def test_the_schema_tells_range_unit_and_meaning(scene: FileScene) -> None:
    known = scene_schema(scene)["properties"]
    assert known["wide"]["unit"] == "mm"
    assert (known["mu"]["minimum"], known["mu"]["maximum"]) == (0.0, 1.0)
    assert known["rule"]["enum"] == ["none", "isotropic"]
    assert known["mu"]["description"] == "friction"


@pytest.mark.processes
def test_a_scene_and_its_parameters_reach_other_processes(scene: FileScene) -> None:
    parameters = scene.parameters(mu=0.3)
    same, its = pickle.loads(pickle.dumps((scene, parameters)))
    assert same is scene and its == parameters
    told = {"data": pickle.dumps((scene, parameters)).hex()}
    code = (
        "import json, pickle, sys; told = json.load(sys.stdin)['data'];"
        "scene, p = pickle.loads(bytes.fromhex(told));"
        "print(scene.id, p.mu, isinstance(p, scene.parameters))"
    )
    command = [sys.executable, "-c", code]
    answer = subprocess.run(
        command, input=json.dumps(told), capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert answer.stdout.split() == [scene.id, "0.3", "True"]


@pytest.mark.parametrize(
    ("old", "new", "same"),
    [
        ("value = 150.0", "value = 151.0", False),
        ('default = 0.2', "default = 0.3", False),
        ('summary =', 'allow = ["large_strain"]\nsummary =', False),
        ('description = "friction"', 'description = "the friction"', True),
        ('summary = "a block', 'summary = "one block', True),
        ("increments = 2", "increments = 2  # few", True),
        ("value = 150.0", "value = 1.5e2", True),
    ],
)  # fmt: skip
def test_the_id_is_the_content(tmp_path: Path, old: str, new: str, same: bool) -> None:
    assert BLOCKS.count(old) >= 1
    paths = [tmp_path / "a.toml", tmp_path / "b.toml"]
    for path, text in zip(paths, (BLOCKS, BLOCKS.replace(old, new, 1)), strict=True):
        path.write_text(text)
    first, second = (Description.read(path).digest for path in paths)
    assert (first == second) is same


def test_a_name_is_no_word_about_it() -> None:
    """A boundary, a derived number or a stage may be called description, and counts in the id."""
    tables = blocks()
    tables["derived"]["description"] = 2.0
    tables["stages"][0]["increments"] = "$description"
    with pytest.raises(SceneError, match=r"stages\[0\].increments = 2.0"):
        built(tables)
    tables["derived"]["description"] = 2
    first = built(tables)
    tables["derived"]["description"] = 3
    assert built(tables).id != first.id
    tables["outputs"]["least"]["description"] = "costs $5, of $nothing"
    second = built(tables)
    assert second.id != first.id
    tables["outputs"]["least"]["description"] = tables["summary"] = "in other words"
    third = built(tables)
    assert (third.id, third.summary) == (second.id, "in other words")


def test_the_mesh_counts_in_the_id(tmp_path: Path) -> None:
    pin = read_scene(ROOT / "data/scenes/pin.toml")
    (tmp_path / "pin.toml").write_bytes((ROOT / "data/scenes/pin.toml").read_bytes())
    mesh = (ROOT / "data/scenes/pin.msh").read_bytes()
    (tmp_path / "pin.msh").write_bytes(mesh)
    assert Description.read(tmp_path / "pin.toml").digest == pin.id
    (tmp_path / "pin.msh").write_bytes(mesh + b"\n")
    assert Description.read(tmp_path / "pin.toml").digest != pin.id


def test_a_table_of_values_counts_in_the_id_and_is_kept_with_its_scene(tmp_path: Path) -> None:
    for name in ("peened.toml", "peened.csv"):
        (tmp_path / name).write_bytes((ROOT / "data/scenes" / name).read_bytes())
    scene = read_scene(tmp_path / "peened.toml")
    store = Store(tmp_path / "out")
    store.keep_scene(scene.id, scene.description)
    kept = store.scene(scene.id)
    assert kept is not None
    loads = [kept.model(kept.parameters(intensity=i)).bodies[0].loads for i in (1.0, 2.0)]
    depth = np.array([[2.0], [1.0]])
    once, twice = (load[0].initial_stress(depth)[0, 0] for load in loads)
    assert once == pytest.approx(-262.5)
    assert twice == pytest.approx(2 * once)
    with (tmp_path / "peened.csv").open("a") as file:
        file.write("1.5,0\n")
    assert Description.read(tmp_path / "peened.toml").digest != scene.id


@pytest.mark.parametrize(
    ("given", "field", "told"),
    [
        ({"file": "none.csv"}, "loads[0].value.file", "there is no such file beside the scene"),
        ({"file": "p.csv", "column": "q"}, "loads[0].value.file", "must have the columns"),
        ({"file": "short.csv"}, "pressure.top", "must be inside the table: x from 0 to 2 mm"),
        ({"file": "../p.csv"}, "loads[0].value.file", "must"),
        ({"file": "p.csv", "colum": "q"}, "loads[0].value.colum", "did you mean column?"),
    ],
)
def test_a_wrong_table_of_values_is_told_once(
    tmp_path: Path, given: dict[str, str], field: str, told: str
) -> None:
    (tmp_path / "p.csv").write_text("x,value\n-10,1\n10,2\n")
    (tmp_path / "short.csv").write_text("x,value\n0,1\n2,2\n")
    entry = ", ".join(f'{key} = "{each}"' for key, each in given.items())
    text = BLOCKS.replace("value = 150.0", f"value = {{ {entry} }}")
    assert text != BLOCKS
    (tmp_path / "blocks.toml").write_text(text)
    with pytest.raises(SceneError) as caught:
        read_scene(tmp_path / "blocks.toml")
    ((mistake),) = caught.value.mistakes
    assert mistake.field == field
    assert told in mistake.allowed


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Study, Store, xr.Dataset]]:
    """Sweep the blocks from a study file."""
    folder = tmp_path_factory.mktemp("blocks")
    (folder / "blocks.toml").write_text(BLOCKS)
    (folder / "study.toml").write_text(
        'name = "blocks"\nscene = "blocks.toml"\n'
        "[sweep]\nmu = [0.0, 0.5]\nwide = {start = 2.0, stop = 4.0, num = 2}\n"
    )
    study, store = Study.from_toml(folder / "study.toml"), Store(folder / "out")
    assert run_study(study, store, workers=1).ok
    with open_study(folder / "out") as dataset:
        yield study, store, dataset


@pytest.mark.processes
def test_a_study_sweeps_a_file(swept: tuple[Study, Store, xr.Dataset]) -> None:
    study, _, dataset = swept
    assert dict(dataset.sizes) | {"mu": 2, "wide": 2, "fraction": 11} == dict(dataset.sizes)
    assert dataset["wide"].attrs["units"] == "mm"
    # lengths differ, and the index is one: a fraction of the line
    assert dataset["line_x"].sel(mu=0.0, wide=2.0, fraction=0.5).item() == pytest.approx(1.0)
    assert dataset["line_x"].sel(mu=0.0, wide=4.0, fraction=0.5).item() == pytest.approx(2.0)
    assert (dataset["least"] < -150.0).all()
    assert dataset["least"].attrs["units"] == "MPa"
    label = "minimum of stress yy of body lower, stage pressed"
    assert dataset["least"].attrs["long_name"] == label
    assert dataset["least_x"].attrs["units"] == "mm"
    assert study.scene == study.problem.id and study.problem.name == "blocks"


@pytest.mark.processes
def test_a_data_set_knows_its_scene_without_the_file(
    swept: tuple[Study, Store, xr.Dataset],
) -> None:
    study, _, dataset = swept
    assert dataset.attrs["scene"] == "blocks"
    assert dataset.attrs["scene_id"] == study.scene
    known = scene_of(dataset.attrs)
    assert known.parameters().mu == 0.2
    assert scene_schema(known)["properties"]["wide"]["unit"] == "mm"


@pytest.mark.processes
def test_what_a_file_asks_for_is_in_the_table_and_in_pictures(
    swept: tuple[Study, Store, xr.Dataset],
) -> None:
    _, _, dataset = swept
    headings = set(" ".join(runs_table(dataset).splitlines()[:4]).split())
    assert "least" in headings
    assert not {"x", "y"} & headings, "places are in the data set"
    lines = picture(dataset, "line_stress", "yy", selection={"wide": 2.0}, over="mu")
    drawn = [each for each in lines.axes[0].lines if len(each.get_xdata()) > 2]
    assert len(drawn) == 2 * dataset.sizes["stage"] * dataset.sizes["line"]
    x, y = drawn[0].get_data()
    expected = dataset["line_stress"].sel(mu=0.0, wide=2.0, component="yy").isel(stage=0, line=0)
    np.testing.assert_allclose(y, expected.squeeze())
    assert (x[0], x[-1]) == (0.0, 2.0)  # over the length, not its fraction
    assert lines.axes[0].get_xlabel().endswith("[mm]")
    lengths = picture(dataset, "contact_pressure", selection={"mu": 0.0}, over="wide").axes[0]
    drawn = [each for each in lengths.lines if len(each.get_xdata()) > 2]
    assert sorted({each.get_xdata()[-1] for each in drawn}) == [2.0, 4.0], "each its own length"
    course = picture(dataset, "contact_normal_force").axes[0]
    assert course.get_xlabel() == "number of the increment; 0 is the state before loading"
    with pytest.raises(StudyError, match="lies over fraction, no length: leave it out"):
        picture(dataset, "line_stress", zoom=1.0)


@pytest.mark.processes
def test_a_store_keeps_the_scene_and_gives_it_by_its_id(
    swept: tuple[Study, Store, xr.Dataset],
) -> None:
    study, store, _ = swept
    again = Study.known(study.to_dict(), store.scene)
    assert again.id == study.id
    assert list(again.run_ids()) == list(study.run_ids())
    with pytest.raises(StudyError, match="must be one of"):
        Study.known(study.to_dict())


@pytest.mark.processes
def test_a_scene_that_was_changed_in_the_store_is_refused(
    swept: tuple[Study, Store, xr.Dataset], tmp_path: Path
) -> None:
    study, _, _ = swept
    store = Store(tmp_path)
    store.save_scene(study.problem)
    path = tmp_path / "scenes" / study.scene / "scene.json"
    for wrong in (path.read_text().replace("150.0", "15.0"), "{"):
        path.write_text(wrong)
        assert store.scene(study.scene) is None
        assert not path.exists(), "it is set aside"
        store.save_scene(study.problem)
        again = store.scene(study.scene)
        assert again is not None and again.id == study.scene
    assert len(list((tmp_path / "unreadable").iterdir())) == 2
    assert store.scene("0" * 32) is None
    assert store.scene("../" + study.scene) is None


@pytest.mark.processes
def test_python_takes_a_scene_of_its_own(tmp_path: Path) -> None:
    scene = built(blocks())
    outcome = run_study({"name": "one", "sweep": {"mu": [0.1]}}, Store(tmp_path), scene=scene)
    assert outcome.ok
    named = Study.from_dict({"name": "p", "parameters": {"accuracy": "draft"}}, scene=PUNCH)
    assert isinstance(next(named.cases()).parameters, PunchParameters)


def test_the_same_study_has_the_same_ids_on_every_way(tmp_path: Path) -> None:
    (tmp_path / "blocks.toml").write_text(BLOCKS)
    (tmp_path / "study.toml").write_text('name="s"\nscene="blocks.toml"\n[sweep]\nmu=[0.1]\n')
    from_file = Study.from_toml(tmp_path / "study.toml")
    scene = file_scene(Description("other.toml", json.loads(json.dumps(blocks())), {}))
    in_python = Study.from_dict({"name": "s", "sweep": {"mu": [0.1]}}, scene=scene)
    assert from_file.id == in_python.id
    assert list(from_file.run_ids()) == list(in_python.run_ids())


def test_a_study_names_a_file_beside_it_and_nothing_else(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match="must be one of"):
        Study.from_dict({"name": "s", "scene": str(ROOT / "data/scenes/pin.toml")})
    (tmp_path / "study.toml").write_text('name = "s"\nscene = "lost.toml"\n')
    with pytest.raises(StudyError, match=r"lost\.toml.*must be a file to read"):
        Study.from_toml(tmp_path / "study.toml")


def test_no_scene_of_a_file_takes_a_name_that_is_built_in() -> None:
    tables = blocks() | {"name": "punch"}
    with pytest.raises(SceneError, match="a built-in scene"):
        built(tables)


class Entry:
    """An installed package's scene."""

    def __init__(self, name: str, given: object) -> None:
        self.name, self.value, self._given = name, f"package:{name}", given

    def load(self) -> object:
        return self._given


def test_installed_packages_bring_scenes(monkeypatch: pytest.MonkeyPatch) -> None:
    entries = [
        Entry("lug", ROOT / "data/scenes/pin.toml"),
        Entry("own", PUNCH),
        Entry("wrong", 3),
    ]
    monkeypatch.setattr(registry, "entry_points", lambda group: entries)
    assert registry.known_names() == [*SCENES, *SHIPPED, "lug", "own", "wrong"]
    lug = scene_named("lug")
    assert isinstance(lug, FileScene) and lug.name == "pin"
    assert scene_named("own") is PUNCH
    with pytest.raises(StudyError, match=r"must be a Scene or the path .* package:wrong"):
        scene_named("wrong")


@pytest.mark.solves
def test_shared_loading_needs_a_factor_that_stands_alone() -> None:
    tables = blocks()
    del tables["stages"]
    tables["parameters"]["load_ratio"] = {"default": 0.5, "range": [0.1, 2.0]}
    tables["loading"] = {"factor": "$load_ratio", "step": 0.25}
    tables["outputs"]["least"]["stage"] = "loaded"
    shared = built(tables)
    assert shared.branch == "load_ratio"
    both = list(shared.path(shared.parameters(), [0.5, 1.0], lambda share: None))
    alone = [run(shared, load_ratio=load) for load in (0.5, 1.0)]
    for one, other in zip(both, alone, strict=True):
        assert one.parameters == other.parameters
        np.testing.assert_array_equal(one.fields["line_stress"][1], other.fields["line_stress"][1])
    tables["loads"][0]["value"] = "100*$load_ratio"
    assert built(tables).branch == ""


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_every_scene_file_of_the_data_has_no_mistake(path: Path) -> None:
    scene = read_scene(path)
    assert scene.name == path.stem
    assert scene.summary
    assert all(each.description for each in scene.description.parameters.values())


def test_the_files_of_the_data_are_there() -> None:
    assert {"pin", "fretting"} <= {path.stem for path in FILES}


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_the_work_of_a_run_is_told_from_its_meshes(path: Path) -> None:
    scene = read_scene(path)
    parameters = scene.parameters()
    assert scene.effort is not None
    effort = scene.effort(parameters, [getattr(parameters, scene.branch, None)])
    system = System(scene.model(parameters))
    assert effort.unknowns == system.n_unknowns
    assert effort.elements == sum(body.mesh.nelements for body in system.model.bodies)
    assert effort.most_increments == scene.program(parameters).count
    assert effort.increments == effort.most_increments or path.stem == "bree"  # ends by itself
    yields = not all(body.material.elastic for body in system.model.bodies)
    assert (effort.divided > 0) == yields


def test_a_temperature_may_have_no_value_outside_its_body() -> None:
    tables = blocks()
    for body in tables["bodies"].values():
        body["shape"]["x"] = [1.0, 5.0]
    heat = {"body": "lower", "kind": "temperature", "rise": "10*log(x)", "expansion": 1e-5}
    tables["loads"].append(heat | {"yield_drop": 1e-5})
    scene = built(tables)
    assert scene.effort is not None
    effort = scene.effort(scene.parameters(), [None])
    assert effort.unknowns == System(scene.model(scene.parameters())).n_unknowns


def test_an_elastic_body_under_a_load_that_moves_is_not_condensed() -> None:
    tables = blocks()
    tables["materials"]["steel"] = {"youngs_modulus": 2e5, "poisson_ratio": 0.3}
    del tables["parameters"]["rule"]
    moving = {"kind": "travelling_pressure", "peak": 9.0, "half_width": 1.0}
    tables["loads"][0] = {"body": "upper", "boundary": "top", "position": {"pressed": 2.0}} | moving
    scene = built(tables)
    assert scene.effort is not None
    effort = scene.effort(scene.parameters(), [None])
    assert effort.unknowns == System(scene.model(scene.parameters())).n_unknowns
    (load,) = scene.model(scene.parameters()).bodies[0].loads
    assert load.now(0.5) == (0.5, 1.0, 0.0)


@pytest.mark.processes
def test_numbers_in_another_unit_reach_the_user(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "blocks.toml").write_text(
        BLOCKS.replace("youngs_modulus = 2e5", "youngs_modulus = 200")
    )
    allowed = 'allow = ["large_strain"]'  # so soft a body strains much
    (tmp_path / "study.toml").write_text(f'name = "soft"\nscene = "blocks.toml"\n{allowed}\n')
    out = tmp_path / "out"
    assert main(["run", str(tmp_path / "study.toml"), "--out", str(out), "--workers", "1"]) == 0
    told = "upper.youngs_modulus = 200: 200000 MPa was probably meant, 200 GPa"
    printed = capsys.readouterr().out
    assert "warning: " in printed and told in printed
    assert "1 with a warning" in printed
    with TestClient(create_app(Settings(data=out)), base_url="http://localhost") as client:
        (found,) = client.get("/runs").json()["items"]
    assert told in found["message"]


@pytest.mark.solves
def test_a_pair_that_never_touches_is_told(scene: FileScene) -> None:
    tables = blocks()
    tables["bodies"]["upper"]["supports"] = {"left": "x"}
    tables["contacts"][0]["gap"] = 0.2
    tables["loads"] = [
        {"body": "upper", "kind": "displacement", "boundary": "top", "x": 0.0, "y": -0.1}
    ]
    record = run(built(tables))
    assert record.status is Status.OK, record.message
    assert record.message.startswith("upper.bottom and lower.top do not touch at the end of any")
    assert "touch" not in run(scene).message


@pytest.mark.solves
def test_a_map_that_a_swept_value_takes_off_the_bodies_ends_the_run() -> None:
    tables = blocks()
    along = {"start": "$at", "stop": "$at + 1", "num": 5}
    tables["parameters"]["at"] = {"default": 1.0, "unit": "mm", "description": "where one looks"}
    tables["results"]["map"] = {"x": along, "y": {"start": -1.0, "stop": 0.0, "num": 5}}
    scene = built(tables)
    assert run(scene).status is Status.OK
    with pytest.raises(ModelError, match=r"map = \[50\.0, 51\.0, -1\.0, 0\.0\]: must meet a body"):
        run(scene, at=50.0)


@pytest.mark.solves
def test_press_then_slide_by_two_displacements_of_one_boundary() -> None:
    """They add up, and what is stored is compared with their sum."""
    content = blocks()
    del content["bodies"]["upper"]["supports"]
    content["loads"] = [
        {"body": "upper", "kind": "displacement", "boundary": "top", "x": 0.0, "y": -0.002,
         "amplitude": {"pressed": 1, "slid": 1}},
        {"body": "upper", "kind": "displacement", "boundary": "top", "x": 0.004, "y": -0.001,
         "amplitude": {"pressed": 0, "slid": 1}},
    ]  # fmt: skip
    content["stages"] = [{"name": "pressed", "increments": 2}, {"name": "slid", "increments": 2}]
    content["outputs"] = {
        f"top_{axis}": {"of": f"displacement.{axis}", "take": take, "body": "upper",
                        "stage": "slid"}
        for axis, take in (("x", "maximum"), ("y", "minimum"))
    }  # fmt: skip
    record = run(built(content))
    assert record.status is Status.OK, record.message
    assert record.scalars["top_x"] == pytest.approx(0.004, rel=0.05)
    assert record.scalars["top_y"] == pytest.approx(-0.003, rel=1e-9)


@pytest.mark.solves
def test_gaps_that_are_rounding_once_the_load_is_off_are_as_stored(scene: FileScene) -> None:
    """No load is left between two cycles: gaps and slips are rounding, and so is their scale."""
    tables = blocks()
    tables["contacts"][0]["friction"] = "0*$mu"
    tables["loads"][0]["amplitude"] = {"pressed": 1.0, "off": 0.0}
    tables["stages"] += [
        {"name": "off", "increments": 2},
        {"name": "released", "increments": 2, "release": True},
    ]
    record = run(built(tables))
    assert record.status is Status.OK, record.message


@pytest.mark.solves
def test_a_run_that_stops_is_not_told_that_its_bodies_never_touch() -> None:
    """It stops at its limit load, pressed, before the first stage has ended."""
    tables = blocks()
    tables["loads"][0]["value"] = 900.0
    tables["stages"][0]["increments"] = 4
    record = run(built(tables))
    assert record.status is Status.LIMIT_LOAD, record.message
    assert "no equilibrium" in record.message
    assert "touch" not in record.message


@pytest.mark.solves
@pytest.mark.parametrize("share", [0.5, 1.5])
def test_a_block_pushed_along_by_more_than_friction_bears_is_told_so(share: float) -> None:
    tables = blocks()
    tables["bodies"]["upper"]["supports"] = {}
    tables["loads"] = [
        {"body": "upper", "kind": "traction", "boundary": "top", "y": -50.0, "x": share * 0.2 * 50}
    ]
    record = run(built(tables))
    if share < 1:
        assert record.status is Status.OK, record.message
    else:
        assert record.status is Status.NOT_CONVERGED
        assert record.message.endswith("with less tangential force than friction carries")


@pytest.mark.solves
def test_pressure_at_the_end_of_coarse_arcs_is_as_stored() -> None:
    """Three elements on a quarter: what of the last faces the partner is known to some 1e-6."""
    steel = {"youngs_modulus": 7e4, "poisson_ratio": 0.3}
    rings = {
        name: {"material": "steel", "element": element, "supports": {"start": "y", "end": "x"},
               "shape": {"kind": "sector", "radii": radii, "angles": [0, 90], "size": size}}
        for name, element, radii, size in (
            ("inner", "quad9", [23.0, 33.5], 5.26), ("outer", "quad8", [33.5, 67.7], 17.1))
    }  # fmt: skip
    tables = {
        "name": "fit", "materials": {"steel": steel}, "bodies": rings,
        "contacts": [{"name": "fit", "slave": "outer.inner", "master": "inner.outer",
                      "interference": 0.0335}],
        "loads": [{"body": "inner", "kind": "temperature", "rise": 80.0, "expansion": 1.2e-5}],
        "stages": [{"name": "fitted", "increments": 3}],
    }  # fmt: skip
    record = run(built(tables))
    assert record.status is Status.OK, record.message


@pytest.mark.solves
def test_an_element_of_ones_own_is_named_and_written_like_any_other(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    plain = ElementType(element=ElementQuad1(), order=3, full_order=3)
    monkeypatch.setitem(ELEMENTS, "quad4_plain", plain)
    records = {}
    for element in ("quad4", "quad4_plain"):
        tables = blocks()
        for body in tables["bodies"].values():
            body["element"] = element
        records[element] = run(built(tables))
        assert records[element].status is Status.OK, records[element].message
    mesh = records["quad4_plain"].mesh
    assert mesh is not None
    write_vtu(mesh(), tmp_path)
    assert [cells.type for cells in meshio.read(tmp_path / "0-pressed.vtu").cells] == ["quad"]
    assert np.shape(mesh().faces[0]) == np.shape(records["quad4"].mesh().faces[0])
    differ = records["quad4_plain"].scalars["least"] - records["quad4"].scalars["least"]
    assert differ != 0.0, "dilatation is averaged in one of them"


def test_a_shape_is_meshed_with_the_cells_of_the_element(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever its name."""
    monkeypatch.setitem(ELEMENTS, "six", replace(ELEMENTS["tri6"], order=4))
    tables = blocks()
    tables["bodies"]["upper"]["element"] = "six"
    built(tables)
