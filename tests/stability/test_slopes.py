"""The command that compares derivatives of seeded runs with differences."""

from __future__ import annotations

import pytest

from tests.stability.slopes import main


@pytest.mark.solves
def test_the_first_run_is_right_and_a_larger_error_is_told(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["1"]) == 0
    assert "1 right" in capsys.readouterr().out
    monkeypatch.setattr("tests.stability.slopes.TOLERANCE", 1e-12)
    assert main(["1"]) == 1
    assert "1 wrong" in capsys.readouterr().out
