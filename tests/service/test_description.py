"""The description of the service says what is true: schemathesis finds nothing."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from service.routes.studies import EXAMPLE
from studies import Store, Study
from tests.service.servers import NOWHERE, Server
from tests.studies.conftest import compute_here

CONFIGURATION = Path(__file__).with_name("schemathesis.toml")

IN_THE_SUITE = "# -- from here on for the suite alone"
"""The line of the configuration above what holds for the suite alone."""
PHASES = ("Examples", "Coverage", "Fuzzing", "Stateful")

SHORT = ["--max-examples", "2"]
"""How far it may go in the suite: numbers of cases, and no time, which it would spend in full."""


def explore(
    server: Server, extent: list[str], seed: int = 1, *, whole: bool = False
) -> subprocess.CompletedProcess[str]:
    """Let schemathesis go through its phases: examples, coverage, fuzzing, stateful.

    Only a ``whole`` exploration makes all the forms of coverage of what is posted and drawn.
    """
    configuration = server.home / CONFIGURATION.name
    always, _ = CONFIGURATION.read_text().split(IN_THE_SUITE)
    configuration.write_text(always if whole else CONFIGURATION.read_text())
    command = [
        *(sys.executable, "-m", "schemathesis.cli", "--config-file", str(configuration)),
        *("run", f"http://127.0.0.1:{server.port}/openapi.json", "--continue-on-failure"),
        *("--seed", str(seed), "--no-color", *extent),
    ]
    return subprocess.run(command, cwd=server.home, capture_output=True, text=True, check=False)


@pytest.fixture
def explored(tmp_path: Path) -> Iterator[Server]:
    """A service that computes nothing, and has the runs of the example of its description.

    So answers with data are looked at, and no worker computes what is posted until the test ends.
    """
    server = Server(tmp_path / "explored", settings=NOWHERE)
    study = Study.from_dict(EXAMPLE)
    compute_here(study, Store(server.data), study.problem)
    assert server.start().study(study.id)["status"] == "successful"
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
