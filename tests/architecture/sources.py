"""The files of the project, as the tests of its order see them."""

from __future__ import annotations

import ast
import subprocess
import tomllib
from collections.abc import Iterator
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


def importing(source: str) -> set[str]:
    """Functions of a text that import, with their classes: ``Late.__call__``."""
    return {where for where, node in _inside(ast.parse(source), "") if _imports(node)}


def _inside(node: ast.AST, where: str) -> Iterator[tuple[str, ast.AST]]:
    """Yield every node inside functions, with the name of the outermost function."""
    for child in ast.iter_child_nodes(node):
        name = getattr(child, "name", "") if isinstance(child, _NAMED) else ""
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) or where.endswith(")"):
            yield where.removesuffix(")"), child
            yield from _inside(child, where.removesuffix(")") + ")")
        elif isinstance(child, _NAMED):
            yield from _inside(child, f"{where}.{name}" if where else name)
        else:
            yield from _inside(child, where)


_NAMED = (ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


def _imports(node: ast.AST) -> bool:
    """Whether a node is an import, or a call that imports what a text names."""
    if isinstance(node, ast.Call):
        called = ast.unparse(node.func).rpartition(".")[2]
        return called in ("import_module", "resolve_name", "__import__")
    return isinstance(node, ast.Import | ast.ImportFrom)
