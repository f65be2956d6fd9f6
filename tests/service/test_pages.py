"""The curl lines of the pages, as a reader would type them into a shell."""

from __future__ import annotations

import csv
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

BLOCK = re.compile(
    r"^```sh\n(?P<text>.*?)^```(?:\n\n```text\n(?P<answer>.*?)^```)?", re.DOTALL | re.M
)


def curl_blocks(page: str) -> list[tuple[str, str]]:
    """Return the blocks of curl lines of a page, each with the answer that the page shows."""
    found = BLOCK.finditer((ROOT / page).read_text())
    return [(each["text"], each["answer"] or "") for each in found if "curl" in each["text"]]


@pytest.mark.skipif(shutil.which("curl") is None, reason="curl is not installed")
def test_the_curl_lines_of_the_pages_work(service: Server, tmp_path: Path) -> None:
    """Those of the page of the service are for the study of the first page."""
    (tmp_path / ".curlrc").write_text("fail-with-body\nshow-error\nmax-time = 120\n")

    def typed(text: str, **given: str) -> str:
        done = subprocess.run(
            ["bash", "-eu", "-c", text.replace("localhost:8000", f"127.0.0.1:{service.port}")],
            cwd=tmp_path, env=os.environ | {"CURL_HOME": str(tmp_path)} | given, timeout=150,
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 0, f"{text}\n{done.stdout}\n{done.stderr}"
        return done.stdout

    ((posting, shown),) = curl_blocks("README.md")
    rows, expected = (list(csv.DictReader(text.splitlines())) for text in (typed(posting), shown))
    assert [sorted(row) for row in rows] == [sorted(row) for row in expected]
    for row, other in zip(rows, expected, strict=True):
        assert {name: float(value) for name, value in row.items()} == pytest.approx(
            {name: float(value) for name, value in other.items()}, rel=1e-6
        )
    with open_netcdf(tmp_path / "tour.nc") as dataset:
        assert dataset["status"].size == len(rows) and (dataset["status"] == "ok").all()

    (looking, _), *_ = curl_blocks("service/README.md")
    listing, placeholder, drawing = re.split(r"^(RUN=.*\n)", looking, flags=re.M)
    runs = json.loads(typed(listing))["items"]
    assert placeholder and len(runs) >= 2
    typed(drawing, RUN=runs[0]["id"])
    assert matplotlib.image.imread(tmp_path / "map.png").std() > 0.01
