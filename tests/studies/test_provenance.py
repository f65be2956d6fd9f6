"""What a data set says of its origin: files, machine, time, memory, licence, estimated errors."""

from __future__ import annotations

import datetime
import json
import subprocess
import sys
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import netCDF4
import numpy as np
import pytest

from solver.memory import bytes_in
from studies import Store, Study, open_study, run_study
from studies.errors import StudyError
from studies.scenes.scene import read_scene
from studies.scenes.shipped import SHIPPED
from studies.storage import ran
from studies.storage.combine import combine
from studies.storage.estimated import errors_of, of_requested, without
from studies.storage.origin import files_of
from tests.studies.conftest import fake_study
from tests.studies.fakes import NUMBERS, record

SCENES = Path(__file__).parents[2] / "data/scenes"


def run(study: Study, store: Store) -> Path:
    return run_study(study, store, workers=0).dataset


def test_texts_of_study_and_scene_are_kept_as_they_were_written(tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text('name = "first"\nscene = "fake"\n[sweep]\nfriction = [0]\n')
    text = '# größer\nextends = "own.toml"\nname = "more"\n[sweep]\nfriction = [0.25]\n'
    (tmp_path / "more.toml").write_bytes(text.replace("\n", "\r\n").encode())
    study = Study.from_toml(tmp_path / "more.toml")
    store = Store(tmp_path / "out")
    with open_study(run(study, store)) as dataset:
        files = json.loads(dataset.attrs["files"])
    assert files["more.toml"] == text.replace("\n", "\r\n")
    assert files["own.toml"] == (tmp_path / "own.toml").read_text()
    assert [*files] == ["more.toml", "own.toml"], "the study comes first"
    assert store.study(study.id).files == study.files
    assert study.id == Study.from_dict(study.to_dict(files=True)).id
    other = Study.from_dict(study.to_dict() | {"sweep": {"friction": [0.5]}})
    with open_study(run(other, store)) as dataset:
        (name,) = json.loads(dataset.attrs["files"])
    assert name == "study.json", "the texts are those of another study"


def test_two_files_of_a_name_are_both_kept(tmp_path: Path) -> None:
    own = 'name = "a"\nscene = "fake"\n[sweep]\nfriction = [0]\n'
    texts = {
        "b/a.toml": own,
        "a.toml": 'extends = "b/a.toml"\nname = "more"\n[sweep]\nfriction = [0.25]\n',
        "cone.toml": 'name = "cones"\nscene = "cone"\n',
        "given.toml": 'files = ["a.csv"]\n' + own,
    }
    (tmp_path / "b").mkdir()
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    study = Study.from_toml(tmp_path / "a.toml")
    assert files_of(study) == {"a.toml": texts["a.toml"], "a-2.toml": own}
    shipped = files_of(Study.from_toml(tmp_path / "cone.toml"))
    assert shipped["cone.toml"] == texts["cone.toml"]
    assert shipped["cone-2.toml"] == SHIPPED["cone"].read_text()
    with pytest.raises(StudyError, match=r"files = .*leave it out"):
        Study.from_toml(tmp_path / "given.toml")


def test_a_study_that_chooses_its_runs_is_kept_as_json_of_its_own_entries(tmp_path: Path) -> None:
    refine = {"of": ["peak_contact_pressure"], "until": 0.2, "halvings": 1}
    content = {"name": "r", "scene": "numbers", "sweep": {"load_ratio": [0.5, 1.0, 2.0]}}
    study = Study.from_dict(content | {"refine": refine}, NUMBERS)
    with open_study(run(study, Store(tmp_path))) as dataset:
        (text,) = json.loads(dataset.attrs["files"]).values()
    assert Study.from_dict(json.loads(text), NUMBERS).id == study.id


def test_a_study_without_a_file_is_kept_as_json(tmp_path: Path) -> None:
    study = fake_study()
    with open_study(run(study, Store(tmp_path))) as dataset:
        (text,) = json.loads(dataset.attrs["files"]).values()
    assert Study.from_dict(json.loads(text)).id == study.id


@pytest.mark.processes
def test_the_memory_of_a_run_is_not_that_of_the_process_that_started_its_own() -> None:
    large = np.ones(80_000_000)  # 640 MB, as a service may have
    command = "from studies.storage.ran import how; print(how('now')['run_peak_memory'])"
    done = subprocess.run(
        [sys.executable, "-c", command], capture_output=True, text=True, check=True,
        cwd=Path(ran.__file__).parents[2],
    )  # fmt: skip
    assert 1e7 < bytes_in(done.stdout.strip()) < large.nbytes / 2


def test_each_run_says_when_and_where_it_was_computed(tmp_path: Path) -> None:
    began = datetime.datetime.now(datetime.UTC)
    study = fake_study("some", trouble="raise", seconds=0.1)
    with open_study(run(study, Store(tmp_path))) as dataset:
        every = dataset.transpose("load_ratio", ...).load()
    ended = datetime.datetime.now(datetime.UTC)
    for name in ran.MEANINGS:
        assert every[name].dims == every["status"].dims
    first, last = (every[f"run_{end}"].to_numpy().ravel() for end in ("started", "ended"))
    spans = [
        tuple(map(datetime.datetime.fromisoformat, pair)) for pair in zip(first, last, strict=True)
    ]
    assert all(began - datetime.timedelta(seconds=1) < a <= b <= ended for a, b in spans)
    assert "error" in every["status"]
    (machine,) = json.loads(every.attrs["machines"]).values()
    assert set(every["run_machine"].to_numpy().flat) == {"1"}
    assert machine["cores"] >= 1
    assert machine["processor"]
    assert all(each["threads"] == 1 for each in machine["blas"])
    assert all(1e7 < bytes_in(each) < 1e12 for each in every["run_peak_memory"].to_numpy().flat)
    lock = Path(ran.__file__).parents[2] / ran.LOCK
    assert every.attrs["lock"] == machine["lock"] == sha256(lock.read_bytes()).hexdigest()


def test_runs_of_a_goal_say_it_over_their_number(tmp_path: Path) -> None:
    goal = {"parameter": "load_ratio", "of": "peak_contact_pressure", "at": 120.0}
    content = {"name": "g", "scene": "numbers", "goal": goal | {"between": [0.1, 4.0]}}
    study = Study.from_dict(content, NUMBERS)
    store = Store(tmp_path)
    with open_study(run(study, store)) as dataset:
        ids = dataset["run_id"].to_numpy().tolist()
        assert set(ids) == store.asked(study)
        assert all(dataset["run_ended"].to_numpy())
        assert (
            dataset["load_ratio"].attrs["ancillary_variables"] == "load_ratio_low load_ratio_high"
        )


def test_a_doi_is_added_later_without_another_id_or_run(tmp_path: Path) -> None:
    study, store = fake_study(), Store(tmp_path)
    run(study, store)
    later = Study.from_dict(study.to_dict() | {"doi": "10.5281/zenodo.1", "licence": "CC0-1.0"})
    assert later.id == study.id
    outcome = run_study(later, store, workers=0)
    assert (outcome.computed, outcome.anew) == ([], True)
    with open_study(outcome.dataset) as dataset:
        assert (dataset.attrs["doi"], dataset.attrs["license"]) == ("10.5281/zenodo.1", "CC0-1.0")
        assert dataset.attrs["cite"] == "none"
    assert store.study(study.id).doi == "10.5281/zenodo.1"
    assert not run_study(later, store, workers=0).anew


@pytest.mark.parametrize("doi", ["https://doi.org/10.5281/zenodo.1", "10.5281", "10.5281/a b"])
def test_a_doi_is_given_without_its_address(doi: str) -> None:
    with pytest.raises(StudyError, match=r"doi.*must be a DOI without its address"):
        Study.from_dict(fake_study().to_dict() | {"doi": doi})


def test_every_result_names_an_estimated_error_that_exists_or_is_listed(tmp_path: Path) -> None:
    with open_study(run(fake_study(), Store(tmp_path))) as dataset:
        named = {n: v.attrs.get("ancillary_variables", "") for n, v in dataset.data_vars.items()}
        left = dataset.attrs["without_estimated_error"].split()
        numbers = {n for n, v in dataset.data_vars.items() if v.dtype.kind == "f"}
    for name, errors in named.items():
        assert all(each in named for each in errors.split()), name
        assert not (errors and name in left), name
    results = {n for n in numbers if not n.startswith("audit_")} - {"cpu_seconds"}
    counts = {n for n in results if not named[n] and n not in left}
    assert counts <= {"increments", "iterations", "degrees_of_freedom", "median_iterations"}


def test_stress_names_the_estimate_of_its_stage_and_positions_none() -> None:
    words = {
        "residual_max": ((), "largest residual stress in the body", "MPa"),
        "residual_max_x": ((), "position along x of the largest residual stress", "mm"),
        "map_mises": (("stage",), "von Mises stress", "MPa"),
        "hoop_stress": (("body", "s"), "hoop stress along the contact under load", "MPa"),
        "peak_contact_pressure": ((), "largest contact pressure under load", "MPa"),
        "contact_shear": (("stage", "s"), "contact shear", "MPa"),
        "fatigue_path_shear": (("instant",), "mesoscopic shear stress", "MPa"),
        "yield": ((), "load at first yield", "N"), "yield_sigma": ((), "its deviation", "N"),
        "yield_low": ((), "its lower bound", "N"), "yield_high": ((), "its upper bound", "N"),
        "d_residual_max_d_friction": ((), "derivative of largest residual stress", "MPa"),
        "own": ((), "a stress of an own scene", "MPa"),
        **{f"audit_error_{of}": ((), "", "1") for of in ("loaded", "residual", "contact")},
    }  # fmt: skip
    every = {n: (d, {"long_name": w, "units": u}) for n, (d, w, u) in words.items()}
    assert {name: errors_of(name, every) for name in every if errors_of(name, every)} == {
        "residual_max": ["audit_error_residual"],
        "map_mises": ["audit_error_loaded", "audit_error_residual"],
        "hoop_stress": ["audit_error_loaded"],
        "peak_contact_pressure": ["audit_error_contact"],
        "yield": ["yield_sigma"],
    }
    assert without(every, every) == (
        "residual_max_x contact_shear fatigue_path_shear d_residual_max_d_friction own"
    )
    del every["audit_error_residual"]
    assert errors_of("residual_max", every) == []


@pytest.mark.parametrize(
    ("scene", "errors"),
    [
        ("bending", {"residual": "residual"}),
        ("peened", {"compression": "loaded"}),
        ("pin", {"tension": "residual", "peak_pressure": "contact"}),
        ("fretting", {}),  # its numbers are of a stage before the last one
    ],
)
def test_a_number_of_a_scene_file_has_the_estimate_of_its_stage(
    scene: str, errors: dict[str, str]
) -> None:
    own = read_scene(SCENES / f"{scene}.toml")
    every = {each.name: (each.dims, each.attributes) for each in own.quantities}
    every |= {f"audit_error_{of}": ((), {}) for of in ("loaded", "residual", "contact")}
    found = {name: errors_of(name, every, of_requested(own)) for name in every}
    named = {name: [f"audit_error_{of}"] for name, of in errors.items()}
    assert {name: each for name, each in found.items() if each} == named


def test_machines_are_named_once_and_a_run_of_an_earlier_version_has_none() -> None:
    runs = [{"run_ended": "2026"}, {"run_machine": '{"cores": 2}'}, {"run_machine": '{"cores": 8}'}]
    found, attributes = ran.of_runs(["friction"], [4], dict(enumerate(runs)))
    assert found["run_ended"].values.tolist() == ["2026", "", "", ""]
    assert found["run_machine"].values.tolist() == ["", "1", "2", ""]
    assert json.loads(attributes["machines"]) == {"1": {"cores": 2}, "2": {"cores": 8}}


def test_a_data_set_keeps_rules_of_cf_on_coordinates_and_flags(store: Store) -> None:
    study = fake_study(sweep={"load_ratio": [0.3, 0.5]})
    places, z = np.array([0.0, 1.0]), np.array([-1.0, 0.0, 1.0])
    for case in study.cases():
        one = record(case.parameters)
        more = {
            "line_x": (("line", "fraction"), places[None]),
            "line_mises": (("line", "stage", "fraction"), np.ones((1, 2, 2))),
            "patch_status": (("x", "z"), np.ones((len(one.coordinates["x"]), 3))),
        }
        labels = {"line": np.array(["below"]), "fraction": places, "z": z}
        known = replace(
            one, coordinates={**one.coordinates, **labels}, fields={**one.fields, **more}
        )
        store.write_run(case, known)
    combine(study, store, list(study.cases()))
    with netCDF4.Dataset(store.dataset_path(study.id)) as file:
        assert file["line_mises"].coordinates == "line_x"  # no place has y, z or s
        assert not hasattr(file["z"], "axis"), "it is not vertical"
        assert file["x"].axis == "X"
        assert file["patch_status"].flag_values.dtype == file["patch_status"].dtype
        assert not [n for n in file.dimensions if hasattr(file[n], "_FillValue")]
    with netCDF4.Dataset(store.run_path(next(study.run_ids()))) as file:
        assert not [n for n in file.dimensions if hasattr(file[n], "_FillValue")]
