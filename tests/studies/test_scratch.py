"""Temporary folders: removed at the end, and after a kill by the next process."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from studies.scratch import remove_left, scratch
from tests.architecture.sources import ROOT

HOLDER = """
import time
from studies.scratch import scratch
with scratch() as folder:
    (folder / "file").touch()
    print(folder, flush=True)
    time.sleep(60)
"""


STARTER = """
import time
from studies.execution.workers import own_workers
with own_workers(0):
    print("started", flush=True)
    time.sleep(60)
"""


@pytest.fixture(autouse=True)
def folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The directory of temporary files."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    return tmp_path


def test_a_folder_ends_with_its_context(folders: Path) -> None:
    with scratch() as one, scratch() as other:
        assert one != other and one.parent == other.parent == folders
        (one / "file").touch()
        remove_left()
        assert (one / "file").exists() and other.exists(), "in use"
    assert list(folders.iterdir()) == []


def test_a_folder_that_is_removed_before_it_is_opened_is_made_again(
    folders: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make, made = tempfile.mkdtemp, []

    def removed_first(**named: str) -> str:
        made.append(make(**named))
        if len(made) == 1:
            Path(made[0]).rmdir()
        return made[-1]

    monkeypatch.setattr(tempfile, "mkdtemp", removed_first)
    with scratch() as folder:
        assert [folder] == [Path(each) for each in made[1:]] and folder.is_dir()


@pytest.mark.processes
def test_a_folder_of_a_killed_process_is_removed_by_the_next(folders: Path) -> None:
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLDER], stdout=subprocess.PIPE, text=True, cwd=ROOT
    )
    with holder:
        assert holder.stdout is not None
        left = Path(holder.stdout.readline().strip())
        remove_left()
        assert (left / "file").exists(), "in use"
        holder.kill()
        holder.wait()
    assert left.exists()
    (folders / "residua-scratch-file").touch()
    (folders / "residua-results").mkdir()
    (folders / "residua-scratch-link").symlink_to(ROOT)
    with scratch():
        assert not left.exists()
    assert {each.name for each in folders.iterdir()} == {
        "residua-scratch-file",
        "residua-scratch-link",
        "residua-results",
    }
    assert (ROOT / "pyproject.toml").exists()


@pytest.mark.processes
def test_what_workers_need_is_in_folders_that_the_next_process_removes(folders: Path) -> None:
    holder = subprocess.Popen(
        [sys.executable, "-c", STARTER], stdout=subprocess.PIPE, text=True, cwd=ROOT
    )
    with holder:
        assert holder.stdout is not None and holder.stdout.readline() == "started\n"
        holder.kill()
        holder.wait()
    left = {each.name.rpartition("-")[0] for each in folders.iterdir()}
    assert left == {"residua-scratch"}
    remove_left()
    assert list(folders.iterdir()) == []


def test_no_folder_for_temporary_files_leaves_nothing_to_remove(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked = []

    def none() -> str:
        asked.append(1)
        raise FileNotFoundError("No usable temporary directory found")

    monkeypatch.setattr(tempfile, "gettempdir", none)
    remove_left()
    assert asked
