"""A study as one HTML file."""

from __future__ import annotations

import base64
import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from residua.cli import main
from studies import Store, Study, open_study, summary
from studies.storage.seal import seal
from studies.views.archive import archive
from studies.views.columns import value_text


@pytest.fixture(scope="module")
def dataset(computed: tuple[Study, Store]) -> xr.Dataset:
    study, store = computed
    return open_study(store.dataset_path(study.id)).load()


def test_the_file_needs_nothing_else(computed: tuple[Study, Store], tmp_path: Path) -> None:
    study, store = computed
    target = tmp_path / "report.html"
    assert main(["report", str(store.directory), "-o", str(target)]) == 0
    text = target.read_text()
    assert "<script" not in text and "http:" not in text and "https:" not in text
    sources = re.findall(r'(?:src|href)="([^"]*)"', text)
    assert len(sources) >= 2 and all(each.startswith("data:image/png;base64,") for each in sources)
    for each in sources:
        assert base64.b64decode(each.partition(",")[2]).startswith(b"\x89PNG")
    assert study.id in text


def test_it_tells_where_the_data_set_is_as_it_was_given(
    computed: tuple[Study, Store], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    study, store = computed
    target, whole = tmp_path / "report.html", store.dataset_path(study.id)
    monkeypatch.chdir(store.directory.parent)
    own = f"{store.directory.name}/studies/{study.id}/dataset.nc"
    places = {store.directory.name: own, f"{store.directory.name}/fake": own, str(whole): whole}
    for given, told in places.items():
        assert main(["report", given, "-o", str(target)]) == 0
        assert f'open_study("{told}")' in target.read_text()
        assert (str(store.directory) in target.read_text()) == (told is whole)
        assert Path(told).is_file()


def test_a_file_that_is_no_study_is_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = tmp_path / "other.nc"
    xr.Dataset({"a": 1.0}).to_netcdf(other, engine="h5netcdf")
    seal(other, "dataset other")
    for command in (["report"], ["table"], ["plot", "--out", str(tmp_path / "a.png")]):
        assert main([command[0], str(other), *command[1:]]) == 2, command
        told = capsys.readouterr().err
        assert told.count("\n") == 1 and "must be the data set of a study" in told


def test_it_has_the_numbers_of_the_data_set(dataset: xr.Dataset) -> None:
    text = archive(dataset)
    numbers = dataset["peak_contact_pressure"].to_numpy().ravel()
    for each in numbers:
        assert f">{value_text(each)}" in text
    for name in ("load_ratio", "friction"):
        values = ", ".join(value_text(each) for each in dataset[name].to_numpy())
        assert f"<td>{values}" in text
    view = summary(dataset)
    if view.audit:
        assert f"<code>{view.audit[0].name}</code>" in text
    assert "<h2>How it was computed</h2>" in text and dataset.attrs["solver_source"] in text


def test_the_largest_estimated_error_of_residual_stress_is_told(dataset: xr.Dataset) -> None:
    words = "estimated relative error of residual stress in the energy norm, caused by the mesh,"
    estimated = xr.full_like(dataset["increments"], np.nan, dtype=float)
    for none in (estimated, xr.zeros_like(estimated)):  # not audited; without residual stress
        assert words not in archive(dataset.assign(audit_error_residual=none))
    estimated[{"load_ratio": 0, "friction": 1}] = 0.2853
    estimated[{"load_ratio": 1, "friction": 0}] = 0.0711
    page = archive(dataset.assign(audit_error_residual=estimated))
    assert f"{words} is at most 28.5 % (run at load_ratio = 0.3, friction = 0.4)." in page


def test_failed_runs_are_told_and_texts_are_texts(dataset: xr.Dataset) -> None:
    found = dataset.isel(friction=[0]).copy()
    found.attrs |= {"note": "a < b & c", "tags": "rail"}
    for name in ("status", "message"):
        found[name] = found[name].astype(object)
    found["status"][{"load_ratio": 1}] = "limit_load"
    found["message"][{"load_ratio": 1}] = "the punch <sinks>"
    text = archive(found)
    for each in ("a &lt; b &amp; c", "the punch &lt;sinks&gt;", "limit load", "rail"):
        assert each in text
    found["status"][:] = "limit_load"
    assert "<img" not in archive(found), "no run has a picture"
    view = summary(found)
    assert len(view.failed) == 2 and "load_ratio = 0.9: the punch <sinks>" in str(view)


def test_a_study_of_one_run_has_no_axes(dataset: xr.Dataset) -> None:
    text = archive(dataset.isel(load_ratio=[0], friction=[0]))
    assert "What varies" not in text and "What is fixed" in text and "1 run" in text
