"""Faults that are put into the product on purpose, each with the test that catches it.

A run does not notice them: its mechanics is right. That input is read and output is written right
is proved by tests. `faults.toml` is the list.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
_COPIED = ("solver", "studies", "service", "residua", "tests", "data", "examples", "docs")


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """A fault.

    Attributes
    ----------
    name : its kind and name
    file : the file of the product, relative to the root
    old, new : its text, there once, and the text that replaces it
    means : what is then wrong
    test : the test that catches it, ``FILE::FUNCTION`` or one of its cases, below ``tests``
    """

    name: str
    file: str
    old: str
    new: str
    means: str
    test: str

    def in_place(self, root: Path) -> str:
        """Return the file below a root with the fault in it."""
        text = (root / self.file).read_text(encoding="utf-8")
        if text.count(self.old) != 1:
            raise ValueError(f"{self.name}: {self.old!r} must be in {self.file} once")
        return text.replace(self.old, self.new)

    @property
    def row(self) -> str:
        """Its row in the table of the documentation."""
        return f"| `{self.name}` | {self.means} | `{self.test}` |"


def faults() -> list[Fault]:
    """Return the list."""
    kinds = tomllib.loads((ROOT / "tests/faults/faults.toml").read_text(encoding="utf-8"))
    return [
        Fault(name=f"{kind}.{name}", **each)
        for kind, own in kinds.items()
        for name, each in own.items()
    ]


def copied(folder: Path) -> None:
    """Copy the product and its tests, with what is compiled of them."""
    for name in _COPIED:
        shutil.copytree(ROOT / name, folder / name)
    for file in ("pyproject.toml", "README.md", "CONTRIBUTING.md"):
        shutil.copy2(ROOT / file, folder / file)


def fails(folder: Path, tests: Sequence[str]) -> bool:
    """Return whether some of the tests fail in a copy.

    Raises
    ------
    RuntimeError
        if they are not run at all
    """
    run = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-x", *(f"tests/{each}" for each in tests)],
        cwd=folder, env={"PATH": "", "PYTHONPATH": str(folder)}, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    if run.returncode not in (0, 1):
        raise RuntimeError(run.stdout + run.stderr)
    return bool(run.returncode)


def caught(folder: Path, fault: Fault, tests: Sequence[str]) -> bool:
    """Return whether some of the tests fail in a copy with a fault in it, which is taken out."""
    file = folder / fault.file
    file.write_text(fault.in_place(folder), encoding="utf-8")
    try:
        return fails(folder, tests)
    finally:
        shutil.copy2(ROOT / fault.file, file)
