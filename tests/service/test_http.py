"""HTTP by the book: methods, tags, parts, and the page that describes the service."""

from __future__ import annotations

import re
import socket
from typing import Any

import httpx
import pytest

from tests.service.servers import Server, fake_study
from tests.service.test_errors import UNKNOWN, problem


@pytest.fixture(scope="module")
def done(service: Server) -> dict[str, Any]:
    """A study that was computed."""
    return service.finished(service.post(fake_study("by-the-book")))


@pytest.fixture(scope="module")
def files(done: dict[str, Any]) -> dict[str, str]:
    """The paths that are answered with a tag."""
    run = done["runs"][0]["id"]
    return {
        "dataset": f"/studies/{done['id']}/dataset.nc",
        "run": f"/runs/{run}.nc",
        "map": f"/runs/{run}/map.png",
    }


@pytest.mark.parametrize("kind", ["dataset", "run", "map"])
@pytest.mark.parametrize("header", ["{0}", "W/{0}", '"other", W/"more", {0}', "*"])
def test_what_the_client_has_is_not_sent_again(
    service: Server, files: dict[str, str], kind: str, header: str
) -> None:
    tag = service.client.get(files[kind]).headers["etag"]
    answer = service.client.get(files[kind], headers={"if-none-match": header.format(tag)})
    assert (answer.status_code, answer.content, answer.headers["etag"]) == (304, b"", tag)


@pytest.mark.parametrize("kind", ["dataset", "run", "map"])
def test_what_the_client_has_not_is_sent(service: Server, files: dict[str, str], kind: str) -> None:
    whole = service.client.get(files[kind])
    answer = service.client.get(files[kind], headers={"if-none-match": '"other", W/"more"'})
    assert (answer.status_code, answer.content) == (200, whole.content)


def test_a_file_unchanged_since_a_date_is_not_sent_again(
    service: Server, files: dict[str, str]
) -> None:
    date = service.client.get(files["dataset"]).headers["last-modified"]
    same = service.client.get(files["dataset"], headers={"if-modified-since": date})
    old = {"if-modified-since": "Mon, 01 Jan 2024 00:00:00 GMT"}
    assert same.status_code == 304
    assert service.client.get(files["dataset"], headers=old).status_code == 200
    tagged = old | {"if-none-match": service.client.get(files["dataset"]).headers["etag"]}
    assert service.client.get(files["dataset"], headers=tagged).status_code == 304


def test_a_part_is_sent_only_of_the_file_the_client_knows(
    service: Server, files: dict[str, str]
) -> None:
    whole = service.client.get(files["dataset"])
    part = {"range": "bytes=8-15"}
    same, other = (
        service.client.get(files["dataset"], headers=part | {"if-range": tag})
        for tag in (whole.headers["etag"], '"other"')
    )
    assert (same.status_code, same.content) == (206, whole.content[8:16])
    assert (other.status_code, other.content) == (200, whole.content)


@pytest.mark.parametrize("part", ["bytes=999999999-", "bytes=-0"])
def test_a_part_that_is_not_there_is_a_problem(
    service: Server, files: dict[str, str], part: str
) -> None:
    size = service.client.head(files["dataset"]).headers["content-length"]
    answer = service.client.get(files["dataset"], headers={"range": part})
    problem(answer, 416)
    assert answer.headers["content-range"] == f"bytes */{size}"


def test_every_path_names_its_methods(service: Server) -> None:
    paths = service.client.get("/openapi.json").json()["paths"]
    assert len(paths) > 10
    for path, operations in paths.items():
        url = re.sub(r"{.*?_id}", UNKNOWN, path).replace("{name}", "punch")
        expected = {method.upper() for method in operations} | {"OPTIONS"}
        expected |= {"HEAD"} if "GET" in expected else set()
        options, refused = service.client.options(url), service.client.patch(url)
        assert (options.status_code, options.content) == (204, b"")
        problem(refused, 405)
        for answer in (options, refused):
            assert set(answer.headers["allow"].split(", ")) == expected, path


@pytest.mark.parametrize(
    "path", ["/health", "/studies", "/runs", "/scenes", "/scenes/punch", "/docs", "/openapi.json"]
)
def test_head_is_get_without_the_body(service: Server, path: str) -> None:
    get, head = service.client.get(path), service.client.head(path)
    assert (head.status_code, head.content) == (200, b"")
    for name in ("content-type", "content-length"):
        assert head.headers[name] == get.headers[name]


def test_head_of_an_event_stream_ends(service: Server) -> None:
    study_id = service.post(fake_study("endless", seconds=10.0))
    head = service.client.head(f"/studies/{study_id}/events", timeout=15.0)
    assert head.status_code == 200
    assert head.headers["content-type"].startswith("text/event-stream")
    service.client.delete(f"/studies/{study_id}")


def test_what_is_no_http_is_a_problem(service: Server) -> None:
    with socket.create_connection(("127.0.0.1", service.port)) as connection:
        connection.sendall(b"GET / HTTP/9\r\n\r\n")
        head, _, body = connection.makefile("rb").read().partition(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 400 ") and b"application/problem+json" in head
    assert b'"status": 400' in body


def test_the_page_of_the_description_needs_nothing_from_elsewhere(service: Server) -> None:
    page = service.client.get("/docs")
    assert page.headers["content-type"].startswith("text/html")
    assert "//" not in page.text, "no other host"
    assert not re.search(r"<script[^>]*>[^<]", page.text), "no script in the page itself"
    links = re.findall(r'(?:src|href)="([^"]+)"', page.text)
    assert len(links) == 4
    for link in links:
        url = httpx.URL("http://host/docs").join(link).path
        answer = service.client.get(url)
        assert answer.status_code == 200 and answer.content, url
        kind = {"js": "javascript", "css": "text/css", "png": "image/png"}[link.rpartition(".")[2]]
        assert kind in answer.headers["content-type"]
