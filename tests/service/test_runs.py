"""Runs, scenes and health over HTTP."""

from __future__ import annotations

import io
from typing import Any

import httpx
import matplotlib.image
import numpy as np
import pytest
import xarray as xr

from tests.service.servers import Server, fake_study


@pytest.fixture(scope="module")
def runs(service: Server) -> list[dict[str, Any]]:
    """The runs of a study: two loads, the friction of 0.3 unlike any other test's."""
    study = fake_study("catalogued", hardening="isotropic")
    study["sweep"]["friction"] = [0.125, 0.875]
    done = service.finished(service.post(study))
    found: list[dict[str, Any]] = done["runs"]
    return [each | {"study": done["id"]} for each in found]


@pytest.mark.parametrize(
    ("wanted", "count"),
    [
        ({"friction": 0.125}, 2),
        ({"friction": 0.125, "load_ratio": 0.5}, 1),
        ({"friction": 0.125, "hardening": "none"}, 0),
        ({"friction": 0.125, "status": "ok", "scene": "fake"}, 2),
        ({"friction": 0.125, "scene": "punch"}, 0),
        ({"friction": 0.125, "limit": 1}, 2),
        ({"friction": 0.125, "seconds": 0, "behaviour": "good"}, 2),
        ({"friction": 0.125, "scene": "fake", "seconds": "0.0"}, 2),
        ({"friction": 0.125, "seconds": 0.25}, 0),
        ({"friction": 0.125, "traction": 0.5}, 0),
    ],
)
def test_runs_are_found_by_their_parameters(
    service: Server, runs: list[dict[str, Any]], wanted: dict[str, Any], count: int
) -> None:
    page = service.client.get("/runs", params=wanted).json()
    assert page["total"] == count
    assert len(page["items"]) == min(count, wanted.get("limit", count))
    assert {run["parameters"]["friction"] for run in page["items"]} <= {0.125}


def test_pages_of_runs_follow_each_other(service: Server, runs: list[dict[str, Any]]) -> None:
    whole = service.client.get("/runs", params={"hardening": "isotropic"}).json()["items"]
    pages = [
        service.client.get("/runs", params={"hardening": "isotropic", "limit": 1, "offset": i})
        for i in range(len(whole))
    ]
    assert [page.json()["items"][0] for page in pages] == whole


def test_a_run_arrives_as_a_labelled_data_set(service: Server, runs: list[dict[str, Any]]) -> None:
    answer = service.client.get(f"/runs/{runs[-1]['id']}.nc")
    with xr.open_dataset(io.BytesIO(answer.content), engine="h5netcdf") as run:
        assert run["residual_stress"].sizes["friction"] == 1
        assert run["residual_stress"].max() == 0.5 * 1.875
        assert run["residual_stress"].attrs["units"] == "MPa"


@pytest.mark.parametrize(
    "query", [{"field": "residual_stress", "component": "xx"}, {"field": "plastic_strain"}]
)
def test_a_map_is_a_picture_that_need_not_be_sent_twice(
    service: Server, runs: list[dict[str, Any]], query: dict[str, str]
) -> None:
    url = f"/runs/{runs[0]['id']}/map.png"
    answer = service.client.get(url, params=query)
    assert answer.status_code == 200, answer.text
    picture = matplotlib.image.imread(io.BytesIO(answer.content), format="png")
    assert picture.shape[0] > 300 and picture.shape[1] > 300
    assert picture[..., :3].std() > 0.01
    tag = {"if-none-match": answer.headers["etag"]}
    assert service.client.get(url, params=query, headers=tag).status_code == 304
    other = service.client.get(f"/runs/{runs[1]['id']}/map.png", params=query, headers=tag)
    assert other.status_code == 200


def test_a_map_and_its_difference_are_sent_as_csv(
    service: Server, runs: list[dict[str, Any]]
) -> None:
    own, other = runs[0]["id"], runs[1]["id"]
    asked = {"field": "residual_stress"}
    whole = service.client.get(f"/runs/{own}/values.csv", params=asked)
    assert whole.headers["content-type"].startswith("text/csv")
    names, *lines = whole.text.splitlines()
    assert names == "x,y,residual_stress"
    place, value = (lines[0].rpartition(",")[k] for k in (0, 2))
    with xr.open_dataset(io.BytesIO(service.client.get(f"/runs/{own}.nc").content)) as run:
        stress = run["residual_stress"].squeeze(drop=True).isel(component=0)
        x, y = map(float, place.split(","))
        assert float(stress.sel(x=x, y=y)) == float(value)
        assert len(lines) == int(stress.notnull().sum())
    known = {"if-none-match": whole.headers["etag"]}
    again = service.client.get(f"/runs/{own}/values.csv", params=asked, headers=known)
    assert again.status_code == 304
    less = service.client.get(f"/runs/{own}/values.csv", params=asked | {"minus": other})
    assert less.text.splitlines()[1] != lines[0] and less.headers["etag"] != whole.headers["etag"]
    none = service.client.get(f"/runs/{own}/values.csv", params={"field": "friction"})
    assert none.status_code == 422 and none.json()["errors"][0]["field"] == "field"


@pytest.mark.parametrize(
    ("query", "field", "allowed"),
    [
        ({"field": "nonsense"}, "field", "residual_stress"),
        ({"field": "max_plastic_strain"}, "field", "residual_stress"),
        ({"zoom": -1}, "zoom", "greater than 0"),
        ({"window": [5.0, 4.0, 0.0, 1.0]}, "window", "must be x0 x1 y0 y1"),
        ({"resolution": 10}, "resolution", "must be at least 50"),
        ({"resolution": "fine"}, "resolution", "must be an integer"),
        ({"zom": 2}, "zom", "is not known here"),
        ({"field": "residual_stress", "component": "rr"}, "component", "xx, yy, zz, xy"),
        ({"field": "plastic_strain", "component": "xx"}, "component", "leave it out"),
    ],
)
def test_a_map_that_cannot_be_drawn_is_refused_by_field(
    service: Server, runs: list[dict[str, Any]], query: dict[str, str], field: str, allowed: str
) -> None:
    answer = service.client.get(f"/runs/{runs[0]['id']}/map.png", params=query)
    assert answer.status_code == 422
    (error,) = answer.json()["errors"]
    assert error["field"] == field and str(error["value"]) == str(query[field])
    assert allowed in error["allowed"]


def picture_of(answer: httpx.Response) -> np.ndarray:
    assert answer.status_code == 200, answer.text
    assert answer.headers["content-type"] == "image/png"
    return matplotlib.image.imread(io.BytesIO(answer.content), format="png")


def test_a_number_of_the_runs_is_drawn_over_the_sweep(
    service: Server, runs: list[dict[str, Any]]
) -> None:
    sweep, asked = f"/studies/{runs[0]['study']}/plot.png", {"resolution": 60}
    own = {"friction": runs[0]["at"]["friction"]}
    number = {"field": "max_plastic_strain"}
    whole, part, usual = (
        picture_of(service.client.get(sweep, params=asked | more))
        for more in (number, number | own, own)
    )
    assert not np.array_equal(whole, part)
    assert usual.shape != part.shape
    for wrong, name in (({"field": "nonsense"}, "field"), (number | {"fricton": 1}, "fricton")):
        answer = service.client.get(sweep, params=wrong)
        assert answer.status_code == 422 and name in answer.text


def test_a_map_has_the_window_and_the_resolution_that_are_asked_for(
    service: Server, runs: list[dict[str, Any]]
) -> None:
    url = f"/runs/{runs[0]['id']}/map.png"
    sizes = []
    for resolution in (100, 200):
        query = {"window": [-100.0, 100.0, -100.0, 50.0], "resolution": resolution}
        answer = service.client.get(url, params=query)
        assert answer.status_code == 200, answer.text
        sizes.append(matplotlib.image.imread(io.BytesIO(answer.content), format="png").shape[:2])
    assert sizes[1] == pytest.approx(np.multiply(2.0, sizes[0]), abs=2)
    for window in ([0.0, 1.0], [0.0, 1.0, 2.0, "x"]):
        answer = service.client.get(url, params={"window": window})
        assert answer.status_code == 422
        assert answer.json()["errors"][0]["field"].startswith("window")


def test_a_scene_describes_its_parameters(service: Server) -> None:
    names = [scene["name"] for scene in service.client.get("/scenes").json()]
    assert "punch" in names
    schema = service.client.get("/scenes/punch").json()
    width = schema["properties"]["yield_stress"]
    assert width["unit"] == "MPa" and width["exclusiveMinimum"] == 0
    assert all(each["description"] for each in schema["properties"].values())
    left_out = {"smallest_element", "growth", "load_step"}
    assert {n for n, each in schema["properties"].items() if "default" not in each} == left_out


def test_health_is_ready_while_work_is_done(service: Server) -> None:
    answer = service.client.get("/health")
    assert answer.status_code == 200
    told = answer.json()
    assert told["status"] in ("ready", "waiting")
    assert told["data_writable"] and told["queue_readable"] and told["executor_alive"]
