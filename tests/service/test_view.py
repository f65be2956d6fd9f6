"""Pages on a folder of results and on a data set, without a service."""

from __future__ import annotations

import csv
import io
import os
import shutil
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx
import numpy as np
import pytest
import xarray as xr
from fastapi.testclient import TestClient

from residua.cli import main
from service import view
from service.job import StudyState
from service.view import ViewedFolder, application
from studies import Store, Study, StudyError, open_netcdf, open_study
from studies.storage import seal
from studies.storage.combine import combine
from studies.views.unpacked import Unpacked
from tests.architecture.sources import ROOT
from tests.service.servers import PATIENCE, wait_until
from tests.studies.conftest import compute_here, fake_study
from tests.studies.test_goal import search_here

AXES = {
    "load_ratio": [0.3, 0.9],
    "case": {"T1": {"friction": 0.1}, "T2": {"friction": 0.3, "hardening": "isotropic"}},
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> tuple[Study, Store]:
    """A folder with a computed study, and one of which a half is there."""
    store = Store(tmp_path_factory.mktemp("folder") / "out")
    study = fake_study("whole", sweep=AXES)
    compute_here(study, store)
    store.save_study(fake_study("begun", sweep=AXES | {"load_ratio": [0.3, 0.9, 1.0]}))
    return study, store


def content(directory: Path) -> dict[str, tuple[int, int]]:
    """Return size and time of change of all files."""
    files = [path for path in directory.rglob("*") if path.is_file()]
    return {str(p): (p.stat().st_size, p.stat().st_mtime_ns) for p in (*files, directory)}


@contextmanager
def shown(path: Path) -> Iterator[tuple[TestClient, str]]:
    with application(path) as (app, first):
        yield TestClient(app, "http://localhost", raise_server_exceptions=False), first


def rows(client: TestClient, study_id: str) -> list[dict[str, str]]:
    text = client.get(f"/studies/{study_id}/table.csv").text
    return list(csv.DictReader(io.StringIO(text)))


@pytest.mark.usefixtures("computing_here")
def test_a_folder_is_shown_and_nothing_is_written_there(folder: tuple[Study, Store]) -> None:
    study, store = folder
    damaged = store.run_path("0" * 32)
    damaged.write_bytes(b"damaged")
    before = content(store.directory)
    with shown(store.directory) as (client, first):
        page = client.get(first)
        assert page.status_code == 200 and "whole" in page.text and "begun" in page.text
        assert "New study" not in page.text, "nothing is computed here"
        assert {each["status"] for each in rows(client, study.id)} == {"ok"}
        run = next(iter(study.run_ids()))
        for path in (
            f"/ui/studies/{study.id}", f"/ui/runs/{run}", f"/runs/{run}.nc", f"/runs/{run}/map.png",
            f"/studies/{study.id}/dataset.nc", f"/studies/{study.id}/log",
        ):  # fmt: skip
            assert client.get(path).status_code == 200, path
        assert '"successful"' in client.get(f"/studies/{study.id}/events").text
        for method, path in (
            ("POST", "/studies"), ("DELETE", f"/runs/{run}"), ("POST", "/estimate"),
            ("DELETE", f"/studies/{study.id}"), ("POST", f"/ui/studies/{study.id}/retry"),
        ):  # fmt: skip
            answer = client.request(method, path)
            assert answer.status_code == 403 and "only show" in answer.text, path
    assert content(store.directory) == before
    damaged.unlink()


def test_a_study_without_a_data_set_is_shown_in_its_folder(
    folder: tuple[Study, Store], monkeypatch: pytest.MonkeyPatch
) -> None:
    directory = folder[1].directory
    with shown(directory / "begun") as (client, first):
        assert first == "/ui" and "begun" in client.get(first).text
    looks = iter([False])  # the first look is before the study is stored

    def is_folder(path: Path) -> bool:
        return next(looks, looked(path))

    looked = view._is_folder
    monkeypatch.setattr(view, "_is_folder", is_folder)
    monkeypatch.setattr("studies.views.reading.present_datasets", lambda path: [])
    with shown(directory) as (_, first):
        assert first == "/ui"


def test_a_study_that_is_computed_elsewhere_is_followed(
    folder: tuple[Study, Store], tmp_path: Path
) -> None:
    study, store = folder
    begun = fake_study("begun", sweep=AXES | {"load_ratio": [0.3, 0.9, 1.0]})
    seen = ViewedFolder(store.directory, tmp_path)
    seen.look()
    job = seen.jobs.get(begun.id)
    assert (job.state, job.progress) == (StudyState.RUNNING, pytest.approx(200 / 3))
    for run in study.run_ids():
        os.utime(store.run_path(run), (0, 0))
    seen.look()
    assert seen.jobs.get(begun.id).state is StudyState.DISMISSED
    compute_here(begun, store)
    seen.look()
    job = seen.jobs.get(begun.id)
    assert (job.state, job.progress) == (StudyState.SUCCESSFUL, 100.0)
    assert len(seen.store.catalogue.rows(seen.jobs.runs(begun.id))) == 6


def test_a_study_that_is_deleted_from_the_folder_is_not_shown_any_more(tmp_path: Path) -> None:
    store = Store(tmp_path / "out")
    stays, goes = (fake_study(name, sweep=AXES | {"load_ratio": [0.1]}) for name in ("a", "b"))
    for each in (stays, goes):
        store.save_study(each)
    (tmp_path / "aside").mkdir()
    seen = ViewedFolder(store.directory, tmp_path / "aside")
    for there in ([stays, goes], [stays], [stays, goes]):
        shutil.rmtree(store.study_path(goes.id), ignore_errors=True)
        for each in there:
            store.save_study(each)
        seen.look()
        assert {job.id for job in seen.jobs.page(limit=9, offset=0)[0]} == {s.id for s in there}


def test_the_end_of_a_study_that_is_computed_elsewhere_is_told_in_its_words(tmp_path: Path) -> None:
    store, sweep = Store(tmp_path / "out"), AXES | {"load_ratio": [0.3, 0.9]}
    half = fake_study("half", sweep=sweep | {"load_ratio": [0.3]})
    compute_here(half, store)
    study = fake_study("stopped", sweep=sweep)
    store.save_study(study)
    goal = {"of": "peak_contact_pressure", "at": 120.0, "between": [0.1, 4.0], "within": 0.1}
    search = Study.from_dict({"name": "goal", "scene": "fake", "goal": goal})
    store.save_study(search)
    (tmp_path / "aside").mkdir()
    seen = ViewedFolder(store.directory, tmp_path / "aside")
    seen.look()
    assert seen.jobs.runs(search.id) == []
    combine(study, store, study.cases())
    search_here(search, store)
    seen.look()
    job = seen.jobs.get(study.id)
    assert (job.state, job.message) == (StudyState.FAILED, "2 of 4 runs: 2 missing")
    asked = store.asked(search)
    assert asked and {*seen.jobs.runs(search.id)} == asked
    assert seen.jobs.get(search.id).stage == "1 of 1 searches ended"


def test_a_damaged_data_set_is_told_and_stays(folder: tuple[Study, Store], tmp_path: Path) -> None:
    study, store = folder
    copy = tmp_path / "out"
    shutil.copytree(store.directory, copy)
    path = Store(copy).dataset_path(study.id)
    with shown(copy) as (client, _):
        path.write_bytes(b"damaged")
        before = content(copy)
        answer = client.get(f"/studies/{study.id}/plot.png")
        assert answer.status_code == 404 and "damaged" in answer.json()["detail"]
        assert client.get(f"/studies/{study.id}").json()["status"] == "successful"
        assert content(copy) == before


@pytest.mark.usefixtures("computing_here")
def test_a_data_set_alone_has_the_pages_of_its_runs(
    folder: tuple[Study, Store], tmp_path: Path
) -> None:
    study, store = folder
    alone = tmp_path / "alone.nc"
    alone.write_bytes(store.dataset_path(study.id).read_bytes())
    with shown(alone) as (client, first):
        assert first == f"/ui/studies/{study.id}"
        assert client.get(first).status_code == 200
        table = rows(client, study.id)
        stored = open_study(alone)
        for each in table:
            at = {"load_ratio": float(each["load_ratio"]), "case": each["case"]}
            value = stored["peak_residual_tension"].sel(at).item()
            assert float(each["peak_residual_tension"]) == value and each["status"] == "ok"
            assert float(each["friction"]) == stored["friction"].sel(case=each["case"]).item()
        run = table[-1]["run"]
        assert client.get(f"/ui/runs/{run}").status_code == 200
        assert client.get(f"/runs/{run}/map.png").headers["content-type"] == "image/png"
    assert len(table) == 4 and list(tmp_path.iterdir()) == [alone]


def test_runs_that_a_data_set_lacks_are_not_computed_yet(
    folder: tuple[Study, Store], tmp_path: Path
) -> None:
    _, store = folder
    more = fake_study("more", sweep=AXES | {"load_ratio": [0.3, 0.9, 0.95]})
    part = combine(more, store, more.cases(), target=tmp_path / "part.nc").path
    with shown(part) as (client, first):
        address = first.removeprefix("/ui")
        detail = client.get(address).json()
        assert (detail["status"], detail["message"]) == ("failed", "2 of 6 runs: 2 missing")
        assert detail["counts"] == {"ok": 4, "pending": 2}
        assert client.get(first).status_code == 200
        assert client.get(f"{address}/numbers", params={"name": "status"}).status_code == 200
        lost = [each["run"] for each in rows(client, more.id) if each["status"] == "pending"]
        assert len(lost) == 2
        assert client.get(f"/runs/{lost[0]}").status_code == 404
        assert client.get(address).json()["counts"] == detail["counts"]


def test_a_run_of_a_data_set_is_that_of_its_file(
    folder: tuple[Study, Store], tmp_path: Path
) -> None:
    study, store = folder
    unpacked = Unpacked(store.dataset_path(study.id), tmp_path)
    table = {
        (row["parameters"]["load_ratio"], row["parameters"]["friction"]): row["id"]
        for row in unpacked.catalogue.runs()[0]
    }
    for case in study.cases():
        run_id = table[case.values["load_ratio"], case.values["friction"]]
        path = unpacked.run_path(run_id)
        seal.check(path, f"run {run_id}")
        with open_netcdf(store.run_path(case.id)) as own, open_netcdf(path) as made:
            for name, each in own.data_vars.items():
                np.testing.assert_array_equal(made[name].squeeze(), each.squeeze(), str(name))
                assert made[name].attrs["long_name"] == each.attrs["long_name"]
            assert made.attrs["versions"] == own.attrs["versions"]


def test_what_is_no_study_is_refused(tmp_path: Path) -> None:
    other = tmp_path / "other.nc"
    xr.Dataset({"a": 1.0}).to_netcdf(other, engine="h5netcdf")
    seal.seal(other, "dataset other")
    for path in (other, tmp_path / "nothing", tmp_path):
        with pytest.raises(StudyError), application(path):
            pass


def test_a_port_that_is_in_use_is_told(
    folder: tuple[Study, Store], capsys: pytest.CaptureFixture[str]
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        assert main(["view", str(folder[1].directory), "--port", port, "--no-browser"]) == 2
    assert f"--port = {port}: must be free" in capsys.readouterr().err


def test_the_command_serves_until_it_is_interrupted(folder: tuple[Study, Store]) -> None:
    study, store = folder
    path = str(store.dataset_path(study.id))
    process = subprocess.Popen(
        [sys.executable, "-m", "residua", "view", path, "--no-browser"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT,
    )  # fmt: skip
    try:
        line = process.stdout.readline()
        assert line.startswith("http://127.0.0.1:")
        assert wait_until(lambda: "whole" in httpx.get(line.split()[0]).text)
        process.send_signal(signal.SIGINT)
        assert process.communicate(timeout=PATIENCE) == ("", "")
        assert process.returncode == 0
    finally:
        process.kill()
        process.communicate()
