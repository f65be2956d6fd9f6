"""Figures for Prometheus."""

from __future__ import annotations

import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from prometheus_client.parser import text_string_to_metric_families

from service.app import create_app
from service.settings import Settings
from studies import Store
from tests.service.servers import Server

STUDY = {"name": "a", "scene": "punch", "sweep": {"friction": [0.1, 0.2]}}
IDS = ("a" * 32, "b" * 32, "c" * 32)


@pytest.fixture
def client(tmp_path: Path) -> TestClient:
    """A service whose runner does not work."""
    return TestClient(
        create_app(Settings(data=tmp_path)), "http://localhost", raise_server_exceptions=False
    )


def figures(client: TestClient) -> dict[tuple[str, frozenset[tuple[str, str]]], float]:
    """Return every figure by its name and labels."""
    answer = client.get("/metrics")
    assert answer.status_code == 200 and answer.headers["content-type"].startswith("text/plain")
    families = text_string_to_metric_families(answer.text)
    return {
        (sample.name, frozenset(sample.labels.items())): sample.value
        for family in families
        for sample in family.samples
    }


def named(name: str, **labels: str) -> tuple[str, frozenset[tuple[str, str]]]:
    return name, frozenset(labels.items())


def test_queue_and_runs_are_counted(client: TestClient) -> None:
    for each in IDS:
        client.app.state.jobs.accept(each, STUDY, [])
    client.delete(f"/studies/{IDS[-1]}")
    store: Store = client.app.state.store
    row = {"id": "0" * 32, "scene": "punch", "status": "ok", "message": "", "parameters": {}}
    row |= {
        "scalars": {},
        "path": "",
        "created": "",
        "cpu_seconds": 1.0,
        "solver_source": "",
        "keep": "",
    }
    store.catalogue.put([row])
    found = figures(client)
    assert found[named("residua_studies", status="accepted")] == 2
    assert found[named("residua_studies", status="dismissed")] == 1
    assert found[named("residua_studies", status="running")] == 0
    assert found[named("residua_runs", status="ok")] == 1
    assert found[named("residua_runs", status="error")] == 0
    assert found[named("residua_data_free_bytes")] > 0
    assert found[named("residua_runner_up")] == 0
    assert found[named("process_resident_memory_bytes")] > 1e6


def test_requests_are_counted_by_their_route_not_by_their_path(client: TestClient) -> None:
    for i in range(5):
        client.get(f"/studies/{i:032x}")
        client.get(f"/runs/{i:032x}/map.png", params={"field": f"f{i}"})
        client.get(f"/nothing/{i}")
        client.request(f"METHOD{i}", "/studies")
    found = figures(client)
    count = "residua_request_seconds_count"
    counted = {labels: value for (name, labels), value in found.items() if name == count}
    assert counted == {
        named(count, method=method, route=route, status=status)[1]: 5
        for method, route, status in (
            ("GET", "/studies/{study_id}", "404"),
            ("GET", "/runs/{run_id}/map.png", "404"),
            ("GET", "other", "404"),
            ("other", "/studies", "405"),
        )
    }


def test_a_defect_counts_as_500(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("service.routes.scenes.scene_schema", lambda name: 1 / 0)
    assert client.get("/scenes/punch").status_code == 500
    wanted = named(
        "residua_request_seconds_count", method="GET", route="/scenes/{name}", status="500"
    )
    assert figures(client)[wanted] == 1


def test_two_services_in_a_process_count_apart(client: TestClient, tmp_path: Path) -> None:
    other = TestClient(create_app(Settings(data=tmp_path / "other")), "http://localhost")
    client.app.state.jobs.accept(IDS[0], STUDY, [])
    assert figures(client)[named("residua_studies", status="accepted")] == 1
    assert figures(other)[named("residua_studies", status="accepted")] == 0


def test_figures_that_cannot_be_read_are_left_out(client: TestClient, tmp_path: Path) -> None:
    (tmp_path / "jobs.sqlite").write_bytes(b"no queue" * 1000)
    found = figures(client)
    assert not {name for name, _ in found} & {"residua_studies"}
    assert named("residua_runs", status="ok") in found


def test_a_working_service_says_that_its_runner_is_up(service: Server) -> None:
    assert "residua_runner_up 1.0" in service.client.get("/metrics").text


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_threads_of_the_service_share_what_they_have_freed(service: Server) -> None:
    """Else memory grows with the number of threads that have answered at the same time.

    20 requests at once made 15 arenas. Two may be there before the limit is set.
    """
    with ThreadPoolExecutor(20) as pool:
        answers = [*pool.map(service.client.get, ["/studies"] * 40)]
    assert {each.status_code for each in answers} == {200}
    assert service.process is not None
    reserved = []  # the rest of an arena of glibc, which ends at a multiple of 64 MiB
    for line in Path(f"/proc/{service.process.pid}/maps").read_text().splitlines():
        span, mode, _, _, _, *name = line.split()
        end = int(span.partition("-")[2], 16)
        reserved += [span] if mode == "---p" and not name and end % 2**26 == 0 else []
    assert len(reserved) <= 3
