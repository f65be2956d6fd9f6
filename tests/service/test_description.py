"""The description of the service says what is true: schemathesis finds nothing."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.service.servers import NOWHERE, Server, fake_study

CONFIGURATION = Path(__file__).with_name("schemathesis.toml")

PHASES = ("Examples", "Coverage", "Fuzzing", "Stateful")

SHORT = ["--max-examples", "2"]
"""How far it may go in the suite: numbers of cases, and no time, which it would spend in full."""


def explore(server: Server, extent: list[str], seed: int = 1) -> subprocess.CompletedProcess[str]:
    """Let schemathesis go through its phases: examples, coverage, fuzzing, stateful."""
    command = [
        *(sys.executable, "-m", "schemathesis.cli", "--config-file", str(CONFIGURATION)),
        *("run", f"http://127.0.0.1:{server.port}/openapi.json", "--continue-on-failure"),
        *("--seed", str(seed), "--no-color", *extent),
    ]
    return subprocess.run(command, cwd=server.home, capture_output=True, text=True, check=False)


@pytest.fixture
def explored(service: Server, tmp_path: Path) -> Iterator[Server]:
    """A service of the test's own with a study that another has computed; it computes nothing.

    What is posted is left waiting: the worker would compute until the test ends.
    """
    study = service.finished(service.post(fake_study("computed")))
    server = Server(tmp_path / "explored", settings=NOWHERE)
    shutil.copytree(service.data / "studies" / study["id"], server.data / "studies" / study["id"])
    (server.data / "runs").mkdir()
    for run in study["runs"]:
        shutil.copy(service.data / "runs" / f"{run['id']}.nc", server.data / "runs")
    assert server.start().study(study["id"])["status"] == "successful"
    yield server
    server.close()


def test_schemathesis_finds_nothing(explored: Server) -> None:
    found = explore(explored, SHORT)
    assert found.returncode == 0, found.stdout
    for phase in PHASES:
        assert f"✅ {phase}" in found.stdout, found.stdout


def test_where_a_good_form_may_be_refused_the_description_says_so(service: Server) -> None:
    paths = service.client.get("/openapi.json").json()["paths"]
    told = {
        f"{method.upper()} {path}"
        for path, operations in paths.items()
        for method, operation in operations.items()
        if "422" in operation["responses"]
    }
    assumed = [
        set(each["include-name"])
        for each in tomllib.loads(CONFIGURATION.read_text())["operations"]
        if "positive_data_acceptance" in each.get("checks", {})
    ]
    assert [told] == assumed and told
