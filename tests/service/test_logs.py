"""Every line of the log says what it is about, and none holds what is secret."""

from __future__ import annotations

import json
import logging
import logging.config
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from service import logs
from service.app import check_port, create_app, serve
from service.settings import Settings
from studies import StoreFull
from studies.execution.executor import Limits
from studies.execution.forks import SHARED
from studies.execution.grid import Grid
from studies.execution.workers import own_workers
from tests.architecture.sources import ROOT
from tests.service.servers import Server, fake_study

ID = "0" * 32


@pytest.fixture
def client(tmp_path: Path) -> TestClient:
    """A service whose runner does not work."""
    return TestClient(
        create_app(Settings(data=tmp_path)), "http://localhost", raise_server_exceptions=False
    )


def lines(text: str) -> list[dict[str, Any]]:
    """Return the lines that are objects of JSON."""
    return [json.loads(line) for line in text.splitlines() if line.startswith("{")]


@pytest.mark.parametrize("given", ["run-7.B_x", "0" * 64])
def test_a_plain_request_id_is_kept(client: TestClient, given: str) -> None:
    answer = client.get("/scenes", headers={"x-request-id": given})
    assert answer.headers["x-request-id"] == given


@pytest.mark.parametrize("given", ["", "a b", "a\tb", "0" * 65, 'a"b', "a;b", "ü".encode()])
def test_any_other_request_id_is_replaced(client: TestClient, given: str | bytes) -> None:
    answers = [client.get("/scenes", headers={"x-request-id": given}) for _ in range(2)]
    first, second = (answer.headers["x-request-id"] for answer in answers)
    assert first != second and len(first) == len(second) == 32


def test_refusals_and_defects_have_a_request_id(
    client: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("service.routes.scenes.scene_schema", lambda name: 1 / 0)
    for path, status in (("/nothing", 404), ("/runs/x", 422), ("/scenes/punch", 500)):
        answer = client.get(path, headers={"x-request-id": "mine"})
        assert (answer.status_code, answer.headers["x-request-id"]) == (status, "mine")


def test_the_access_log_holds_neither_query_nor_headers(
    client: TestClient, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, logger="service.access")
    headers = {"authorization": "Bearer hunter2", "x-api-key": "hunter2"}
    client.get(f"/runs/{ID}?field=hunter2", headers=headers)
    client.get("/a%0aINFO%20forged" + "b" * 1000)
    client.get("/runs/x%0aINFO%20forged")
    (first, second, third) = (r for r in caplog.records if r.name == "service.access")
    assert vars(first) | {"method": "GET", "status": 404, "run": ID} == vars(first)
    assert first.path == f"/runs/{ID}" and first.milliseconds > 0
    assert "hunter2" not in repr(vars(first))
    assert len(second.path) == 200 and "\n" not in second.getMessage()
    assert "forged" in third.path and "\n" not in third.getMessage() and "run" not in vars(third)


def test_a_line_carries_the_ids_of_process_and_call(capfd: pytest.CaptureFixture[str]) -> None:
    program = (
        "import sys, logging, warnings; from service import logs\n"
        "logs.configure(sys.argv[1], study='s'); log = logging.getLogger('a')\n"
        "log.warning('one %d', 1, extra={'run': 'r'}); warnings.warn('careful')\n"
        "raise ValueError('late')"
    )
    for form in ("plain", "json"):
        subprocess.run([sys.executable, "-c", program, form], cwd=ROOT, check=False)
    text = capfd.readouterr().err
    plain = [line for line in text.splitlines() if line.endswith(" study=s run=r")]
    assert len(plain) == 1 and "WARNING a: one 1" in plain[0]
    first, warning, last = lines(text)
    assert first.pop("time").endswith("+00:00")
    assert first == {
        "level": "WARNING", "logger": "a", "message": "one 1", "study": "s", "run": "r",
    }  # fmt: skip
    assert "careful" in warning["message"] and warning["study"] == "s"
    assert "ValueError: late" in last["exc_info"] and last["level"] == "CRITICAL"


def test_a_service_writes_json_lines_for_itself_and_its_children(tmp_path: Path) -> None:
    server = Server(tmp_path / "home", settings={"RESIDUA_LOG_FORMAT": "json"}).start()
    try:
        study_id = server.post(fake_study("logged"))
        run_ids = {run["id"] for run in server.finished(study_id)["runs"]}
        server.client.get(f"/studies/{study_id}", headers={"x-request-id": "mine"})
        server.stop()
    finally:
        server.close()
    text = (server.home / "service.log").read_text()
    found = lines(text)
    assert len(found) == len(text.splitlines())
    assert all({"time", "level", "logger", "message"} <= line.keys() for line in found)
    asked = [line for line in found if line.get("request") == "mine"]
    assert [(line["study"], line["status"]) for line in asked] == [(study_id, 200)]
    told = [line for line in found if line["logger"] == "service.child"]
    assert {line["run"] for line in told} == run_ids
    assert {line["study"] for line in told} == {study_id}


def test_an_unknown_form_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("RESIDUA_LOG_FORMAT", "xml")
    with pytest.raises(SystemExit) as ended:
        serve("127.0.0.1", 0, tmp_path)
    assert ended.value.code == 2 and "RESIDUA_LOG_FORMAT" in capsys.readouterr().err


def test_a_port_in_use_is_told_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        with pytest.raises(SystemExit) as ended:
            check_port("127.0.0.1", port)
    assert ended.value.code == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert f"port = {port}" in told
    assert "--port" in told
    check_port("127.0.0.1", 0)


LOST = """
import logging
import distributed
from service import logs
logs.configure("json", study="a")
for name in ("distributed.client", "asyncio", "service"):
    try:
        try:
            raise ConnectionRefusedError("refused")
        except OSError as error:
            raise distributed.comm.CommClosedError("in a connection") from error
    except OSError:
        logging.getLogger(name).exception("lost")
try:
    1 / 0
except ZeroDivisionError:
    logging.getLogger("service").exception("a defect")
"""


def test_a_lost_connection_to_workers_is_one_line_without_a_traceback() -> None:
    run = subprocess.run(
        [sys.executable, "-c", LOST], cwd=ROOT, capture_output=True, text=True, check=True
    )
    *lost, defect = lines(run.stderr)
    assert len(run.stderr.splitlines()) == 4, run.stderr
    assert {each["message"] for each in lost} == {"lost CommClosedError: in a connection"}
    assert [each["study"] for each in lost] == ["a"] * 3 and "exc_info" not in lost[0]
    assert "Traceback" in defect["exc_info"]


FAILING = """
from studies.execution.forks import Forks
from tests.service.test_logs import fail_at_a_worker
assert Forks(()).start(fail_at_a_worker).end.poll(60)
"""


def fail(*_: object) -> None:
    """Fail as a task does that finds no room on the disk."""
    raise StoreFull("nowhere")


def fail_at_a_worker() -> None:
    """Let a task fail at a worker that is a fork of a process with the log of a service."""
    logs.configure("json")
    SHARED.prepare()
    ended: list[Any] = []
    with own_workers(1) as access, Grid(access) as grid:
        grid.run(fail, [1], ended.append, lambda: False, Limits(), 0)
    print(repr(ended[0].error), flush=True)


@pytest.mark.processes
def test_an_error_of_a_task_is_answered_and_not_logged_by_its_worker_too() -> None:
    run = subprocess.run(
        [sys.executable, "-c", FAILING], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert run.stdout == "StoreFull('nowhere')\n"
    assert "distributed.worker" not in run.stderr
