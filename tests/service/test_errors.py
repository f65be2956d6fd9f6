"""What is refused, and how it is said."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi import FastAPI, Request
from starlette.exceptions import HTTPException

from service import turns
from service.app import create_app
from service.errors import STATUS, on_field_error, on_http_error, shown
from service.middleware import StrictRequest
from service.settings import Settings
from studies import Study, StudyError
from studies.errors import SceneError
from tests.service.servers import Server, fake_study
from tests.studies.mistakes import MISTAKES

UNKNOWN = "0" * 32


def problem(answer: httpx.Response, status: int) -> dict[str, Any]:
    """Return the problem document of an answer that must be one."""
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    document: dict[str, Any] = answer.json()
    assert set(document) == {"type", "title", "status", "detail", "instance", "errors"}
    assert document["status"] == status
    return document


def changed(**parts: Any) -> dict[str, Any]:
    """Return a good study with some parts replaced."""
    return fake_study("bad") | parts


def sendable(mistake: tuple[Any, str, str]) -> bool:
    """Whether JSON has all numbers of a study; a body that is no table is refused as such."""
    try:
        return mistake[1] != "study" and len(json.dumps(mistake[0], allow_nan=False)) < 400
    except ValueError:
        return False


@pytest.mark.parametrize(("study", "field", "allowed"), [*filter(sendable, MISTAKES)])
def test_a_bad_study_is_refused_as_in_python(
    service: Server, study: dict[str, Any], field: str, allowed: str
) -> None:
    with pytest.raises(StudyError) as caught:
        Study.from_dict(study)
    body = json.dumps(study).encode()
    answer = service.client.post("/studies", content=body, headers=JSON)
    (error,) = problem(answer, 422)["errors"]
    assert (error["field"], error["value"]) == (field, shown(caught.value.value))
    assert allowed in error["allowed"]


JSON = {"content-type": "application/json"}


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e999", "1" + "0" * 400])
def test_numbers_that_are_not_finite_are_refused(service: Server, number: str) -> None:
    body = json.dumps(changed(sweep={"friction": ["?"]})).replace('"?"', number)
    answer = service.client.post("/studies", content=body, headers=JSON)
    (error,) = problem(answer, 422)["errors"]
    assert error["field"] == "sweep.friction[0]"


def test_a_sweep_of_a_thousand_million_points_is_refused_before_it_is_expanded(
    service: Server,
) -> None:
    axis = [i / 1000 for i in range(1, 1001)]
    study = changed(sweep={"friction": axis, "load_ratio": axis, "seconds": axis})
    (error,) = problem(service.client.post("/studies", json=study), 422)["errors"]
    assert error["field"] == "sweep" and "1000000000" in error["value"]


@pytest.mark.parametrize(
    "body",
    [b"{", b'{"name": "a",}', b"\xff\xfe", b"9" * 10_000, b"\x1f\x8b"],
    ids=["open", "comma", "bytes", "digits", "packed"],
)
def test_a_body_that_is_not_json_is_refused(service: Server, body: bytes) -> None:
    answer = service.client.post("/studies", content=body, headers=JSON)
    (error,) = problem(answer, 400)["errors"]
    assert error["field"] == "body" and "JSON" in error["allowed"]


@pytest.mark.parametrize("levels", [50, 51, 100_000])
def test_the_depth_of_a_body_is_limited_and_told(levels: int) -> None:
    async def receive() -> dict[str, object]:
        body = b'{"a": ' + b"[" * (levels - 1) + b"1" + b"]" * (levels - 1) + b"}"
        return {"type": "http.request", "body": body}

    read = StrictRequest({"type": "http", "headers": []}, receive).json()
    if levels == 50:
        assert list(asyncio.run(read)) == ["a"]
    else:
        with pytest.raises(StudyError, match=f"{levels} deep; at most 50 are allowed"):
            asyncio.run(read)


@pytest.mark.parametrize("body", [b"", b"[]", b'"text"', b"3", b"null"])
def test_a_body_that_is_no_table_is_refused(service: Server, body: bytes) -> None:
    answer = service.client.post("/studies", content=body, headers=JSON)
    (error,) = problem(answer, 422)["errors"]
    assert error["field"] == "body" and "JSON object" in error["allowed"]


@pytest.mark.parametrize(
    "kind", ["text/plain", "application/x-www-form-urlencoded", "multipart/form-data", "?"]
)
def test_a_study_sent_as_something_else_is_told_its_content_type(
    service: Server, kind: str
) -> None:
    body = json.dumps(fake_study("form")).encode()
    answer = service.client.post("/studies", content=body, headers={"content-type": kind})
    assert "content-type: application/json" in problem(answer, 415)["detail"]


def test_the_name_of_a_field_is_shown_at_a_readable_length(service: Server) -> None:
    answer = service.client.post("/studies", json=changed(parameters={"k" * 100_000: 1}))
    (error,) = problem(answer, 422)["errors"]
    assert error["field"].startswith("parameters.kkk") and len(answer.content) < 3000


def test_an_answer_to_mistakes_has_less_than_a_megabyte() -> None:
    """Characters that JSON writes with twelve are the worst."""
    text = "\U0001f600" * 100_000
    mistakes = [StudyError(text, text, text)] * 5000
    whole = on_field_error(request_to("/scenes"), SceneError(text, mistakes))
    assert len(whole.body) < 1_000_000
    found = json.loads(whole.body)
    assert len(found["errors"]) == 20 and found["detail"].startswith("\U0001f600")
    answer = on_http_error(request_to("/scenes"), HTTPException(418, text))
    assert len(answer.body) < 1_000_000


def request_to(path: str) -> Request:
    return Request({"type": "http", "method": "POST", "path": path, "headers": []})


@pytest.mark.parametrize(
    "body", [b" " * 3_000_000, [b" " * 100_000] * 30], ids=["declared", "chunked"]
)
def test_a_huge_body_is_refused(service: Server, body: Any) -> None:
    try:
        answer = service.client.post("/studies", content=body, headers=JSON)
    except httpx.WriteError:
        pytest.fail("the service hung up before it answered")
    assert "1000000 bytes" in problem(answer, 413)["detail"]


@pytest.mark.parametrize("kind", ["studies", "runs"])
@pytest.mark.parametrize(
    "name",
    [
        "..%2f..%2fetc",
        "%2e%2e",
        "%00",
        "A" * 32,
        "0" * 31,
        "0" * 33,
        "0" * 32 + "%0a",
        "%C3%A9",
    ],
)
def test_an_id_of_another_form_is_refused(service: Server, kind: str, name: str) -> None:
    url = httpx.URL(f"http://127.0.0.1:{service.port}").copy_with(
        raw_path=f"/{kind}/{name}/".encode()[:-1]
    )
    answer = service.client.get(url)
    assert answer.status_code in (404, 422)
    for error in problem(answer, answer.status_code)["errors"]:
        assert error["allowed"].startswith("must be an id, 32 hexadecimal digits")


@pytest.mark.parametrize(
    "path",
    [
        "/nowhere",
        f"/studies/{UNKNOWN}",
        f"/studies/{UNKNOWN}/dataset.nc",
        f"/studies/{UNKNOWN}/events",
        f"/studies/{UNKNOWN}/sensitivity",
        f"/studies/{UNKNOWN}/fit",
        f"/studies/{UNKNOWN}/table.csv",
        f"/runs/{UNKNOWN}",
        f"/runs/{UNKNOWN}.nc",
        f"/runs/{UNKNOWN}/map.png",
        f"/runs/{UNKNOWN}/fields",
        "/scenes/pinch",
    ],
)
def test_what_does_not_exist_is_not_found(service: Server, path: str) -> None:
    assert problem(service.client.get(path), 404)["instance"] == path


def test_a_method_that_is_not_offered_is_named(service: Server) -> None:
    answer = service.client.put("/studies", json={})
    problem(answer, 405)
    assert "POST" in answer.headers["allow"] or "GET" in answer.headers["allow"]


@pytest.mark.parametrize(
    ("path", "field"),
    [
        ("/runs?limit=0", "limit"),
        ("/runs?limit=100000", "limit"),
        ("/runs?offset=-1", "offset"),
        ("/runs?offset=99999999999999999999999", "offset"),
        ("/runs?friction=nan", "friction"),
        ("/runs?friction=rough", "friction"),
        ("/runs?friction=-1", "friction"),
        ("/runs?frictoin=0.1", "frictoin"),
        ("/runs?scene=punch&traction=0.1", "traction"),
        ("/runs?traction=much", "traction"),
        ("/runs?traction=0.1&traction=0.2", "traction"),
        ("/runs?traction=" + "[" * 5000, "traction"),
        ("/runs?elastic_punch=1", "elastic_punch"),
        ("/runs?seconds=NaN", "seconds"),
        ("/runs?scene=bogus", "scene"),
        ("/runs?status=bogus", "status"),
        ("/runs?status=missing", "status"),
        ("/runs?hardening=bogus", "hardening"),
        ("/runs?scene=fake&hardening=kinematic", "hardening"),
        ("/studies?status=happy", "status"),
    ],
)
def test_a_bad_query_is_refused_by_field(service: Server, path: str, field: str) -> None:
    (error,) = problem(service.client.get(path), 422)["errors"]
    assert error["field"] == field


@pytest.mark.parametrize(
    ("query", "allowed"),
    [
        ("frictoin=0.1", ["scene, status, limit, offset, ", "did you mean friction?"]),
        ("scene=fake&traction=0.1", ["load_ratio, friction, hardening, seconds"]),
        ("scene=pinch", ["fake", "did you mean punch?"]),
        ("status=limit", ["must be one of ok, ", "limit_load", "error"]),
        ("hardening=soft", ["none, isotropic"]),
    ],
)
def test_a_bad_query_is_told_what_is_allowed(
    service: Server, query: str, allowed: list[str]
) -> None:
    (error,) = problem(service.client.get(f"/runs?{query}"), 422)["errors"]
    assert all(words in error["allowed"] for words in allowed), error


@pytest.mark.parametrize(
    ("part", "name"),
    [
        ('"sweep": {"case": {"A": {"friction": 0.1}, "A": {"friction": 0.2}}}', "A"),
        ('"sweep": {"friction": [0.1], "friction": [0.2]}', "friction"),
        ('"sweep": {}, "sweep": {}', "sweep"),
    ],
)
def test_a_name_that_occurs_twice_is_refused(service: Server, part: str, name: str) -> None:
    body = f'{{"name": "twice", "scene": "fake", {part}}}'.encode()
    (error,) = problem(service.client.post("/studies", content=body, headers=JSON), 422)["errors"]
    assert error["field"] == name and "occurs twice" in error["allowed"]


def ask(app: FastAPI, path: str, method: str = "GET", **more: Any) -> httpx.Response:
    """Return the answer of an application that runs in this process."""

    async def get() -> httpx.Response:
        transport = httpx.ASGITransport(app, raise_app_exceptions=False)
        async with httpx.AsyncClient(transport=transport, base_url="http://localhost") as client:
            return await client.request(method, path, **more)

    return asyncio.run(get())


@pytest.fixture
def app(tmp_path: Path) -> FastAPI:
    """An application that has not been started."""
    return create_app(Settings(data=tmp_path / "data"))


def test_a_defect_shows_nothing_of_its_inside(app: FastAPI) -> None:
    def broken() -> None:
        raise RuntimeError("a secret")

    app.add_api_route("/broken", broken)
    answer = ask(app, "/broken")
    problem(answer, 500)
    assert "secret" not in answer.text and "Traceback" not in answer.text


@pytest.mark.parametrize("error", [*STATUS])
def test_every_kind_of_error_has_the_status_of_the_table(
    app: FastAPI, error: type[Exception]
) -> None:
    arguments = {"FileDamaged": (Path("a"), "run a", "no seal"), "RequestValidationError": ([],)}
    arguments |= dict.fromkeys(("StudyError", "Unusable"), ("a", 1, "must be 2"))

    def failing() -> None:
        raise error(*arguments.get(error.__name__, (["reason"],)))

    app.add_api_route("/failing", failing)
    problem(ask(app, "/failing"), STATUS[error])


def test_the_description_names_every_resource_and_its_problems(app: FastAPI) -> None:
    description = json.loads(ask(app, "/openapi.json").text)
    assert {
        "/estimate",
        "/metrics",
        "/studies",
        "/studies/{study_id}",
        "/studies/{study_id}/retry",
        "/studies/{study_id}/events",
        "/studies/{study_id}/dataset.nc",
        "/studies/{study_id}/sensitivity",
        "/studies/{study_id}/fit",
        "/studies/{study_id}/log",
        "/studies/{study_id}/zarr/{key}",
        "/studies/{study_id}/audit",
        "/studies/{study_id}/predict",
        "/studies/{study_id}/table.csv",
        "/studies/{study_id}/table.json",
        "/studies/{study_id}/table.parquet",
        "/studies/{study_id}/numbers",
        "/studies/{study_id}/plot.png",
        "/runs",
        "/runs/{run_id}",
        "/runs/{run_id}.nc",
        "/runs/{run_id}.vtu",
        "/runs/{run_id}/map.png",
        "/runs/{run_id}/line.png",
        "/runs/{run_id}/fields",
        "/runs/{run_id}/values",
        "/runs/{run_id}/values.csv",
        "/scenes",
        "/scenes/{name}",
        "/scenes/{name}/draw.png",
        "/health",
    } == set(description["paths"])
    for operations in description["paths"].values():
        for operation in operations.values():
            assert "application/problem+json" in operation["responses"]["4XX"]["content"]
            refused = operation["responses"].get("422", operation["responses"]["4XX"])
            assert set(refused["content"]) == {"application/problem+json"}


def test_the_example_in_the_description_is_a_study(app: FastAPI) -> None:
    post = json.loads(ask(app, "/openapi.json").text)["paths"]["/studies"]["post"]
    schema = post["requestBody"]["content"]["application/json"]["schema"]
    own = {"name", "scene", "parameters", "sweep", "points", "sample", "goal", "note", "tags"}
    own |= {"refine", "fit", "minimise", "extends", "keep", "priority", "allow", "fatigue"}
    own |= {"derivatives", "licence", "cite", "doi", "files"}
    assert set(schema["properties"]) == own
    (example,) = schema["examples"]
    assert Study.from_dict(example).size == 4


def test_health_fails_without_executor_and_without_a_place_to_write(app: FastAPI) -> None:
    answer = ask(app, "/health")
    assert answer.status_code == 503
    assert answer.json() == {
        "status": "failing",
        "data_writable": True,
        "queue_readable": True,
        "catalogue_readable": True,
        "executor_alive": False,
        "waiting": {},
    }
    data = app.state.settings.data
    data.rename(data.with_name("elsewhere"))
    assert ask(app, "/health").json()["data_writable"] is False


def test_too_many_requests_of_a_caller_are_put_off(
    app: FastAPI, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(turns, "WAITING", 0)
    monkeypatch.setattr(app.state.computing, "seconds", 60.0)
    for path in ("/studies", "/estimate"):
        answer = ask(app, path, "POST", json={"name": "a", "scene": "punch"})
        problem(answer, 429)
        assert int(answer.headers["retry-after"]) > 0
