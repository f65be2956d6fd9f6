"""The compose file, read and acted out without containers."""

from __future__ import annotations

import contextlib
import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import httpx
import pytest
import yaml

from service.settings import Settings
from studies import open_netcdf
from studies.execution.certificates import OWNERS
from tests.architecture.sources import ROOT
from tests.service.servers import (
    PATIENCE,
    end,
    environment,
    fake_study,
    free_port,
    wait_until,
)

COMPOSE: dict[str, Any] = yaml.safe_load((ROOT / "docker-compose.yml").read_text())
SERVICES: dict[str, Any] = COMPOSE["services"]
DOCKERFILE = (ROOT / "Dockerfile").read_text()
ENTRYPOINT = json.loads(re.findall(r"^ENTRYPOINT (.*)$", DOCKERFILE, re.MULTILINE)[0])

PROGRAMS = {
    "residua": [
        sys.executable,
        "-c",
        "import sys; from residua.cli import main; sys.exit(main())",
    ],
    "dask": [sys.executable, "-m", "dask"],
    "python": [sys.executable],
}


KEYS = {
    "image", "build", "restart", "init", "command", "healthcheck", "volumes", "depends_on",
    "ports", "stop_grace_period", "environment", "read_only", "tmpfs", "security_opt", "cap_drop",
    "pids_limit", "mem_limit", "cpus", "logging", "entrypoint", "networks",
}  # fmt: skip
DURATION = re.compile(r"\d+s")
SIZE = re.compile(r"\d+[mg]")
LASTING = ["scheduler", "worker", "service"]


def interpolated(text: str) -> str:
    """Return a text of the file as the engine reads it when no variable is set."""
    return re.sub(r"\$\{\w+:-([^}]*)\}", r"\1", text)


def test_the_file_keeps_to_the_compose_specification() -> None:
    assert set(COMPOSE) == {
        "name", "x-residua", "x-check", "services", "networks", "volumes",
    }  # fmt: skip
    assert set(SERVICES) == {"certificates", *LASTING}
    for name, service in SERVICES.items():
        assert set(service) <= KEYS
        words = service["command"] + service.get("entrypoint", [])
        assert all(isinstance(word, str) for word in words)
        check = service["healthcheck"]
        if name == "certificates":
            assert check == {"disable": True}
            continue
        assert set(check) == {"test", "interval", "timeout", "start_period", "retries"}
        assert isinstance(check["retries"], int)
        spans = [check["interval"], check["timeout"], check["start_period"]]
        assert all(DURATION.fullmatch(span) for span in spans)


@pytest.mark.parametrize("name", SERVICES)
def test_no_container_can_do_more_than_it_needs(name: str) -> None:
    service = SERVICES[name]
    assert service["read_only"] is True and service["cap_drop"] == ["ALL"]
    assert service["security_opt"] == ["no-new-privileges:true"]
    assert "privileged" not in service and "cap_add" not in service
    (tmpfs,) = service["tmpfs"]
    assert re.fullmatch(r"/tmp:size=\d+m", tmpfs)
    assert SIZE.fullmatch(interpolated(service["mem_limit"]))
    assert service["cpus"] > 0 and service["pids_limit"] <= 512
    assert service["logging"]["driver"] == "json-file"
    assert SIZE.fullmatch(service["logging"]["options"]["max-size"])
    assert int(service["logging"]["options"]["max-file"]) > 1


@pytest.mark.parametrize("name", LASTING)
def test_what_answers_no_more_is_ended_and_so_restarted(name: str) -> None:
    """The watch asks where the health check asks; `test_watched` shows what it does."""
    watch, script, url = SERVICES[name].get("entrypoint", ENTRYPOINT)
    assert (watch, script) == ("python", "/usr/local/lib/watched.py")
    assert f"urlopen('{url}'" in SERVICES[name]["healthcheck"]["test"][-1]
    assert f"COPY docker/watched.py {script}\n" in DOCKERFILE
    assert "NUMBA_CACHE_DIR=/app/kernels python" in DOCKERFILE  # `watched` copies them from there
    assert SERVICES[name]["restart"] == "always"


@pytest.mark.parametrize("name", LASTING)
def test_every_service_restarts_and_is_watched(name: str) -> None:
    service = SERVICES[name]
    assert service["restart"] == "always"
    assert service["healthcheck"]["test"][0] == "CMD"
    assert {"interval", "timeout", "retries", "start_period"} <= set(service["healthcheck"])
    assert service["image"] == "residua" and service["build"]["context"] == "."


def test_only_the_service_is_reachable_from_outside() -> None:
    assert {name for name, service in SERVICES.items() if "ports" in service} == {"service"}
    (port,) = SERVICES["service"]["ports"]
    assert interpolated(port) == "127.0.0.1:8000:8000"
    assert not [name for name, service in SERVICES.items() if "network_mode" in service]
    networks = {name: service["networks"] for name, service in SERVICES.items()}
    assert networks.pop("service") == ["inside", "outside"]
    assert set(map(tuple, networks.values())) == {("inside",)}
    assert COMPOSE["networks"]["inside"] == {"internal": True}, "without a way out"


def test_callers_need_keys_wherever_the_port_is_published(tmp_path: Path) -> None:
    """Also where somebody writes ``ports: 8000:8000``; no variable of the file turns it off."""
    command = SERVICES["service"]["command"]
    host = command[command.index("--host") + 1]
    for given in ({}, {"require_keys": False}):
        assert Settings(data=tmp_path, host=host, **given).keys_required


def test_only_who_has_a_certificate_reaches_the_scheduler_and_sees_no_other_key() -> None:
    command = SERVICES["certificates"]["command"]
    folder = command[command.index("--out") + 1]
    assert folder == "/certificates"
    assert set(SERVICES["certificates"]["volumes"]) == {
        f"{name}-certificate:{folder}/{name}" for name in LASTING
    }
    assert set(LASTING) == set(OWNERS)
    files = [f"{folder}/{name}.pem" for name in ("ca", "cert", "key")]
    for name in ("scheduler", "worker"):
        words = SERVICES[name]["command"]
        options = [words[words.index(o) + 1] for o in ("--tls-ca-file", "--tls-cert", "--tls-key")]
        assert options == files
    assert "--protocol tls" in " ".join(SERVICES["scheduler"]["command"])
    settings = SERVICES["service"]["environment"]
    assert [settings[f"RESIDUA_SCHEDULER_{each}"] for each in ("CA", "CERT", "KEY")] == files
    for name in LASTING:
        mounted = [each for each in SERVICES[name]["volumes"] if folder in each]
        assert mounted == [f"{name}-certificate:{folder}:ro"]


def test_no_page_of_dask_is_reachable_from_other_containers() -> None:
    for name in ("scheduler", "worker"):
        words = SERVICES[name]["command"]
        assert words[words.index("--dashboard-address") + 1].startswith("127.0.0.1:")


def test_workers_and_service_see_the_data_under_the_same_path() -> None:
    for name in ("worker", "service"):
        assert SERVICES[name]["volumes"][0] == "data:/data"
    assert set(COMPOSE["volumes"]) == {"data", *(f"{name}-certificate" for name in LASTING)}
    command = SERVICES["service"]["command"]
    assert command[command.index("--data") + 1] == "/data"


def test_workers_can_be_multiplied() -> None:
    assert not {"container_name", "hostname", "ports"} & set(SERVICES["worker"])


def test_who_needs_the_scheduler_waits_for_its_health() -> None:
    for name in ("worker", "service"):
        assert SERVICES[name]["depends_on"] == {"scheduler": {"condition": "service_healthy"}}
        (address,) = [word for word in SERVICES[name]["command"] if "://" in word]
        scheduler = SERVICES["scheduler"]["command"]
        assert address == f"tls://scheduler:{scheduler[scheduler.index('--port') + 1]}"


CONFIGURATION = """
import json, dask, distributed
from studies.execution.access import CONFIGURATION as own
names = [name for name in own if name.startswith("distributed.scheduler.")]
known = dask.config.merge(*dask.config.defaults)
print(json.dumps({name: [own[name], dask.config.get(name)] for name in names
                  if dask.config.get(name, None, config=known) is not None}))
"""


def test_the_scheduler_is_configured_like_that_of_the_services_own_workers() -> None:
    given = SERVICES["scheduler"]["environment"]
    assert all(isinstance(value, str) for value in given.values())
    found = json.loads(
        subprocess.run(
            [sys.executable, "-c", CONFIGURATION],
            env=os.environ | {"PYTHONPATH": str(ROOT)} | given,
            capture_output=True,
            check=True,
        ).stdout
    )
    assert found == {
        "distributed.scheduler.allowed-failures": [1, 1],
        "distributed.scheduler.worker-saturation": [1.0, 1.0],
    }
    assert len(given) == len(found)


def test_the_image_runs_as_an_ordinary_user_with_pinned_packages() -> None:
    steps = re.findall(r"^([A-Z]+) (.*)$", DOCKERFILE, re.MULTILINE)
    assert steps[0][0] == "FROM"
    assert re.fullmatch(r"python:3\.11-slim@sha256:[0-9a-f]{64}", steps[0][1])
    users = [argument for step, argument in steps if step == "USER"]
    assert users == ["residua"]
    assert "--require-hashes --requirement requirements.lock" in DOCKERFILE
    assert "--no-deps --no-build-isolation" in DOCKERFILE
    assert "HEALTHCHECK" in DOCKERFILE
    made = re.findall(r"install --directory --owner residua ((?:.*\\\n)*.*)", DOCKERFILE)
    folders = {"/data", *(f"/certificates/{name}" for name in LASTING)}
    assert folders <= set(" ".join(made).split()), "a new volume takes its owner from the image"


def test_python_runs_no_file_of_the_folder_where_a_container_works() -> None:
    assert re.search(r"^ +PYTHONSAFEPATH=1\b", DOCKERFILE, re.MULTILINE)


class Stage:
    """Processes of the compose file on this machine: other ports, other folders, same words."""

    def __init__(self, home: Path, stack: ExitStack) -> None:
        self.home = home
        self.stack = stack
        self.ports = {port: str(free_port()) for port in ("8786", "8787", "8790", "8000")}
        self.folders = {"/data": "data", "/tmp": "scratch", "/certificates": "certificates"}
        # Here the service listens on 127.0.0.1, in a container on 0.0.0.0, which asks for keys.
        self.environment = environment(home / "computed.log") | {"RESIDUA_REQUIRE_KEYS": "true"}
        self.processes: dict[str, subprocess.Popen[bytes]] = {}

    def translated(self, name: str, words: list[str]) -> list[str]:
        """Return a command of a container as a command of this machine."""

        return PROGRAMS[words[0]] + [self.word(name, text) for text in words[1:]]

    def word(self, name: str, text: str) -> str:
        """Return a word of the file with the ports and folders of this machine."""
        top, _, rest = text[1:].partition("/")
        if text.startswith("/") and f"/{top}" in self.folders:
            folder = self.home / self.folders[f"/{top}"]
            if rest and top == "certificates":  # each has its own volume there
                folder /= name
            return str(folder / rest)
        text = interpolated(text)
        text = text.replace("scheduler:", "127.0.0.1:").replace("0.0.0.0", "127.0.0.1")
        return re.sub(r"\b\d{4}\b", lambda port: self.ports.get(port[0], port[0]), text)

    def start(self, name: str) -> None:
        """Start a service of the compose file; it ends with the stage."""
        log = self.stack.enter_context((self.home / f"{name}.log").open("ab"))
        given = SERVICES[name].get("environment", {})
        process = subprocess.Popen(
            self.translated(name, SERVICES[name]["command"]),
            cwd=self.home,
            env=self.environment
            | {key: self.word(name, value) for key, value in given.items() if value is not None},
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=log,
        )
        self.stack.callback(end, process)
        self.processes[name] = process

    def healthy(self, name: str) -> bool:
        """Return what the health check of a service says."""
        check = self.translated(name, SERVICES[name]["healthcheck"]["test"][1:])
        done = subprocess.run(check, env=self.environment, capture_output=True, check=False)
        return done.returncode == 0

    def client(self) -> httpx.Client:
        """Return a client with a key, made by the first line of the file."""
        words = (ROOT / "docker-compose.yml").read_text().splitlines()[0].split(" service ")[1]
        command = self.translated("service", words.replace("NAME", "anna").split())
        with contextlib.suppress(subprocess.CalledProcessError):  # known from the last time
            made = subprocess.run(
                command, env=self.environment, capture_output=True, check=True, text=True
            )
            self.key = made.stdout.strip()
        return httpx.Client(
            base_url=f"http://127.0.0.1:{self.ports['8000']}",
            headers={"authorization": f"Bearer {self.key}"},
            timeout=PATIENCE,
        )


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stage]:
    """The three services, healthy."""
    with ExitStack() as stack:
        stage = Stage(tmp_path_factory.mktemp("stage"), stack)
        stage.start("certificates")
        assert stage.processes["certificates"].wait(timeout=PATIENCE) == 0
        stage.client().close()
        for name in LASTING:
            stage.start(name)
        for name in LASTING:
            wait_until(lambda name=name: stage.healthy(name))
        yield stage


def test_the_three_processes_compute_a_posted_study(stage: Stage) -> None:
    with stage.client() as client:
        url = client.post("/studies", json=fake_study("composed")).headers["location"]
        wait_until(lambda: client.get(url).json()["status"] == "successful")
        fetched = stage.home / "fetched.nc"
        fetched.write_bytes(client.get(f"{url}/dataset.nc").content)
    with open_netcdf(fetched) as dataset:
        assert dataset["max_plastic_strain"].sel(load_ratio=0.5).values.tolist() == [[0.5], [0.5]]


@pytest.mark.long
def test_a_scheduler_that_restarts_costs_no_study(stage: Stage) -> None:
    study = fake_study("interrupted", seconds=0.3)
    study["sweep"]["friction"] = [0.0, 0.1, 0.2]
    with stage.client() as client:
        url = client.post("/studies", json=study).headers["location"]
        wait_until(lambda: client.get(url).json()["counts"].get("ok", 0) >= 2)
        stage.processes["scheduler"].kill()
        for name in ("scheduler", "worker"):
            stage.processes[name].wait(timeout=PATIENCE)
            stage.start(name)  # as the engine does, see test_every_service_restarts_and_is_watched
        wait_until(lambda: client.get(url).json()["status"] == "successful")
        assert client.get(url).json()["counts"] == {"ok": 6}


def test_every_setting_of_the_service_can_be_given() -> None:
    fixed = {"data", "host", "port", "scheduler"}  # by the command
    own = {"workers", "worker_memory"}  # of workers that the service starts itself
    wanted = {f"RESIDUA_{name}".upper() for name in Settings.model_fields.keys() - fixed - own}
    assert set(SERVICES["service"]["environment"]) == wanted
