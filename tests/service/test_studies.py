"""A study from its submission to its data set, over HTTP."""

from __future__ import annotations

import csv
import io
import json
import re
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from fastapi.testclient import TestClient

from service.app import create_app
from service.settings import Settings
from solver.rolling.rail.profiles.meshed_rail import section_of
from solver.rolling.rail.profiles.rail import rail_60e1
from solver.rolling.rail.profiles.zone import Zone, rail_mesh
from studies import Study, StudyError, open_study
from studies.definition.files import read_study
from tests.architecture.sources import ROOT
from tests.service.servers import NOWHERE, Server, fake_study, wait_until


@pytest.fixture(scope="module")
def done(service: Server) -> dict[str, Any]:
    """A study that was computed."""
    return service.finished(service.post(fake_study("done")))


def test_a_new_study_is_created_and_a_known_one_is_found(service: Server) -> None:
    study = fake_study("twice")
    first = service.client.post("/studies", json=study)
    study["sweep"]["friction"] = [0, 0.30]
    second = service.client.post("/studies", json=study)
    assert (first.status_code, second.status_code) == (201, 200)
    assert first.headers["location"] == second.headers["location"]
    assert service.client.get(first.headers["location"]).json()["name"] == "twice"
    service.client.delete(first.headers["location"])


def test_simultaneous_posts_of_a_study_make_one_study(service: Server) -> None:
    study = fake_study("crowd")
    with ThreadPoolExecutor(16) as pool:
        answers = list(pool.map(lambda _: service.client.post("/studies", json=study), range(16)))
    assert sorted(answer.status_code for answer in answers) == [200] * 15 + [201]
    assert len({answer.json()["id"] for answer in answers}) == 1
    service.client.delete(answers[0].headers["location"])


def test_a_finished_study_counts_its_runs_and_names_their_place(
    service: Server, done: dict[str, Any]
) -> None:
    assert (done["status"], done["progress"], done["counts"]) == ("successful", 100, {"ok": 4})
    places = [(run["at"]["load_ratio"], run["at"]["friction"]) for run in done["runs"]]
    assert places == [(0.25, 0.0), (0.25, 0.3), (0.5, 0.0), (0.5, 0.3)]
    for run in done["runs"]:
        parameters = service.client.get(f"/runs/{run['id']}").json()["parameters"]
        assert run["at"].items() <= parameters.items()


def test_python_opens_a_study_by_its_url(service: Server, done: dict[str, Any]) -> None:
    url = f"{service.client.base_url}/studies/{done['id']}"
    dataset = open_study(url)
    assert dataset.sizes["load_ratio"] == 2
    assert dataset.attrs["id"] == done["id"]
    assert open_study(f"{url}/dataset.nc").identical(dataset)
    with xr.open_dataset(f"{url}/dataset.nc#mode=bytes") as parts:  # as the README says
        assert parts["load_ratio"].identical(dataset["load_ratio"])
        np.testing.assert_array_equal(parts["plastic_strain"], dataset["plastic_strain"])
    with pytest.raises(StudyError, match=r"must be a study of a service: .*404"):
        open_study(f"{service.client.base_url}/studies/{'0' * 32}")
    with pytest.raises(StudyError, match="must be a study of a service"):
        open_study("http://127.0.0.1:9/studies")


def test_runs_of_a_study_come_in_pages(service: Server, done: dict[str, Any]) -> None:
    page = service.client.get(f"/studies/{done['id']}", params={"limit": 2, "offset": 1}).json()
    assert page["runs"] == done["runs"][1:3]
    assert page["counts"] == done["counts"]


def test_studies_come_in_pages_the_latest_first(service: Server, done: dict[str, Any]) -> None:
    service.finished(service.post(fake_study("later")))
    everything = service.client.get("/studies").json()
    ids = [study["id"] for study in everything["items"]]
    assert everything["total"] == len(ids) >= 2
    assert everything["items"][0]["name"] == "later"
    page = service.client.get("/studies", params={"limit": 1, "offset": 1}).json()
    assert [study["id"] for study in page["items"]] == ids[1:2]
    failed = service.client.get("/studies", params={"status": "failed"}).json()
    assert done["id"] not in {study["id"] for study in failed["items"]}


def test_the_data_set_arrives_as_it_was_stored(
    service: Server, done: dict[str, Any], tmp_path: Path
) -> None:
    answer = service.client.get(f"/studies/{done['id']}/dataset.nc")
    assert answer.headers["content-type"] == "application/netcdf"
    fetched = tmp_path / "fetched.nc"
    fetched.write_bytes(answer.content)
    with xr.open_dataset(fetched, engine="h5netcdf") as ours:
        assert ours["residual_stress"].sel(load_ratio=0.5, friction=0.3).max() == 0.65
        with xr.open_dataset(
            service.data / "studies" / done["id"] / "dataset.nc", engine="h5netcdf"
        ) as stored:
            xr.testing.assert_identical(ours, stored)
    head = service.client.head(f"/studies/{done['id']}/dataset.nc")
    assert int(head.headers["content-length"]) == len(answer.content)
    part = service.client.get(f"/studies/{done['id']}/dataset.nc", headers={"range": "bytes=0-7"})
    assert (part.status_code, part.content) == (206, answer.content[:8])


def test_sensitivity_is_told_or_refused_with_the_reason(
    service: Server, done: dict[str, Any]
) -> None:
    url = f"/studies/{done['id']}/sensitivity"
    few = service.client.get(url, params={"of": "max_plastic_strain"})
    assert few.status_code == 422
    assert "has 2 values: 3 at least" in few.text
    assert "did you mean" in service.client.get(url, params={"of": "max_plastic_strane"}).text
    axes = {"load_ratio": [0.2, 0.4, 0.6], "friction": [0.0, 0.1, 0.2, 0.3]}
    grid = service.finished(service.post(fake_study("grid") | {"sweep": axes}))
    found = service.client.get(
        f"/studies/{grid['id']}/sensitivity", params={"of": "max_plastic_strain"}
    ).json()
    assert found["q2"] > 0.99
    parameters = found["parameters"]
    assert parameters["load_ratio"]["total"] > 0.99 > parameters["friction"]["total"]
    url, at = f"/studies/{grid['id']}/predict", {"load_ratio": 0.4, "friction": 0.1}
    told = service.client.get(url, params={"of": "max_plastic_strain", **at}).json()
    assert (told["value"], told["error"], told["by"]) == (0.4, 0.0, "run")
    for name in ("nothing", "dataset"):
        refused = service.client.get(url, params={"of": "max_plastic_strain", name: "1", **at})
        assert refused.json()["errors"][0]["field"] == name


@pytest.mark.parametrize(
    "part", ["bytes=5-2", "bytes=a-b", "lines=1-2", "bytes=0-" + "9" * 5000, "bytes=0-1,3-4"]
)
def test_a_part_that_makes_no_sense_is_answered_by_the_whole(
    service: Server, done: dict[str, Any], part: str
) -> None:
    url = f"/studies/{done['id']}/dataset.nc"
    answer = service.client.get(url, headers={"range": part})
    assert answer.status_code == 200
    assert answer.content == service.client.get(url).content


def test_a_part_beyond_the_end_is_refused_with_the_length(
    service: Server, done: dict[str, Any]
) -> None:
    url = f"/studies/{done['id']}/dataset.nc"
    answer = service.client.get(url, headers={"range": "bytes=999999999-"})
    assert answer.status_code == 416
    size = service.client.head(url).headers["content-length"]
    assert answer.headers["content-range"] == f"bytes */{size}"


def test_a_study_may_allow_large_strain_and_its_runs_keep_their_own_status(
    service: Server,
) -> None:
    study = fake_study("large", behaviour="large")
    strict = service.finished(service.post(study))
    assert (strict["status"], strict["counts"]) == ("failed", {"outside_theory": 4})
    before = len(service.computed())
    lenient = service.finished(service.post({**study, "allow": ["large_strain"]}))
    assert (lenient["status"], lenient["counts"]) == ("successful", {"ok": 4})
    assert (strict["allow"], lenient["allow"]) == ([], ["large_strain"])
    assert {run["status"] for run in lenient["runs"]} == {"ok"}
    assert len(service.computed()) == before, "their runs are the same"
    found = service.client.get("/runs", params={"status": "outside_theory"}).json()
    assert found["total"] == 4
    wrong = service.client.post("/studies", json={**study, "allow": ["everything"]})
    assert wrong.status_code == 422
    assert wrong.json()["errors"][0]["field"] == "allow[0]"


def test_events_tell_the_story_to_its_end(service: Server) -> None:
    study_id = service.post(fake_study("story", seconds=0.3))
    with service.client.stream("GET", f"/studies/{study_id}/events") as stream:
        assert stream.headers["content-type"].startswith("text/event-stream")
        story = [json.loads(line[5:]) for line in stream.iter_lines() if line.startswith("data:")]
    assert story[-1]["status"] == "successful"
    progress = [chapter["progress"] for chapter in story]
    assert progress == sorted(progress)
    assert progress[0] == 0 and progress[-1] == 100
    assert any(0 < each < 100 for each in progress)


def test_a_study_with_failed_runs_fails_and_a_retry_computes_only_those(service: Server) -> None:
    shared = fake_study("shared", behaviour="limit")
    shared["sweep"]["behaviour"] = ["good", shared["parameters"].pop("behaviour")]
    shared["sweep"].pop("load_ratio")
    study_id = service.post(shared)
    failed = service.finished(study_id)
    assert (failed["status"], failed["counts"]) == ("failed", {"ok": 2, "limit_load": 2})
    assert failed["message"] == "2 of 4 runs: 2 limit_load"
    assert {run["message"] for run in failed["runs"] if run["status"] != "ok"} == {"no equilibrium"}
    before = len(service.computed())
    answer = service.client.post(f"/studies/{study_id}/retry")
    assert (answer.status_code, answer.json()["status"]) == (202, "accepted")
    assert service.finished(study_id)["status"] == "failed"
    again = service.computed()[before:]
    assert len(again) == 2 and all('"limit"' in line for line in again)


def test_a_path_that_raises_gives_failed_runs_with_a_reason_and_no_map(service: Server) -> None:
    study = service.finished(service.post(fake_study("raises", behaviour="raise")))
    assert (study["status"], study["counts"]) == ("failed", {"error": 4})
    assert "a defect of the scene" in study["runs"][0]["message"]
    answer = service.client.get(f"/runs/{study['runs'][0]['id']}/map.png")
    assert answer.status_code == 422 and len(answer.json()["errors"]) == 1


def test_a_dismissed_study_stops_and_keeps_its_finished_runs(service: Server) -> None:
    study = fake_study("long", seconds=0.4)
    study["sweep"]["friction"] = [i / 100 for i in range(20)]
    study_id = service.post(study)
    wait_until(lambda: service.study(study_id)["counts"].get("ok", 0) >= 2)
    answer = service.client.delete(f"/studies/{study_id}")
    assert (answer.status_code, answer.json()["status"]) == (200, "dismissed")
    assert service.client.delete(f"/studies/{study_id}").status_code == 200
    path = Path(service.data / "studies" / study_id / "dataset.nc")
    wait_until(path.exists)  # the end of the work on it
    left = service.study(study_id)
    assert left["status"] == "dismissed"
    assert left["counts"]["ok"] >= 2 and left["counts"]["pending"] >= 20
    with xr.open_dataset(path, engine="h5netcdf") as dataset:
        stress = dataset["max_plastic_strain"].values
    assert np.isfinite(stress).sum() == left["counts"]["ok"]


def test_a_waiting_study_is_dismissed_without_being_computed(service: Server) -> None:
    busy = service.post(fake_study("busy", seconds=0.5))
    waiting = service.post(fake_study("waiting", seconds=0.05))
    assert service.client.post(f"/studies/{waiting}/retry").status_code == 409
    assert service.client.delete(f"/studies/{waiting}").json()["status"] == "dismissed"
    content = io.BytesIO(service.client.get(f"/studies/{waiting}/dataset.nc").content)
    with xr.open_dataset(content, engine="h5netcdf") as dataset:
        assert set(dataset["status"].to_numpy().ravel()) == {"missing"}
    service.finished(busy)
    assert service.study(waiting)["counts"] == {"pending": 4}
    assert service.client.delete(f"/studies/{busy}").status_code == 409
    service.client.post(f"/studies/{waiting}/retry")
    assert service.finished(waiting)["status"] == "successful"


def test_runs_are_shared_between_studies(service: Server, done: dict[str, Any]) -> None:
    before = len(service.computed())
    copy = service.finished(service.post(fake_study("copy")))
    assert copy["id"] != done["id"]
    assert [run["id"] for run in copy["runs"]] == [run["id"] for run in done["runs"]]
    assert len(service.computed()) == before


def test_a_linked_axis_is_answered_by_its_labels(service: Server, tmp_path: Path) -> None:
    study = fake_study("table")
    study["sweep"] = {
        "load_ratio": [0.25, 0.5],
        "case": {"T2": {"friction": 0.375}, "T1": {"hardening": "isotropic"}},
    }
    found = service.finished(service.post(study))
    assert (found["status"], found["counts"]) == ("successful", {"ok": 4})
    assert found["sweep"]["case"] == {
        "T2": {"hardening": "none", "friction": 0.375},
        "T1": {"hardening": "isotropic", "friction": 0.0},
    }
    assert [run["at"] for run in found["runs"]] == [
        {"case": label, "load_ratio": load_ratio}
        for label in ("T2", "T1")
        for load_ratio in (0.25, 0.5)
    ]
    for run in found["runs"]:
        parameters = service.client.get(f"/runs/{run['id']}").json()["parameters"]
        assert found["sweep"]["case"][run["at"]["case"]].items() <= parameters.items()
        assert run["at"]["load_ratio"] == parameters["load_ratio"]
    fetched = tmp_path / "table.nc"
    answer = service.client.get(f"/studies/{found['id']}/dataset.nc")
    fetched.write_bytes(answer.content)
    with xr.open_dataset(fetched) as together:
        stress = together["residual_stress"].sel(case="T2", load_ratio=0.5)
        assert stress.max() == 0.5 * 1.375
        assert stress["friction"] == 0.375
        assert together["hardening"].dims == ("case",)
    study["sweep"]["case"] = dict(reversed(study["sweep"]["case"].items()))
    assert service.post(study) != found["id"], "the order of labels is that of the data set"


def test_a_sample_is_answered_by_its_points_and_is_what_a_list_of_them_is(service: Server) -> None:
    ranges = {"friction": [0.0, 0.5], "hardening": ["none", "isotropic"]}
    study: dict[str, Any] = fake_study("sampled") | {
        "sweep": {"load_ratio": [0.25, 0.5]},
        "sample": {"method": "lhs", "num": 2, "ranges": ranges},
    }
    found = service.finished(service.post(study))
    assert (found["status"], found["counts"]) == ("successful", {"ok": 4})
    points = found["sweep"]["point"]
    assert [run["at"] for run in found["runs"]] == [
        {"point": k, "load_ratio": load_ratio} for k in (0, 1) for load_ratio in (0.25, 0.5)
    ]
    for run in found["runs"]:
        parameters = service.client.get(f"/runs/{run['id']}").json()["parameters"]
        assert points[run["at"]["point"]].items() <= parameters.items()
    del study["sample"]
    assert service.post(study | {"points": points}) == found["id"]
    refused = service.client.post("/studies", json=study | {"points": [{"friction": 7}]})
    assert refused.status_code == 422
    assert refused.json()["errors"][0]["field"] == "points[0].friction"


def test_a_goal_is_estimated_searched_and_answered(service: Server) -> None:
    """Of the fake scene the largest plastic strain is the load ratio."""
    goal = {"of": "max_plastic_strain", "at": 0.6, "between": [0.2, 1.0]}
    tests = {"A": {"friction": 0.0}, "B": {"friction": 0.3, "hardening": "isotropic"}}
    study = fake_study("goal") | {"goal": goal, "sweep": {"test": tests}}
    most = service.client.post("/estimate", json=study).json()
    study_id = service.post(study)
    detail = service.finished(study_id)
    assert (detail["status"], detail["message"]) == ("successful", "")
    assert detail["stage"] == "2 of 2 searches ended"
    assert detail["goal"] == {"parameter": "load_ratio", "within": 0.01, **goal}
    assert detail["counts"] == {"ok": len(detail["runs"])}
    assert 4 < len(detail["runs"]) <= detail["size"] == most["runs"] == most["to_compute"]
    content = io.BytesIO(service.client.get(f"/studies/{study_id}/dataset.nc").content)
    found = xr.load_dataset(content, engine="h5netcdf")
    assert found.load_ratio.to_numpy().ravel() == pytest.approx([0.6, 0.6], rel=1e-9)
    tried = found.sel(test="B").squeeze()
    at = {run["id"]: run["at"] for run in detail["runs"]}
    assert set(at) == {each for each in found.tried_run.to_numpy().ravel() if each}
    for run, value in zip(tried.tried_run.values, tried.tried_load_ratio.values, strict=True):
        if run:
            assert at[run] == {"test": "B", "load_ratio": value}
    page = service.client.get(f"/studies/{study_id}", params={"limit": 2, "offset": 1}).json()
    assert page["runs"] == detail["runs"][1:3]
    table = service.client.get(f"/studies/{study_id}/table.csv", params={"test": "A,B"})
    rows = {row["run"]: row for row in csv.DictReader(io.StringIO(table.text))}
    assert {
        run: {"test": row["test"], "load_ratio": float(row["load_ratio"])}
        for run, row in rows.items()
    } == at
    shown = service.client.get(f"/ui/studies/{study_id}")
    assert shown.text.count("data-choose=") == min(len(at), 25)
    listed = service.client.get("/ui", params={"text": "goal"}).text
    assert f'<td class="right">{len(at)}</td>' in listed
    assert "2 of 2 searches ended" in listed
    low, high = (found[f"load_ratio_{end}"].to_numpy().ravel() for end in ("low", "high"))
    marks = json.loads(re.search(r'"found": (\[.*?\]\}\])', shown.text)[1])
    assert [each["test"][0] for each in marks] == ["A", "B"]
    assert [each["load_ratio"] for each in marks] == [
        [*each] for each in zip(found.load_ratio.to_numpy().ravel(), low, high, strict=True)
    ]
    cells = re.findall(r"<td[^>]*>(.*?)</td>", shown.text.partition("What was found")[2])
    assert cells[:2] == ["A", "0"] and {"0.6", f"{low[0]:.4g}", f"{high[0]:.4g}"} <= {*cells[:9]}


def test_a_minimum_is_estimated_searched_and_shown(service: Server) -> None:
    """Of the fake scene the largest plastic strain is the load ratio."""
    asked = {
        "of": "max_plastic_strain", "where": "max_plastic_strain > 0.3", "starts": 1, "most": 12,
        "ranges": {"load_ratio": [0.2, 1.0]},
    }  # fmt: skip
    study = fake_study("least") | {"minimise": asked, "sweep": {}}
    assert service.client.post("/estimate", json=study).json()["runs"] == 12
    study_id = service.post(study)
    detail = service.finished(study_id)
    assert detail["minimise"]["where"] == ["max_plastic_strain > 0.3"]
    assert {each["at"].keys() == {"load_ratio"} for each in detail["runs"]} == {True}
    page = service.client.get(f"/ui/studies/{study_id}").text
    marks = json.loads(re.search(r'"found": (\[.*?\]\}\])', page)[1])
    assert 0.3 < marks[0]["load_ratio"][0] < 0.32
    assert "Least max_plastic_strain where max_plastic_strain &gt; 0.3: " in page
    (best,) = [r for r in detail["runs"] if r["at"]["load_ratio"] == marks[0]["load_ratio"][0]]
    assert f"/ui/runs/{best['id']}" in page, "the run that is shown at first"
    refused = service.client.post("/studies", json=study | {"minimise": {**asked, "where": "a"}})
    assert refused.json()["errors"][0]["field"] == "minimise.where"


def test_a_goal_that_is_not_reached_fails_with_the_reason(service: Server) -> None:
    goal = {"of": "max_plastic_strain", "at": 5.0, "between": [0.2, 1.0]}
    detail = service.finished(service.post(fake_study("far") | {"goal": goal, "sweep": {}}))
    assert (detail["status"], detail["message"]) == ("failed", "1 of 1 searches: 1 missing")
    assert detail["stage"] == "1 of 1 searches ended"
    page = service.client.get(f"/ui/studies/{detail['id']}").text
    ends = "max plastic strain is 0.2 at load ratio = 0.2 and 1 at load ratio = 1"
    assert f">{ends}: it does not reach 5 in between</td>" in page
    assert '"found": []' in page


def test_a_refinement_is_estimated_watched_and_predicted(service: Server) -> None:
    study = fake_study("refined") | {"refine": {"of": ["max_plastic_strain"], "most": 30}}
    study["sweep"] |= {"hardening": ["none", "isotropic"]}
    most = service.client.post("/estimate", json=study).json()
    assert (most["runs"], most["to_compute"]) == (30, 30)
    study_id = service.post(study)
    detail = service.finished(study_id)
    assert (detail["status"], detail["stage"], detail["size"]) == ("successful", "ended", 30)
    assert detail["refine"]["of"] == ["max_plastic_strain"]
    assert detail["counts"] == {"ok": 18}, "of two branches: their number is linear"
    places = {tuple(run["at"].values()) for run in detail["runs"]}
    assert len(places) == 18
    assert (0.375, 0.15, "isotropic") in places
    at = {"load_ratio": 0.31, "friction": 0.2, "hardening": "none"}
    url = f"/studies/{study_id}/predict"
    told = service.client.get(url, params={"of": "max_plastic_strain", **at}).json()
    assert (told["by"], told["value"]) == ("cells", pytest.approx(0.31))
    page = service.client.get(f"/ui/studies/{study_id}").text
    assert "2 cells: 2 settled." in page and "2 % of its range" in page
    assert '<td>max plastic strain</td><td class="right">0</td>' in page


def test_a_fit_is_searched_and_its_answer_told(service: Server, done: dict[str, Any]) -> None:
    line = {"of": "max_plastic_strain", "values": [0.59, 0.61], "sigma": 0.01}
    fit = {"measured": [line], "ranges": {"load_ratio": [0.2, 0.8]}, "most": 20}
    study = fake_study("fitted") | {"fit": fit, "sweep": {}}
    study_id = service.post(study)
    detail = service.finished(study_id)
    assert (detail["status"], detail["stage"]) == ("successful", "ended")
    assert len(detail["runs"]) == detail["counts"]["ok"] <= 20
    assert all(run["at"].keys() == {"load_ratio"} for run in detail["runs"])
    told = service.client.get(f"/studies/{study_id}/fit").json()
    found = told["parameters"]["load_ratio"]
    assert (told["status"], told["runs"]) == ("ok", len(detail["runs"]))
    assert found["value"] == pytest.approx(0.6)
    assert found["sigma"] == pytest.approx(0.01 / 2**0.5, rel=1e-3)
    page = service.client.get(f"/ui/studies/{study_id}").text
    assert (
        f'<td>load ratio</td><td class="right">0.6</td><td class="right">{found["sigma"]:.4g}'
        in page
    )
    refused = service.client.get(f"/studies/{done['id']}/fit")
    assert refused.json()["errors"][0]["field"] == "fit"
    file = service.client.post("/studies", json=study | {"fit": fit | {"measured": ["a.csv"]}})
    assert file.json()["errors"][0]["field"] == "fit.measured[0]"
    few = fake_study("few") | {"fit": fit | {"most": 2}, "sweep": {}}
    end = service.finished(service.post(few))
    assert (end["status"], end["message"]) == ("failed", "1 of 1 fits: 1 not_converged")


def test_a_study_extends_one_that_is_known(service: Server, done: dict[str, Any]) -> None:
    for named in (done["id"], fake_study("done")):
        more = {"name": "more", "extends": named, "sweep": {"friction": [0.1]}}
        study_id = service.post(more)
    sweep = fake_study("more")["sweep"] | {"friction": [0.0, 0.1, 0.3]}
    assert service.post(fake_study("more") | {"sweep": sweep}) == study_id
    detail = service.finished(study_id)
    assert detail["counts"] == {"ok": 6}
    assert {run["id"] for run in done["runs"]} < {run["id"] for run in detail["runs"]}
    refused = service.client.post("/studies", json={"name": "more", "extends": "0" * 32})
    assert refused.json()["errors"][0]["field"] == "extends"


@pytest.mark.parametrize(
    ("name", "entry", "stage"),
    [
        ("limit-load", "goal", "0 of 1 searches ended"),
        ("refined-punch", "refine", "at most 40 runs"),
        ("ball-fit", "fit", "at most 40 runs"),
    ],
)
def test_a_study_that_chooses_its_runs_has_the_same_id_everywhere(
    tmp_path: Path, name: str, entry: str, stage: str
) -> None:
    file = ROOT / "data" / "studies" / f"{name}.toml"
    settings = Settings(data=tmp_path, scheduler=NOWHERE["RESIDUA_SCHEDULER"])
    with TestClient(create_app(settings), base_url="http://localhost") as client:
        posted = client.post("/studies", json=read_study(file)).json()
        assert posted["stage"] == stage
        refused = client.post("/studies", json=read_study(file) | {entry: {"peace": 1}})
    study = Study.from_toml(file)
    assert (posted["id"], posted["size"]) == (study.id, study.size)
    assert refused.status_code == 422
    assert f"{entry}.peace" in {each["field"] for each in refused.json()["errors"]}


def test_a_study_holds_the_mesh_of_a_rail(service: Server) -> None:
    """It is data of the study as points are: no file is sent."""
    mesh = section_of(rail_mesh(rail_60e1(), Zone(at=0, half_width=20, depth=14, size=2.0)))
    study = {
        "name": "own-rail", "scene": "wheel_rail",
        "parameters": {"accuracy": "draft", "rail_profile": mesh},
    }  # fmt: skip
    answer = service.client.post("/estimate", json=study)
    assert answer.status_code == 200, answer.text
    study["parameters"] = {"rail_profile": mesh._replace(foot=())}
    refused = service.client.post("/estimate", json=study)
    assert refused.status_code == 422
    told = "must have a line foot of edges of elements, on the outside"
    assert told in refused.json()["errors"][0]["allowed"]


def test_studies_are_found_by_a_tag(service: Server) -> None:
    own = {"note": "of the day", "tags": ["today", "rail"]}
    told = service.post(fake_study("tagged") | own)
    service.post(fake_study("untagged"))
    found = service.client.get("/studies", params={"tag": "rail"}).json()
    assert [each["id"] for each in found["items"]] == [told]
    assert found["total"] == 1
    detail = service.finished(told)
    assert (detail["note"], detail["tags"], detail["keep"]) == (*own.values(), "")
    assert service.client.get("/studies", params={"tag": "road"}).json()["total"] == 0
    whole = io.BytesIO(service.client.get(f"/studies/{told}/dataset.nc").content)
    attributes = xr.load_dataset(whole, engine="h5netcdf").attrs
    assert (attributes["note"], attributes["tags"]) == ("of the day", "today rail")
