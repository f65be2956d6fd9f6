"""The references know nothing of what they are references for."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.architecture.sources import imported

HERE = Path(__file__).parent
ALLOWED = {"__future__", "collections", "dataclasses", "math", "typing", "numpy", "scipy"}
REFERENCES = sorted(p for p in HERE.glob("*.py") if not p.name.startswith(("test_", "conftest")))


@pytest.mark.parametrize("path", REFERENCES, ids=lambda path: path.stem)
def test_a_reference_needs_numpy_and_scipy_only(path: Path) -> None:
    assert imported(path.read_text(), "tests") <= ALLOWED


@pytest.mark.parametrize("path", sorted(HERE.glob("*.py")), ids=lambda path: path.stem)
def test_nothing_here_uses_the_solver(path: Path) -> None:
    assert not imported(path.read_text(), "tests") & {"solver", "studies", "service"}
