"""The command that tells a number between runs."""

from __future__ import annotations

from pathlib import Path

import pytest

from residua.cli import main
from studies import Store, Study, open_study
from tests.studies.test_goal import search_here

CONTENT = {
    "name": "refined",
    "scene": "fake",
    "sweep": {"load_ratio": [0.2, 0.6], "friction": [0.0, 0.4]},
    "refine": {"of": ["peak_contact_pressure"], "halvings": 1},
}


def test_a_number_is_told_and_the_run_that_is_needed_is_added(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = str(tmp_path / "out")
    assert len(search_here(Study.from_dict(CONTENT), Store(out))) == 9
    asked = ["predict", out, "load_ratio=0.5", "friction=0.1", "--of", "peak_contact_pressure"]
    assert main(asked) == 0
    assert "peak_contact_pressure = 105 MPa, error" in capsys.readouterr().out
    by = [*asked, "--by", "gaussian", "--within", "1e-9"]
    assert main(by) == 1
    told = capsys.readouterr().out
    assert "above 1e-09 at hardening = none, load_ratio = 0.5, friction = 0.1" in told
    assert main([*by, "--compute"]) == 0
    assert "= 105 MPa, error 0 MPa (by run)" in capsys.readouterr().out
    assert len(list(Path(out).glob("runs/*.nc"))) == 10
    with open_study(out) as dataset:
        assert dataset.sizes["point"] == 9, "the study has its own runs still"


@pytest.mark.parametrize(
    ("at", "told"),
    [
        (["load_ratio=0.5"], "friction = '': must be given, because it varies"),
        (["load_ratio=2", "friction=0.1"], "load_ratio = '2': must be between 0.2 and 0.6"),
        (["load_ratio"], "NAME=VALUE = 'load_ratio': must be NAME=VALUE"),
    ],
)
def test_a_place_that_is_not_between_runs_is_refused_in_one_line(
    at: list[str], told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = str(tmp_path / "out")
    search_here(Study.from_dict(CONTENT), Store(out))
    assert main(["predict", out, *at, "--of", "peak_contact_pressure"]) == 2
    errors = capsys.readouterr().err
    assert told in errors
    assert errors.count("\n") == 1
