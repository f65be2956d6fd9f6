"""What holds for every file."""

from __future__ import annotations

import importlib
import inspect
import re
from pathlib import Path

import pytest

from tests.architecture.sources import ROOT, tracked

# Brackets in a pattern keep it from matching its own text here.
MACHINE_PATH = re.compile(r"(?<![\w.:/-])/(?:root|home|Users|work|mnt)/\w")
REGISTRY = re.compile(
    r"py[p]i\.|python[h]osted|(?:index|find)[-_](?:url|links)|docker[.]io|gh[c]r\.io|quay[.]io"
)
UNFINISHED = re.compile(r"\b(?:TO[D]O|FIX[M]E|X[X]X)\b")
IMAGE_FILES = {Path("Dockerfile"), Path("docker-compose.yml")}  # their paths are the image's own


def matches(pattern: re.Pattern[str], paths: list[Path]) -> list[str]:
    """``file:line: text`` of every match; pictures have no text."""
    return [
        f"{path}:{number}: {line.strip()}"
        for path in paths
        if path.suffix != ".png"
        for number, line in enumerate((ROOT / path).read_text(errors="replace").splitlines(), 1)
        if pattern.search(line)
    ]


@pytest.mark.parametrize("package", ["solver", "studies"])
def test_exported_names_exist_and_say_what_they_are(package: str) -> None:
    module = importlib.import_module(package)
    exported = {name: getattr(module, name) for name in module.__all__}
    assert exported
    documented = {n: o for n, o in exported.items() if inspect.isclass(o) or inspect.isroutine(o)}
    # A dataclass without a docstring is given its signature for one.
    missing = [
        name for name, o in documented.items() if not o.__doc__ or o.__doc__.startswith(f"{name}(")
    ]
    assert not missing


def test_no_machine_paths() -> None:
    assert not matches(MACHINE_PATH, [path for path in tracked() if path not in IMAGE_FILES])


def test_no_registry_addresses() -> None:
    assert not matches(REGISTRY, tracked())


def test_nothing_is_left_to_do() -> None:
    assert not matches(UNFINISHED, tracked())


@pytest.mark.parametrize(
    ("pattern", "line"),
    [
        (MACHINE_PATH, "see " + "/ho" + "me/someone/x.py"),
        (MACHINE_PATH, 'open("' + "/wo" + 'rk/main")'),
        (REGISTRY, "--extra-" + "index" + "-url=x"),
        (REGISTRY, "https://" + "pyp" + "i.org/simple"),
        (UNFINISHED, "# TO" + "DO: later"),
    ],
)
def test_patterns_find_what_they_are_for(pattern: re.Pattern[str], line: str) -> None:
    assert pattern.search(line)
