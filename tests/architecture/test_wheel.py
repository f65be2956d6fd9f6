"""A wheel holds the whole product, and works where no checkout is."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest

from tests.architecture.sources import PACKAGES, PROJECT, ROOT, tracked

pytestmark = pytest.mark.processes

BUILD = """
import json, sys
from setuptools import Distribution, find_namespace_packages

target, include, data = sys.argv[1], *map(json.loads, sys.argv[2:])
packages = find_namespace_packages(include=include)
built = Distribution({"packages": packages, "package_data": data})
built.script_name = "setup.py"
command = built.get_command_obj("build_py")
command.build_lib = target
command.ensure_finalized()
command.run()
print(*command.get_outputs(include_bytecode=False), sep="\\n")
"""


def finished(
    command: list[str], directory: Path, environment: Mapping[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Run a command in a directory, whatever its exit status."""
    return subprocess.run(
        command,
        check=False,
        cwd=directory,
        env=os.environ | (environment or {}),
        capture_output=True,
        text=True,
    )


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The tree that a wheel holds, built by the command that fills wheels."""
    target = tmp_path_factory.mktemp("wheel")
    setuptools = PROJECT["tool"]["setuptools"]
    told = [setuptools["packages"]["find"]["include"], setuptools["package-data"]]
    command = [sys.executable, "-c", BUILD, str(target), *map(json.dumps, told)]
    answer = finished(command, ROOT)
    assert answer.returncode == 0, answer.stderr
    promised = {line for line in answer.stdout.splitlines() if line.startswith(str(target))}
    assert promised == {str(path) for path in target.rglob("*") if path.is_file()}
    return target


def test_a_wheel_holds_every_module_and_nothing_else(installed: Path) -> None:
    found = {path.relative_to(installed) for path in installed.rglob("*") if path.is_file()}
    pages = {path for path in tracked() if path.name == "README.md"}
    assert found == {path for path in tracked() if path.parts[0] in PACKAGES} - pages


def test_the_command_works_from_a_wheel(installed: Path, tmp_path: Path) -> None:
    where = [sys.executable, "-c", "import studies; print(studies.__file__)"]
    elsewhere = {"PYTHONPATH": str(installed)}
    assert finished(where, tmp_path, elsewhere).stdout.startswith(str(installed))
    answer = finished([sys.executable, "-m", "residua", "scenes"], tmp_path, elsewhere)
    assert answer.returncode == 0, answer.stderr
    assert re.search(r"^punch +elastic-plastic punch", answer.stdout, re.MULTILINE)
    assert re.search(r"^rigid_punch +rigid flat punch", answer.stdout, re.MULTILINE)
