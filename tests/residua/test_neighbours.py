"""The command works with its own solver, studies and service, and says when others come first."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from residua.cli import NEIGHBOURS, wrong_package
from tests.architecture.sources import PACKAGES, ROOT
from tests.counted import counted

pytestmark = pytest.mark.processes


def started(directory: Path, *path: Path) -> subprocess.CompletedProcess[str]:
    """Run the command where Python looks for packages in the directory first, then on a path."""
    return subprocess.run(
        [sys.executable, "-m", "residua", "scenes"],
        check=False,
        cwd=directory,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(map(str, [*path, ROOT]))},
        capture_output=True,
        text=True,
    )


def refused(name: str, found: Path) -> str:
    """What the command says of a package that is found elsewhere."""
    return (
        f"residua: Python finds the package {name!r} at {found}; this command needs the one at "
        f"{ROOT / name}: rename the other one, or take its folder off Python's path\n"
    )


@pytest.mark.parametrize("name", NEIGHBOURS)
def test_another_package_that_comes_first_is_told_in_one_line(name: str, tmp_path: Path) -> None:
    other = tmp_path / "other" / name
    other.mkdir(parents=True)
    (other / "__init__.py").write_text("raise AssertionError('imported')\n")
    answer = started(tmp_path, other.parent)
    assert (answer.returncode, answer.stdout) == (2, "")
    assert answer.stderr == refused(name, other)


def test_a_package_where_the_command_is_started_is_told_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "solver").mkdir()
    (tmp_path / "solver" / "__init__.py").touch()
    answer = started(tmp_path)
    assert (answer.returncode, answer.stderr) == (2, refused("solver", tmp_path / "solver"))


def test_a_module_of_the_same_name_is_told_with_its_file(tmp_path: Path) -> None:
    (tmp_path / "studies.py").touch()
    answer = started(tmp_path)
    assert (answer.returncode, answer.stderr) == (2, refused("studies", tmp_path / "studies.py"))


def test_where_its_own_come_first_the_command_works(tmp_path: Path) -> None:
    (tmp_path / "service").mkdir()  # a folder that is no package hides none
    other = tmp_path / "other" / "solver"
    other.mkdir(parents=True)
    (other / "__init__.py").touch()
    answer = started(tmp_path, ROOT, other.parent)
    assert (answer.returncode, answer.stderr) == (0, "")
    assert "punch" in answer.stdout


def test_a_package_reached_by_a_link_is_no_stranger(tmp_path: Path) -> None:
    for name in PACKAGES:
        (tmp_path / name).symlink_to(ROOT / name)
    answer = started(tmp_path)
    assert (answer.returncode, answer.stderr) == (0, "")


def test_a_missing_package_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("residua.cli.NEIGHBOURS", ("solver", "no_such_package"))
    assert wrong_package() == (
        "Python finds no package 'no_such_package'; this command needs the one at "
        f"{ROOT / 'no_such_package'}"
    )


def test_the_check_imports_none_of_them_and_takes_milliseconds() -> None:
    code = (
        "import sys; from residua.cli import wrong_package; assert not wrong_package();"
        f"assert not {set(NEIGHBOURS)!r} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT)
    with counted() as calls:
        assert not wrong_package()
    assert calls < 1_500, "some tenths of a millisecond"
