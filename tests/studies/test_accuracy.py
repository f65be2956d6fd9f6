"""Accuracy: one word sets mesh and increments, a given number overrides, files hold numbers."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from solver import SCENES
from solver.errors import ModelError
from studies import Store, Study, open_netcdf, open_study, run_study
from studies.definition.parameters import completed, defaults, parameters_of, scene_schema
from studies.errors import StudyError
from studies.scenes.registry import scene_named
from studies.storage.provenance import provenance
from studies.views.archive import archive
from studies.views.plots.captions import setting
from studies.views.tables import run_details, set_by_accuracy

pytestmark = pytest.mark.usefixtures("one_worker")

LEVELS = ("draft", "standard", "fine")
BY_ACCURACY = [
    ("punch", {}, {"smallest_element", "growth", "load_step"}),
    ("elastic_punch", {}, {"smallest_element", "growth"}),
    ("ball", {}, {"element_size", "growth", "load_step"}),
    ("shaft_hub", {}, {"smallest_element", "growth"}),
    ("rigid_punch", {}, {"smallest_element", "growth", "largest_element"}),
    ("rolling", {}, {"element_size", "growth", "advance_step"}),
    ("rolling", {"track": 50.0}, {"element_size", "growth", "advance_step"}),
]


@pytest.mark.parametrize(("scene", "fixed", "names"), BY_ACCURACY)
def test_every_number_that_is_left_out_is_set_and_none_grows_with_accuracy(
    scene: str, fixed: dict[str, Any], names: set[str]
) -> None:
    found = scene_named(scene)
    left_out = {name for name, each in parameters_of(found).items() if each.default is None}
    assert left_out == names
    kind = found.parameters
    draft, standard, fine = (kind(accuracy=level, **fixed) for level in LEVELS)
    assert standard == kind(**fixed)
    for name in names:
        assert getattr(draft, name) >= getattr(standard, name) >= getattr(fine, name) > 0, name
    assert any(getattr(draft, name) > getattr(standard, name) for name in names)
    assert any(getattr(standard, name) > getattr(fine, name) for name in names)


def test_elements_follow_the_contact() -> None:
    kind = SCENES["rolling"].parameters
    for load_ratio in (0.5, 1.0, 3.0):
        p = kind(load_ratio=load_ratio)
        assert p.element_size == pytest.approx(p.half_width / 16, rel=0.05)
        assert kind(load_ratio=load_ratio, track=20.0).advance_step == pytest.approx(
            p.half_width / 16, rel=0.05
        )


def test_a_given_number_overrides() -> None:
    p = SCENES["rolling"].parameters(accuracy="fine", element_size=1.0)
    assert (p.element_size, p.advance_step) == (1.0, 0.5)
    assert SCENES["punch"].parameters(accuracy="draft", growth=1.5).growth == 1.5


def test_a_given_number_out_of_range_is_refused() -> None:
    with pytest.raises(ModelError, match=r"element_size = -1.0: must be greater than 0"):
        SCENES["rolling"].parameters(element_size=-1.0)
    with pytest.raises(ModelError, match="accuracy = 'exact': must be one of draft, standard"):
        SCENES["punch"].parameters(accuracy="exact")


def test_the_schema_has_no_default_for_what_accuracy_sets() -> None:
    properties = scene_schema("rolling")["properties"]
    assert "default" not in properties["element_size"]
    assert properties["element_size"]["type"] == "number"
    assert properties["accuracy"]["default"] == "standard"
    with pytest.raises(StudyError, match=r"sweep\.growth\[1\]"):
        Study.from_dict({"name": "n", "scene": "punch", "sweep": {"growth": [1.4, None]}})


def test_what_is_left_out_is_completed_beside_the_other_values() -> None:
    scene = SCENES["rolling"]
    values = completed(scene, {"load_ratio": 1.0, "element_size": None, "growth": 1.2})
    assert values["element_size"] == scene.parameters(load_ratio=1.0).element_size
    assert values["growth"] == 1.2
    assert defaults(scene, {"accuracy": "draft", "element_size": 3.0})["element_size"] == 1.0


@pytest.mark.processes
def test_a_sweep_of_accuracy_stores_the_numbers_of_each_run(tmp_path: Path) -> None:
    study = Study.from_dict(
        {
            "name": "levels",
            "scene": "rolling",
            "parameters": {"load": "hertz", "load_ratio": 1.0},
            "sweep": {
                "accuracy": ["draft", "standard"],
                "spacing": {"usual": {"passes": 1}, "steep": {"passes": 1, "growth": 1.3}},
            },
        }
    )
    assert Study.known(study.to_dict()).id == Study.from_dict(study.to_dict()).id == study.id
    store = Store(tmp_path)
    outcome = run_study(study, store, workers=1)
    assert outcome.ok, outcome.failed
    own = SCENES["rolling"].parameters(load="hertz", load_ratio=1.0)
    combined = open_study(outcome.dataset)
    np.testing.assert_array_equal(combined["growth"], [np.nan, 1.3])
    caption = setting(combined.isel(accuracy=1, spacing=0).squeeze())
    assert "element" not in caption and "None" not in caption
    sizes = set()
    for case in study.cases():
        with open_netcdf(store.run_path(case.id)) as run:
            written = json.loads(run.attrs["parameters"])
        assert None not in written.values()
        sizes.add((written["accuracy"], written["element_size"], written["growth"]))
    draft = SCENES["rolling"].parameters(load="hertz", load_ratio=1.0, accuracy="draft")
    assert sizes == {
        ("draft", draft.element_size, draft.growth), ("draft", draft.element_size, 1.3),
        ("standard", own.element_size, own.growth), ("standard", own.element_size, 1.3),
    }  # fmt: skip


def uncomputed(sweep: dict[str, list[Any]], **attrs: Any) -> xr.Dataset:
    """Return the data set of a study of punches, without results."""
    study = Study.from_dict({"name": "n", "scene": "punch", "sweep": sweep})
    shape = tuple(map(len, sweep.values()))
    outcome = {name: (tuple(sweep), np.full(shape, "ok")) for name in ("status", "message")}
    made = provenance("n", study.problem, study.fixed)
    return xr.Dataset(outcome, coords=sweep, attrs=made | attrs)


def test_tables_and_reports_tell_the_numbers_that_were_left_out() -> None:
    """Of several runs their range; none of another solver's, or if a run does not tell its load."""
    usual = {"load_ratio": [0.5], "friction": [0.1]}
    told = run_details(uncomputed({"accuracy": ["draft"], **usual})).splitlines()
    assert [each.split(maxsplit=1)[1] for each in told if "by accuracy" in each] == [
        "0.005 by accuracy", "1.6 by accuracy", "0.1 by accuracy",
    ]  # fmt: skip
    cell = '<th scope="row">{}</th><td class="right">{}</td><td class="unit"> {}</td>'
    several = uncomputed({"accuracy": ["draft", "fine"], "growth": [1.3, 1.5]})
    page = archive(several)
    assert cell.format("smallest element", "0.0001 to 0.005", "by accuracy") in page
    assert "<td>1.3, 1.5 " in page
    assert set_by_accuracy(uncomputed(usual)) == {
        "smallest_element": "0.0005", "growth": "1.4", "load_step": "0.05",
    }  # fmt: skip
    other = uncomputed(usual, solver_source="another")
    searched = uncomputed(usual)
    known = json.loads(searched.attrs["parameters"])
    del known["yield_stress"]
    searched.attrs["parameters"] = json.dumps(known)
    for unknown in (other, searched):
        assert set(set_by_accuracy(unknown).values()) == {""}
    assert cell.format("growth", "", "by accuracy") in archive(other)
