"""A study as an RO-Crate: what it says, that it is complete, and that it is computed again."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import h5py
import meshio
import numpy as np
import pytest
import xarray as xr

from residua.cli import main
from solver.version import __version__
from studies import Store, Study, open_study, run_study
from studies.definition import expansion, identity
from studies.errors import StudyError
from studies.storage import seal
from studies.views import crate as crate_module
from studies.views.crate import METADATA, export
from tests.studies.conftest import fake_study
from tests.studies.fakes import NUMBERS

SCENE = """# A block that is pulled, and released.
name = "pull"
summary = "a block that is pulled and released"
kinematics = "plane_stress"

[parameters]
pull = { default = 0.5, range = [0.01, 3.0], description = "traction over yield stress" }
strength = { default = 300.0, range = [1.0, 1e4], unit = "MPa", description = "yield stress" }

[materials.steel]
youngs_modulus = 2e5
poisson_ratio = 0.3
yield_stress = "$strength"
hardening = "none"

[bodies.block]
material = "steel"
mesh = "block.inp"
supports = { left = "x", below = "y" }

[[loads]]
body = "block"
kind = "traction"
boundary = "right"
x = "$strength"

[loading]
factor = "$pull"
step = 0.5

[outputs.stretch]
of = "displacement.x"
take = "maximum"
body = "block"
stage = "loaded"
"""
STUDY = """# The pull that makes the block longer by .007 mm, if it can be reached.
name = "pulled"
scene = "pull.toml"
licence = "CC-BY-4.0"
doi = "10.5281/zenodo.1"

[sweep]
strength = [300.0, 500.0]

[goal]
parameter = "pull"
of = "stretch"
at = 0.007
between = [0.1, 2.0]
within = 0.1
"""
TIME = r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d{3})?\+\d\d:\d\d"
"""Times as Process Run Crate 0.5 has them."""
PROFILES = "https://w3id.org/ro/wfrun/process/0.5", "https://w3id.org/ro/wfrun/workflow/0.5"


def computed(folder: Path) -> Path:
    """Compute a goal on a scene with a mesh, some runs of which fail; return its crate."""
    corners = np.array([[0, 0, 0], [4, 0, 0], [4, 2, 0], [0, 2, 0]], dtype=float)
    sets = {"left": np.array([0, 3]), "right": np.array([1, 2]), "below": np.array([0, 1])}
    mesh = meshio.Mesh(corners, [("quad", np.array([[0, 1, 2, 3]]))], point_sets=sets)
    mesh.write(folder / "block.inp")
    (folder / "pull.toml").write_text(SCENE)
    (folder / "study.toml").write_text(STUDY)
    study = Study.from_toml(folder / "study.toml")
    run_study(study, Store(folder / "out"), workers=0)
    export(folder / "out", folder / "crate")
    return folder / "crate"


@pytest.fixture(scope="module")
def crate(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A crate in another folder than that in which it was made, which is gone."""
    made, there = tmp_path_factory.mktemp("made"), tmp_path_factory.mktemp("there") / "moved"
    computed(made).rename(there)
    made.rename(made.with_name("gone"))
    return there


def entities(crate: Path) -> dict[str, dict[str, Any]]:
    graph = json.loads((crate / METADATA).read_text())["@graph"]
    found = {each["@id"]: each for each in graph}
    assert len(found) == len(graph), "each entity is described once"
    return found


def references(value: Any) -> Iterator[str]:
    """Yield the entities to which a value refers."""
    for each in value if isinstance(value, list) else [value]:
        if isinstance(each, dict):
            yield each["@id"]


def actions(crate: Path) -> list[dict[str, Any]]:
    return [each for each in entities(crate).values() if each["@id"].startswith("#run-")]


@pytest.mark.solves
def test_every_file_is_described_with_its_digest_and_every_reference_exists(crate: Path) -> None:
    known = entities(crate)
    files = {
        path.relative_to(crate).as_posix() for path in crate.rglob("*") if path.is_file()
    } - {METADATA}  # fmt: skip
    described = {unquote(own): each for own, each in known.items() if "File" in each["@type"]}
    assert described.keys() == files == {*map(unquote, references(known["./"]["hasPart"]))}
    for name, each in described.items():
        content = (crate / name).read_bytes()
        assert each["sha256"] == sha256(content).hexdigest()
        assert each["contentSize"] == str(len(content))
    for each in known.values():
        for value in each.values():
            outside = {own for own in references(value) if own.startswith("http")}
            assert {*references(value)} - outside <= known.keys()


@pytest.mark.solves
def test_the_crate_says_which_profiles_it_follows(crate: Path) -> None:
    known = entities(crate)
    root, descriptor = known["./"], known[METADATA]
    assert {*PROFILES} <= {*references(root["conformsTo"])}
    assert "https://w3id.org/ro/crate/1.1" in {*references(descriptor["conformsTo"])}
    assert [*references(descriptor["about"])] == ["./"]
    (main_entity,) = references(root["mainEntity"])
    assert main_entity == "study.toml"
    assert "ComputationalWorkflow" in known[main_entity]["@type"]
    assert root["identifier"] == "https://doi.org/10.5281/zenodo.1"
    assert [*references(root["license"])] == ["https://spdx.org/licenses/CC-BY-4.0"]
    assert known["#residua"]["softwareVersion"] == __version__
    runs = {each["@id"] for each in actions(crate)}
    assert {"#residua", *runs} <= {*references(root["mentions"])}


@pytest.mark.solves
def test_each_run_is_an_action_with_its_parameters_and_its_error(crate: Path) -> None:
    known, runs = entities(crate), actions(crate)
    assert {each["@id"][5:] for each in runs} == {path.stem for path in crate.glob("runs/*.nc")}
    for each in runs:
        run_id = each["@id"][5:]
        with h5py.File(crate / f"runs/{run_id}.nc") as file:
            status, given = file["status"].asstr()[...].item(), json.loads(file.attrs["parameters"])
        failed = status == "limit_load"
        state = "Failed" if failed else "Completed"
        assert each["actionStatus"] == f"http://schema.org/{state}ActionStatus"
        assert each.get("error", "").startswith("limit_load: ") == failed
        assert each["startTime"] <= each["endTime"]
        assert all(re.fullmatch(TIME, each[name]) for name in ("startTime", "endTime"))
        assert [*references(each["instrument"])] == ["study.toml"]
        assert [*references(each["result"])] == [f"runs/{run_id}.nc"]
        objects = [known[own] for own in references(each["object"])]
        names = {one["name"]: one["value"] for one in objects if one["@type"] == "PropertyValue"}
        assert names == {name: given[name] for name in ("pull", "strength")}
        assert any(one["@id"].endswith("/block.inp") for one in objects)
        used = [known[own] for own in references(each["resourceUsage"])]
        assert [one["propertyID"] for one in used] == ["machine", "peak-memory"]
    assert {each["actionStatus"][18:] for each in runs} == {
        "CompletedActionStatus", "FailedActionStatus"
    }  # fmt: skip


@pytest.mark.solves
def test_texts_are_those_of_the_author_and_the_mesh_has_its_digest(crate: Path) -> None:
    assert (crate / "study.toml").read_text() == STUDY
    assert (crate / "pull.toml").read_text() == SCENE
    with h5py.File(next(crate.glob("studies/*/dataset.nc"))) as file:
        digests = json.loads(file.attrs["mesh_sha256"])
    (mesh,) = crate.glob("scenes/*/block.inp")
    assert digests == {"block.inp": sha256(mesh.read_bytes()).hexdigest()}


@pytest.mark.solves
def test_a_crate_is_computed_again_to_the_same_ids_and_bits(
    crate: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status = main(["run", str(crate), "--out", str(tmp_path / "again"), "--workers", "0"])
    before, after = ({p.name: p for p in d.glob("runs/*.nc")} for d in (crate, tmp_path / "again"))
    printed = capsys.readouterr().out
    assert f"{len(before)} of {len(before)} runs have the same id; 2 runs in common" in printed
    assert "no value differs" in printed
    assert status == 0
    assert before.keys() == after.keys()
    for name in before:
        with h5py.File(before[name]) as one, h5py.File(after[name]) as other:
            assert {*one} == {*other}
            numbers = [each for each in {*one} - {"cpu_seconds"} if one[each].dtype.kind in "fi"]
            for each in numbers:
                np.testing.assert_array_equal(one[each][...], other[each][...])


def test_another_version_names_the_one_that_is_needed_and_compares(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    run_study(fake_study(trouble="limit"), Store(tmp_path / "out"), workers=0)
    export(tmp_path / "out", tmp_path / "crate")
    sources = identity.solver_hash()
    monkeypatch.setattr(identity, "solver_hash", lambda: "0" * 32)
    monkeypatch.setattr(crate_module, "solver_hash", lambda: "0" * 32)
    status = main(["run", str(tmp_path / "crate"), "--out", str(tmp_path / "b"), "--workers", "0"])
    told = capsys.readouterr()
    assert f"computed by Residua {__version__}" in told.err
    assert f"sources {sources}. The same ids need it, as this is Residua" in told.err
    assert "0 of 4 runs have the same id; 4 runs in common" in told.out
    assert "no value differs" in told.out
    assert status == 0


def test_a_scene_that_has_changed_is_told_apart_from_another_version(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    study, crate = fake_study(), tmp_path / "crate"
    run_study(study, Store(tmp_path / "out"), workers=0)
    export(tmp_path / "out", crate)
    monkeypatch.setattr(expansion, "written", lambda scene: [["changed", ""]])
    assert main(["run", str(crate), "--out", str(tmp_path / "b"), "--workers", "0"]) == 0
    assert "need the scene, or what reads the study, which differs here" in capsys.readouterr().err
    definition = crate / "studies" / study.id / "study.json"
    changed = study.to_dict() | {"parameters": {"gone": 1}}
    definition.write_bytes(seal.sealed_json(f"study {study.id}", changed))
    assert main(["run", str(crate), "--out", str(tmp_path / "c")]) == 2
    told = capsys.readouterr().err
    assert "parameters.gone = 1: the scene has no such parameter" in told
    assert f"the crate was computed by Residua {__version__}" in told


def test_a_licence_is_one_of_spdx_only_by_a_known_name(tmp_path: Path) -> None:
    names = {"CC-BY-SA-4.0": True, "GPL-3.0-or-later": True, "proprietary": False, "CC-BY": False}
    for name, known in names.items():
        study = Study.from_dict(fake_study(name).to_dict() | {"licence": name})
        run_study(study, Store(tmp_path / name / "out"), workers=0)
        export(tmp_path / name / "out", tmp_path / name / "crate")
        given = entities(tmp_path / name / "crate")["./"]["license"]
        assert given == ({"@id": f"https://spdx.org/licenses/{name}"} if known else name)


def test_a_run_with_another_status_or_id_is_a_failure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    study = fake_study()
    run_study(study, Store(tmp_path / "out"), workers=0)
    export(tmp_path / "out", tmp_path / "crate")
    next((tmp_path / "crate" / "runs").glob("*.nc")).rename(tmp_path / f"{'0' * 32}.nc")
    assert main(["run", str(tmp_path / "crate"), "--out", str(tmp_path / "b"), "--workers", "0"])
    assert "3 of 3 runs have the same id; 4 runs in common" in capsys.readouterr().out


def test_what_is_not_complete_or_no_crate_is_refused(tmp_path: Path) -> None:
    study, store = fake_study(), Store(tmp_path / "out")
    run_study(study, store, workers=0)
    (tmp_path / "full" / "of").mkdir(parents=True)
    with pytest.raises(StudyError, match=r"--crate.*must be a folder that is new or empty"):
        export(store.directory, tmp_path / "full")
    store.run_path(next(study.run_ids())).unlink()
    with pytest.raises(StudyError, match="lacks 1 runs: compute them first"):
        export(store.directory, tmp_path / "crate")
    assert not [*tmp_path.glob("crate*")], "nothing is left of what failed"
    assert main(["run", str(tmp_path / "full"), "--out", str(tmp_path / "b")]) == 2
    assert main(["export", str(store.directory), "--crate", "a", "--csv", "b"]) == 2


def test_a_file_of_a_study_does_not_take_the_place_of_another_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("../a.toml", "..", "", "a/b", "a\\b"):
        with pytest.raises(StudyError, match=r"files.*must be the name of a file"):
            Study.from_dict(fake_study().to_dict() | {"files": {name: "x"}})
    names = ("runs", METADATA, "study-README.md", "README.md", "größer.toml")
    study = Study.from_dict(fake_study().to_dict() | {"files": dict.fromkeys(names, "x")})
    run_study(study, Store(tmp_path / "out"), workers=0)
    (tmp_path / "crate").mkdir()
    monkeypatch.chdir(tmp_path / "crate")
    export(tmp_path / "out", Path())
    assert entities(tmp_path / "crate")["./"]["name"] == "fake"
    assert {each.name for each in tmp_path.glob("crate/*README.md")} == {
        "README.md", "study-README.md", "study-study-README.md"
    }  # fmt: skip
    assert len([*tmp_path.glob("crate/runs/*.nc")]) == 4
    assert "residua run" in (tmp_path / "crate" / "README.md").read_text()


def test_a_crate_is_computed_in_another_folder_and_told_what_was_there(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, crate = tmp_path / "out", tmp_path / "crate"
    run_study(fake_study(), Store(out), workers=0)
    export(out, crate)
    before = {path: path.read_bytes() for path in crate.rglob("*") if path.is_file()}
    assert main(["run", str(crate), "--out", str(crate / "." / "runs" / "..")]) == 2
    assert "--out" in (told := capsys.readouterr().err) and "must be a new folder" in told
    assert {path: path.read_bytes() for path in crate.rglob("*") if path.is_file()} == before
    assert main(["run", str(crate), "--out", str(out), "--workers", "0"]) == 0
    assert "4 of 4 runs were not computed now: --out had them" in capsys.readouterr().out
    assert main(["run", str(crate), "--out", str(tmp_path / "new"), "--workers", "0"]) == 0
    assert "not computed now" not in capsys.readouterr().out


def test_a_goal_that_no_place_reaches_is_computed_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    goal = {"parameter": "load_ratio", "of": "peak_contact_pressure", "at": 1e9}
    content = {"name": "g", "scene": "numbers", "goal": goal | {"between": [0.1, 4.0]}}
    run_study(Study.from_dict(content, NUMBERS), Store(tmp_path / "out"), workers=0)
    export(tmp_path / "out", tmp_path / "crate")
    status = main(["run", str(tmp_path / "crate"), "--out", str(tmp_path / "b"), "--workers", "0"])
    assert "neither study has found a value" in capsys.readouterr().out
    assert status == 0


def test_another_status_of_a_run_is_a_failure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    run_study(fake_study(), Store(tmp_path / "out"), workers=0)
    export(tmp_path / "out", tmp_path / "crate")
    monkeypatch.setattr(crate_module, "diff", partial(relabelled, crate_module.diff))
    assert main(["run", str(tmp_path / "crate"), "--out", str(tmp_path / "b"), "--workers", "0"])
    assert "with another status" in capsys.readouterr().out


def relabelled(diff: Any, first: xr.Dataset, second: xr.Dataset) -> Any:
    """Compare with a run that has ended in another way."""
    statuses = second["status"].copy(data=np.full(second["status"].shape, "no_convergence"))
    return diff(first, second.assign(status=statuses))


def test_a_data_set_that_lacks_a_run_of_another_study_is_refused(tmp_path: Path) -> None:
    store, study, stopped = Store(tmp_path / "out"), fake_study("a"), iter([False] * 14)
    run_study(study, store, workers=0, should_stop=lambda: next(stopped, True))
    with open_study(store.dataset_path(study.id)) as dataset:
        assert (dataset["status"] == "missing").any()
    run_study(fake_study("b"), store, workers=0)
    with pytest.raises(StudyError, match="has runs that its data set lacks: run the study again"):
        export(store.dataset_path(study.id), tmp_path / "crate")


@pytest.mark.parametrize("option", ["--select=friction=0.3", "--field=map_mises", "--stage=loaded"])
def test_an_option_that_a_crate_does_not_have_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], option: str
) -> None:
    crate = tmp_path / "crate"
    assert main(["export", str(tmp_path), "--crate", str(crate), option]) == 2
    assert f"{option.partition('=')[0]} = " in capsys.readouterr().err
    crate.mkdir()
    (crate / METADATA).touch()
    assert main(["fit", str(crate), "--measured", "a.csv", "--out", str(tmp_path / "b")]) == 2
    assert "--measured = 'a.csv': must be left out" in capsys.readouterr().err
