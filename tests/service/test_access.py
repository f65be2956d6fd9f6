"""Who gets in, and who does not."""

from __future__ import annotations

import asyncio
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from uuid import uuid4

import httpx
import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient

from residua.cli import main
from service.app import create_app
from service.dependencies import TheComputing
from service.keys import Keys, KeysError, Scope
from service.settings import Settings, chosen
from studies import StudyError
from tests.architecture.sources import ROOT
from tests.service.servers import (
    NOWHERE,
    Server,
    environment,
    fake_study,
    free_port,
    wait_until,
)
from tests.service.test_errors import UNKNOWN, problem

FORM = {"content-type": "application/x-www-form-urlencoded"}
RETRY = f"/studies/{UNKNOWN}/retry"
Ask = Callable[..., httpx.Response]


def asking(app: FastAPI) -> Ask:
    """Return what sends one request to an application in this process."""

    def ask(method: str, path: str, **request: Any) -> httpx.Response:
        async def answer() -> httpx.Response:
            transport = httpx.ASGITransport(app, raise_app_exceptions=False)
            async with httpx.AsyncClient(transport=transport, base_url="http://localhost") as one:
                return await one.request(method, path, **request)

        return asyncio.run(answer())

    return ask


@pytest.fixture
def here(tmp_path: Path) -> Ask:
    """A service that only this machine reaches."""
    return asking(create_app(Settings(data=tmp_path)))


@pytest.fixture
def keyed(tmp_path: Path) -> tuple[Ask, dict[str, dict[str, str]]]:
    """A service that asks for keys, and the header of a key of each scope."""
    keys = Keys(tmp_path)
    headers = {
        scope.value: {"authorization": f"Bearer {keys.add(f'my-{scope}', scope)}"}
        for scope in Scope
    }
    return asking(create_app(Settings(data=tmp_path, require_keys=True))), headers


@pytest.mark.parametrize(
    ("method", "path", "scope"),
    [
        ("GET", "/studies", "read"),
        ("GET", "/scenes", "read"),
        ("HEAD", f"/runs/{UNKNOWN}.nc", "read"),
        ("GET", "/nowhere", "read"),
        ("POST", "/studies", "submit"),
        ("POST", RETRY, "submit"),
        ("POST", "/estimate", "submit"),
        ("POST", "/scenes", "submit"),
        ("DELETE", f"/studies/{UNKNOWN}", "submit"),
        ("DELETE", f"/studies/{UNKNOWN}?purge=true", "admin"),
        ("DELETE", f"/studies/{UNKNOWN}?%70urge=true", "admin"),
        ("DELETE", f"/runs/{UNKNOWN}", "admin"),
        ("DELETE", f"/scenes/{UNKNOWN}", "admin"),
        ("PUT", "/studies", "admin"),
        ("POST", "/something/new", "admin"),
        ("DELETE", f"/studies/{UNKNOWN}%0a", "submit"),
        ("POST", "/anew%0a", "admin"),
    ],
)
def test_each_request_needs_its_scope(
    keyed: tuple[Ask, dict[str, dict[str, str]]], method: str, path: str, scope: str
) -> None:
    ask, headers = keyed
    stranger = ask(method, path)
    assert stranger.status_code == 401
    assert stranger.headers["www-authenticate"] == 'Bearer realm="residua"'
    for name, header in headers.items():
        answer = ask(method, path, headers=header)
        if Scope(name).covers(Scope(scope)):
            assert answer.status_code not in (401, 403)
        else:
            assert f"scope {scope}" in problem(answer, 403)["detail"]
            assert f'scope="{scope}"' in answer.headers["www-authenticate"]


@pytest.mark.parametrize(
    "header", ["", "Bearer", "Bearer ", "Bearer wrong", "Basic {}", "{}", "Bearer x{}", "Bearer é"]
)
def test_only_the_whole_key_counts(
    keyed: tuple[Ask, dict[str, dict[str, str]]], header: str
) -> None:
    ask, headers = keyed
    text = headers["admin"]["authorization"].removeprefix("Bearer ")
    given = {"authorization": header.format(text).encode()}
    answer = ask("GET", "/studies", headers=given)
    problem(answer, 401)
    assert text not in answer.text
    assert ask("GET", "/studies", headers={"authorization": f"bearer  {text}"}).is_success


def test_a_key_in_the_address_is_none(keyed: tuple[Ask, dict[str, dict[str, str]]]) -> None:
    ask, headers = keyed
    text = headers["admin"]["authorization"].removeprefix("Bearer ")
    for name in ("key", "api_key", "access_token"):
        problem(ask("GET", f"/studies?{name}={text}"), 401)


def test_a_stranger_learns_whether_the_service_is_well_and_what_it_offers(
    keyed: tuple[Ask, dict[str, dict[str, str]]],
) -> None:
    ask, headers = keyed
    assert ask("GET", "/health").json() == {"status": "failing"}, "no runner is at work"
    assert "executor_alive" in ask("GET", "/health", headers=headers["read"]).json()
    problem(ask("GET", "/health", headers={"authorization": "Bearer wrong"}), 401)
    paths = ask("GET", "/openapi.json").json()["paths"]
    assert "security" in paths["/studies"]["get"] and "security" not in paths["/health"]["get"]


def test_keys_count_as_soon_as_they_are_made_and_no_longer_than_they_are_kept(
    keyed: tuple[Ask, dict[str, dict[str, str]]], tmp_path: Path
) -> None:
    ask, headers = keyed
    header = {"authorization": f"Bearer {Keys(tmp_path).add('late', Scope.READ)}"}
    assert ask("GET", "/studies", headers=header).is_success
    Keys(tmp_path).remove("late")
    problem(ask("GET", "/studies", headers=header), 401)
    (tmp_path / "keys.json").write_text("{")
    detail = problem(ask("GET", "/studies", headers=headers["admin"]), 503)["detail"]
    assert "keys.json" in detail and str(tmp_path) not in detail
    (tmp_path / "keys.json").unlink()
    problem(ask("GET", "/studies", headers=headers["admin"]), 401)


def test_the_file_of_keys_holds_none_and_is_for_its_owner(tmp_path: Path) -> None:
    keys = Keys(tmp_path)
    texts = [keys.add(name, Scope.READ) for name in ("a", "b")]
    assert keys.path.stat().st_mode & 0o777 == 0o600
    assert not [text for text in texts if text in keys.path.read_text()]
    assert len(set(texts)) == 2 and all(len(text) == 8 + 43 for text in texts), "256 bits"
    assert [path.name for path in tmp_path.iterdir()] == ["keys.json"]


def test_the_command_makes_lists_and_removes_keys(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    data = ["--data", str(tmp_path / "new")]
    assert main(["keys", "add", "me", "--scope", "submit", *data]) == 0
    text = capsys.readouterr().out.strip()
    assert Keys(tmp_path / "new").owner(text) == ("me", Scope.SUBMIT)
    assert main(["keys", "list", *data]) == 0
    listed = capsys.readouterr().out
    assert listed.split()[:2] == ["me", "submit"] and text not in listed
    for arguments in (["add", "me", "--scope", "read"], ["add", "a b", "--scope", "read"]):
        assert main(["keys", *arguments, *data]) == 2
    assert main(["keys", "remove", "you", *data]) == 2
    assert "there are: me" in capsys.readouterr().err
    monkeypatch.setenv("RESIDUA_DATA", data[1])
    monkeypatch.setenv("RESIDUA_SCHEDULER_KEY", "not made yet")
    assert main(["keys", "remove", "me"]) == 0
    assert Keys(tmp_path / "new").all() == {}


@pytest.mark.parametrize(
    ("asked", "settings"),
    [
        (False, {}),
        (False, {"host": "localhost"}),
        (False, {"host": "::1"}),
        (True, {"host": "0.0.0.0"}),
        (True, {"host": "::"}),
        (True, {"host": "192.0.2.7"}),
        (True, {"host": "example.org"}),
        (True, {"require_keys": True}),
    ],
)
def test_where_others_get_in_a_service_without_keys_is_refused(
    tmp_path: Path, asked: bool, settings: dict[str, Any]
) -> None:
    chosen = Settings(data=tmp_path, **settings)
    assert chosen.keys_required is asked
    if asked:
        with pytest.raises(KeysError, match=r"residua keys add NAME --scope admin --data "):
            create_app(chosen)
    else:
        assert asking(create_app(chosen))("GET", "/studies").is_success


def test_a_refusal_is_one_line(tmp_path: Path) -> None:
    serve = [sys.executable, "-m", "residua", "serve", "--host", "0.0.0.0"]
    ended = subprocess.run(
        [*serve, "--port", str(free_port()), "--data", str(tmp_path / "my data")],
        env=environment(tmp_path / "log"),
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    (line,) = ended.stderr.splitlines()
    assert ended.returncode == 2
    assert line.endswith(f"residua keys add NAME --scope admin --data '{tmp_path}/my data'")


@pytest.mark.parametrize(
    "host",
    ["evil.example", "evil.example:8000", "localhost.evil.example", "0x7f.1", "", "[::1", "a@b"],
)
def test_a_foreign_host_name_is_not_served(here: Ask, host: str) -> None:
    problem(here("GET", "/studies", headers={"host": host}), 421)


@pytest.mark.parametrize(
    "host", ["localhost", "LOCALHOST:8000", "localhost.", "127.0.0.1:1", "[::1]:8000", "192.0.2.7"]
)
def test_names_of_this_machine_and_addresses_are_served(here: Ask, host: str) -> None:
    assert here("GET", "/studies", headers={"host": host}).is_success


def test_two_host_names_are_one_too_many(here: Ask) -> None:
    both = [("host", "localhost"), ("host", "evil.example")]
    problem(here("GET", "/studies", headers=both), 421)


def test_host_names_are_a_setting(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RESIDUA_ALLOWED_HOSTS", "a.example, b.example")
    ask = asking(create_app(Settings(data=tmp_path)))
    for name, status in (("a.example", 200), ("b.example:80", 200), ("c.example", 421)):
        assert ask("GET", "/studies", headers={"host": name}).status_code == status


FOREIGN = [
    {"origin": "http://evil.example"},
    {"origin": "null"},
    {"origin": "http://localhost:3000"},
    {"sec-fetch-site": "cross-site"},
    {"sec-fetch-site": "same-site", "origin": "http://localhost"},
]


@pytest.mark.parametrize("page", FOREIGN)
@pytest.mark.parametrize("method", ["POST", "DELETE"])
def test_a_page_of_another_site_changes_nothing(
    here: Ask, page: dict[str, str], method: str
) -> None:
    path = RETRY if method == "POST" else f"/studies/{UNKNOWN}"
    problem(here(method, path, headers=page), 403)
    problem(here("POST", RETRY, headers=page | FORM), 403)


@pytest.mark.parametrize(
    "page",
    [
        {},
        FORM,  # what `curl --data ''` sends
        {"origin": "http://localhost"},
        {"origin": "http://elsewhere", "sec-fetch-site": "same-origin"},
        {"sec-fetch-site": "none"},
    ],
)
def test_our_own_page_and_programs_may_retry(here: Ask, page: dict[str, str]) -> None:
    problem(here("POST", RETRY, headers=page), 404)


@pytest.mark.parametrize("kind", ["application/json; charset=utf-8", "Application/JSON"])
def test_json_is_taken_under_each_of_its_names(here: Ask, kind: str) -> None:
    answer = here("POST", "/studies", content=b"[]", headers={"content-type": kind})
    problem(answer, 422)  # it was read


def test_a_body_without_a_type_is_refused(here: Ask) -> None:
    async def pieces() -> Any:
        yield b"{}"

    for content in (b"{}", pieces()):
        problem(here("POST", "/studies", content=content), 415)
    problem(here("POST", RETRY, content=b"x=1", headers=FORM), 415)


def test_every_answer_tells_browsers_what_they_may_do(tmp_path: Path) -> None:
    def broken() -> None:
        raise RuntimeError("a secret")

    app = create_app(Settings(data=tmp_path))
    app.add_api_route("/broken", broken)
    ask = asking(app)
    answers = {path: ask("GET", path) for path in ("/studies", "/nowhere", "/docs", "/broken")}
    answers["wrong host"] = ask("GET", "/studies", headers={"host": "evil.example"})
    assert answers["/broken"].status_code == 500
    for answer in answers.values():
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert answer.headers["referrer-policy"] == "no-referrer"
        policy = answer.headers["content-security-policy"]
        assert "frame-ancestors 'none'" in policy
        assert ("'self'" in policy) is (answer is answers["/docs"])


@pytest.fixture(scope="module")
def behind(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A service behind a proxy that strips the root path; it asks for keys, and computes nothing.

    To be ready it has been asked for /health, as a proxy does.
    """
    own = {
        "RESIDUA_ROOT_PATH": "/lab/residua",
        "RESIDUA_REQUIRE_KEYS": "true",
        "RESIDUA_FORWARDED_ALLOW_IPS": "127.0.0.1",
    }
    server = Server(tmp_path_factory.mktemp("behind"), settings=NOWHERE | own)
    Keys(server.data).add("first", Scope.READ)
    yield server.start()
    server.close()


def logged(server: Server) -> str:
    """Return the log of a service with a line for each request that was answered."""
    last = uuid4().hex
    server.client.get("/health", headers={"x-request-id": last})
    log = server.home / "service.log"
    wait_until(lambda: f"request={last}" in log.read_text())
    return log.read_text()


def test_a_root_path_is_part_of_every_address_given_out(behind: Server) -> None:
    assert problem(behind.client.get("/studies"), 401)["instance"] == "/lab/residua/studies"
    key = {"authorization": f"Bearer {Keys(behind.data).add('other', Scope.SUBMIT)}"}
    answer = behind.client.post("/studies", json=fake_study("rooted"), headers=key)
    assert answer.headers["location"].startswith("/lab/residua/studies/")
    (server,) = behind.client.get("/openapi.json").json()["servers"]
    assert server == {"url": "/lab/residua"}


def test_names_of_hosts_have_no_case(tmp_path: Path) -> None:
    app = create_app(Settings(data=tmp_path, allowed_hosts=("Residua.Example.org",)))
    for name in ("residua.example.org", "RESIDUA.example.ORG"):
        assert TestClient(app, f"http://{name}").get("/scenes").status_code == 200


@pytest.mark.parametrize(
    ("name", "value"),
    [("WORKER_MEMORY", "4 grams"), ("SCHEDULER", "tls://127.0.0.1:1")],
)
def test_what_studies_would_be_refused_for_is_refused_at_the_start(
    name: str, value: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(f"RESIDUA_{name}", value)
    with pytest.raises(StudyError):
        chosen()


def test_a_forged_address_does_not_reach_the_log(service: Server, behind: Server) -> None:
    """That of a proxy which the service knows does."""
    forged = {"x-forwarded-for": "203.0.113.9", "x-forwarded-proto": "https"}
    for server, told in ((service, False), (behind, True)):
        server.client.get("/scenes", headers=forged)
        log = logged(server)
        assert "/scenes" in log and ("203.0.113.9" in log) is told


def test_the_client_command_sends_its_key_and_no_error_shows_it(
    behind: Server, tmp_path: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    text = Keys(behind.data).add("me", Scope.READ)
    url = ["--url", f"http://127.0.0.1:{behind.port}"]
    assert main(["status", UNKNOWN, *url]) == 2
    assert "API key" in capsys.readouterr().err
    file = tmp_path / "key"
    file.write_text(text + "\n")
    for environ, arguments in ((text, []), ("", ["--api-key-file", str(file)])):
        monkeypatch.setenv("RESIDUA_API_KEY", environ)
        assert main(["status", UNKNOWN, *url, *arguments]) == 2
        assert f"no study has the id {UNKNOWN}" in capsys.readouterr().err
        assert main(["cancel", UNKNOWN, *url, *arguments]) == 2
        assert "scope submit" in capsys.readouterr().err
    assert main(["status", UNKNOWN, *url, "--api-key-file", text]) == 2
    monkeypatch.setenv("RESIDUA_API_KEY", f"{text}é")
    assert main(["status", UNKNOWN, *url]) == 2
    assert text not in capsys.readouterr().err
    assert text not in logged(behind)


def test_an_address_has_no_name_that_a_key_may_have(tmp_path: Path) -> None:
    names = []
    app = create_app(Settings(data=tmp_path))

    async def told(share: TheComputing) -> None:
        names.append(share.caller)

    app.add_api_route("/me", told)
    assert asking(app)("GET", "/me").status_code == 200
    with pytest.raises(StudyError, match="letters, digits"):
        Keys(tmp_path).add(names[0], Scope.READ)
