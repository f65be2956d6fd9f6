"""What the project says of itself agrees with itself."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import pytest

import solver
from tests.architecture.sources import PROJECT, ROOT, tracked

CODE = re.compile(r"```.*?```|`[^`\n]+`", re.DOTALL)
TARGET = re.compile(r"^([a-z-]+):", re.MULTILINE)


def test_changelog_knows_the_version() -> None:
    headings = re.findall(r"^## \[(.+?)\]", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert headings[:2] == ["Unreleased", solver.__version__]


def test_the_distribution_takes_its_version_from_the_solver() -> None:
    assert "version" in PROJECT["project"]["dynamic"]
    assert PROJECT["tool"]["setuptools"]["dynamic"]["version"] == {
        "attr": "solver.version.__version__"
    }


def test_the_command_exists() -> None:
    module, _, function = PROJECT["project"]["scripts"]["residua"].partition(":")
    assert callable(getattr(importlib.import_module(module), function))


def test_constraints_pin_every_dependency() -> None:
    pins = dict(
        line.split("==")
        for line in (ROOT / "constraints.txt").read_text().splitlines()
        if not line.startswith("#")
    )
    extras = PROJECT["project"]["optional-dependencies"].values()
    required = [*PROJECT["project"]["dependencies"], *(name for extra in extras for name in extra)]
    names = {re.split(r"[<>=;\[ ]", requirement)[0].lower() for requirement in required}
    assert names <= {name.lower() for name in pins}


@pytest.mark.parametrize("page", [p for p in tracked() if p.suffix == ".md"], ids=str)
def test_make_targets_named_in_a_page_exist(page: Path) -> None:
    targets = set(TARGET.findall((ROOT / "Makefile").read_text()))
    code = "\n".join(CODE.findall((ROOT / page).read_text()))
    named = set(re.findall(r"\bmake ([a-z-]+)", code))
    assert named <= targets


def test_readme_starts_with_run_and_test() -> None:
    assert {"run", "test"} <= set(re.findall(r"`make ([a-z]+)`", (ROOT / "README.md").read_text()))
