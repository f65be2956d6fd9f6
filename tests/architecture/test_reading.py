"""Files are opened by one module: a device or a pipe in place of a file then harms nothing."""

from __future__ import annotations

import ast
from collections.abc import Iterator

import pytest

from tests.architecture.sources import PACKAGES, ROOT, modules

ONE = "solver/files.py"

OTHERS = {
    "studies/execution/forks.py": "the terminal, to leave it",
    "service/sandbox.py": "devices and folders that are named in the code",
    "service/keys.py": "a folder, to lock it",
    "studies/scratch.py": "folders of its own, to lock them",
    "studies/storage/claims.py": "makes a new file",
}
"""Modules that call `os.open`, and what for."""

WHOLE = {"read_text", "read_bytes", "shutil.copy", "shutil.copy2", "shutil.copyfile", "json.load",
         "tomllib.load", "ElementTree.parse", "os.open"}  # fmt: skip
"""Methods and functions that read what a path names, or open it."""


VARIABLES, WRITING = "h5d", ("w", "x", "a", "r+")
"""Module of h5py that opens variables of an open file; modes that do not read."""


def breaches(source: str) -> Iterator[str]:
    """Yield the calls that open a file to read it, and `os.open`."""
    for call in (n for n in ast.walk(ast.parse(source)) if isinstance(n, ast.Call)):
        name, of = called(call.func)
        mode = next((a.value for a in call.args if isinstance(a, ast.Constant)), "r")
        if whole := {name, f"{of}.{name}"} & WHOLE:
            yield whole.pop()
        elif name == "open" and of != VARIABLES and not (of and str(mode).startswith(WRITING)):
            yield "open"


def called(function: ast.expr) -> tuple[str, str]:
    """Return the name of a function, and that of the object before it."""
    if isinstance(function, ast.Attribute):
        return function.attr, getattr(function.value, "id", "?")
    return getattr(function, "id", ""), ""


@pytest.mark.parametrize("package", PACKAGES)
def test_one_module_opens_files_to_read_them(package: str) -> None:
    found = {
        (str(module), each)
        for module in modules(package)
        for each in breaches((ROOT / module).read_text())
    }
    allowed = {(ONE, "os.open"), *((module, "os.open") for module in OTHERS)}
    assert found <= allowed
    assert {m for m, _ in allowed if m.startswith(f"{package}/")} == {m for m, _ in found}


@pytest.mark.parametrize(
    ("line", "count"),
    [
        ("path.read_text()", 1),
        ("Path('a').read_bytes()", 1),
        ("open('a')", 1),
        ("path.open()", 1),
        ("path.open('rb')", 1),
        ("json.load(file)", 1),
        ("os.open('a', 0)", 1),
        ("shutil.copyfile(a, b)", 1),
        ("path.open('wb')", 0),
        ("path.open('r+b')", 0),
        ("h5d.open(file.id, name)", 0),
        ("json.loads(text)", 0),
    ],
)
def test_a_call_that_opens_a_file_is_seen(line: str, count: int) -> None:
    assert len(list(breaches(line))) == count
