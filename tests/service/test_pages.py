"""The curl lines of the pages, as a reader would type them into a shell."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from pathlib import Path

import matplotlib.image
import pytest

from studies import open_netcdf
from tests.architecture.sources import ROOT
from tests.service.servers import Server

BLOCK = re.compile(r"^```sh\n(?P<text>.*?)^```", re.DOTALL | re.MULTILINE)
PLACEHOLDER = re.compile(r"(?P<name>ID|RUN)=\.\.\.")
FOUND_IN = {
    "ID": re.compile(r"^location: /studies/([0-9a-f]{32})\s*$", re.IGNORECASE | re.MULTILINE),
    "RUN": re.compile(r'"items":\[\{"id":"([0-9a-f]{32})"'),
}
"""Where the reader finds what a placeholder stands for in the answer just received."""


def commands(page: str) -> list[str]:
    """Return the commands of the page's one block of curl lines."""
    (block,) = (match["text"] for match in BLOCK.finditer(page) if "curl" in match["text"])
    return [text.strip() for text in re.split(r"^(?=curl |[A-Z]+=)", block, flags=re.M) if text]


@pytest.mark.skipif(shutil.which("curl") is None, reason="curl is not installed")
@pytest.mark.parametrize("page", ["README.md", "service/README.md"])
def test_the_curl_lines_of_a_page_work(service: Server, page: str, tmp_path: Path) -> None:
    (tmp_path / ".curlrc").write_text("fail-with-body\nsilent\nshow-error\nmax-time = 120\n")
    (tmp_path / "data").symlink_to(ROOT / "data")
    environment = os.environ | {"CURL_HOME": str(tmp_path)}
    answers: list[str] = []
    lines = commands((ROOT / page).read_text())
    for command in lines:
        if placeholder := PLACEHOLDER.match(command):
            name = placeholder["name"]
            found = FOUND_IN[name].search(answers[-1])
            assert found, answers[-1]
            environment[name] = found[1]
            continue
        done = subprocess.run(
            ["bash", "-eu", "-c", command.replace("localhost:8000", f"127.0.0.1:{service.port}")],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            timeout=150,
            check=False,
        )
        assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
        answers.append(done.stdout)

    assert re.match(r"HTTP/1.1 20[01] ", answers[0])
    assert re.search(r'"status": ?"successful"', answers[1])
    assert any(json.loads(text)["total"] > 0 for text in answers if text.startswith("{"))
    data_sets, pictures = list(tmp_path.glob("*.nc")), list(tmp_path.glob("*.png"))
    assert len(data_sets) == 1
    with open_netcdf(data_sets[0]) as dataset:
        assert dataset.attrs["id"] == environment["ID"]
        assert (dataset["status"] == "ok").all()
    for picture in pictures:
        assert matplotlib.image.imread(picture).std() > 0.01
    assert len(data_sets) + len(pictures) == sum(" -o " in line for line in lines)
