"""The files of the project, as the tests of its order see them."""

from __future__ import annotations

import ast
import subprocess
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("solver", "studies", "service", "residua")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())


def modules(package: str) -> list[Path]:
    """Every Python file of a package, relative to the root."""
    return sorted(path.relative_to(ROOT) for path in (ROOT / package).rglob("*.py"))


def imported(source: str, package: str) -> set[str]:
    """Top-level names a module of ``package`` imports anywhere in its text, lazily included."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names.update(alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            module = package if node.level else str(node.module)
            names.add(module.partition(".")[0])
    return names


def tracked() -> list[Path]:
    """Every file under version control, relative to the root."""
    listing = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True, text=True
    )
    paths = [Path(name) for name in listing.stdout.split("\0") if name]
    return [path for path in paths if (ROOT / path).is_file()]
