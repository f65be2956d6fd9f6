"""A pipe, a socket or an endless device in place of a file: an error or a mend, never a wait."""

from __future__ import annotations

import os
import resource
import shutil
import signal
import socket
import stat
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from residua.cli import main
from service.keys import Keys, KeysError
from solver.errors import ModelError
from solver.files import NoFile, read_file
from solver.model.tabulated import Tabulated
from solver.results import saved
from solver.rolling.rail.profiles.points import read_points
from studies import CatalogueDamaged, Store, Study, StudyError, run_study
from studies.execution.access import Access
from studies.execution.workers import connect
from studies.storage.claims import Claims
from tests.studies.conftest import write_study

ComputedStudy = tuple[Study, Store]
SECONDS = 60
"""Longest time of a test: the program would wait for ever."""


@pytest.fixture(autouse=True)
def in_time() -> Iterator[None]:
    """Fail where the program waits, or fills the memory."""

    def late(*_: object) -> None:
        raise AssertionError("the program waits for a file that is none")

    before = signal.signal(signal.SIGALRM, late)
    limits = resource.getrlimit(resource.RLIMIT_AS)
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    signal.setitimer(signal.ITIMER_REAL, SECONDS)
    resource.setrlimit(resource.RLIMIT_AS, (used + 2**31, limits[1]))
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
        resource.setrlimit(resource.RLIMIT_AS, limits)


def pipe(path: Path) -> None:
    os.mkfifo(path)


def endless(path: Path) -> None:
    path.symlink_to("/dev/zero")


def a_socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as made:
        here = Path.cwd()
        os.chdir(path.parent)  # the name of a socket is short
        made.bind(path.name)
        os.chdir(here)


def folder(path: Path) -> None:
    path.mkdir()


KINDS = pytest.mark.parametrize("special", [pipe, endless, a_socket, folder])
Special = Callable[[Path], None]


@pytest.fixture
def copied(computed: ComputedStudy, tmp_path: Path) -> ComputedStudy:
    study, store = computed
    return study, Store(shutil.copytree(store.directory, tmp_path / "copy"))


@KINDS
def test_what_is_read_whole_is_a_regular_file(special: Special, tmp_path: Path) -> None:
    path = tmp_path / "file"
    special(path)
    with pytest.raises(NoFile, match="file: it is a "):
        read_file(path)
    for refused in (read_points, Tabulated.read, saved.read):
        with pytest.raises((ModelError, NoFile)):
            refused(path)


def test_a_file_is_read_up_to_its_limit(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"12345")
    assert read_file(path, 5) == b"12345"
    with pytest.raises(NoFile, match="it has more than 4 bytes"):
        read_file(path, 4)
    assert b"Linux" in read_file("/proc/version"), "its size is told as 0"


@KINDS
def test_files_of_the_user_are_refused_by_name(
    special: Special, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "given.toml"
    special(path)
    for command in (
        ["run", str(path)], ["draw", str(path), "--out", str(tmp_path / "a.png")],
        ["submit", str(path)], ["status", "a", "--api-key-file", str(path)], ["show", str(path)],
    ):  # fmt: skip
        assert main(command) == 2, command
        told = capsys.readouterr().err
        assert told.count("\n") == 1 and "Traceback" not in told, command
    access = Access("tls://127.0.0.1:1", str(path), str(path))
    with pytest.raises(StudyError, match="certificates"):
        connect(access)


@KINDS
@pytest.mark.parametrize("name", ["study.json", "dataset.nc", "made.json", "report.txt"])
def test_a_file_of_a_study_is_set_aside_and_made_again(
    special: Special, name: str, copied: ComputedStudy
) -> None:
    study, store = copied
    path = store.study_path(study.id) / name
    path.unlink(missing_ok=True)
    special(path)
    assert main(["table", str(store.directory)]) in (0, 2)
    outcome = run_study(study, store, workers=0)
    assert outcome.ok
    if name != "report.txt":
        assert path.is_file() and not path.is_symlink()


@KINDS
@pytest.mark.parametrize("name", ["catalogue.sqlite", "catalogue.sqlite-journal"])
def test_a_catalogue_is_set_aside_and_made_again(
    special: Special, name: str, copied: ComputedStudy
) -> None:
    _, store = copied
    before = store.catalogue.runs()
    path = store.directory / name
    path.unlink(missing_ok=True)
    special(path)
    with pytest.raises(CatalogueDamaged, match=f"{name} is a"):
        store.catalogue.runs()
    with store.writing():
        assert store.catalogue.runs() == before


@KINDS
def test_a_lock_is_refused_by_name(special: Special, copied: ComputedStudy) -> None:
    study, store = copied
    path = store.directory / ".lock"
    path.unlink(missing_ok=True)
    special(path)
    with pytest.raises(StudyError, match="directory = "):
        run_study(study, store, workers=0)


@KINDS
def test_a_claim_is_none_of_ours(special: Special, tmp_path: Path) -> None:
    claims = Claims(tmp_path)
    special(tmp_path / "path.0")
    with claims.held("path") as claim:
        assert claim is not None and claim.deaths == 1


@KINDS
def test_keys_are_refused(special: Special, tmp_path: Path) -> None:
    special(tmp_path / "keys.json")
    with pytest.raises(KeysError, match=r"keys\.json cannot be read"):
        Keys(tmp_path).all()


@KINDS
def test_files_beside_a_study_file_are_refused(special: Special, tmp_path: Path) -> None:
    special(tmp_path / "points.csv")
    path = write_study(
        tmp_path, 'name = "a"\nscene = "fake"\n[parameters]\nprofile = "points.csv"\n'
    )
    with pytest.raises(StudyError, match=r"readable text file: .*points\.csv: it is a "):
        Study.from_toml(path)


def endless_link(path: Path) -> None:
    path.symlink_to("/dev/full")


WRITERS = {
    "table": ["table", "{data}", "--out", "{out}"],
    "report": ["report", "{data}", "--out", "{out}"],
    "plot": ["plot", "{data}", "--out", "{out}.png"],
    "draw": ["draw", "punch", "--out", "{out}.png"],
    "diff": ["diff", "{data}", "{other}", "--out", "{out}.png"],
    "slurm": ["slurm", "{study}", "--tasks", "2", "--script", "{out}"],
    "certificates": ["certificates", "--out", "{folder}"],
}
"""Commands that write a file; `{out}` is its name, and `{folder}` that of a folder for several."""


@pytest.mark.parametrize("special", [pipe, endless_link, a_socket, folder])
@pytest.mark.parametrize("command", WRITERS)
def test_only_files_are_replaced(
    special: Special,
    command: str,
    computed: ComputedStudy,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    study, store = computed
    own = tmp_path / "scheduler" / "ca.pem" if command == "certificates" else tmp_path / "out"
    options = WRITERS[command]
    path = own.with_name(own.name + ".png") if any(".png" in each for each in options) else own
    path.parent.mkdir(exist_ok=True)
    special(path)
    kind = stat.S_IFMT(path.lstat().st_mode)
    data = store.dataset_path(study.id)
    given = [
        each.format(
            data=data, other=data, out=own, folder=tmp_path, study=write_study(tmp_path)
        )
        for each in options
    ]  # fmt: skip
    assert main(given) in (1, 2)
    told = capsys.readouterr().err
    assert path.name in told and "only files are replaced" in told
    assert stat.S_IFMT(path.lstat().st_mode) == kind
    assert not [each for each in path.parent.iterdir() if each.suffix == ".part"]


def test_a_new_name_and_a_file_are_written(computed: ComputedStudy, tmp_path: Path) -> None:
    study, store = computed
    out = tmp_path / "out.csv"
    for _ in range(2):
        assert main(["table", str(store.dataset_path(study.id)), "--out", str(out)]) == 0
        assert out.read_text().startswith("load_ratio")
        out.write_text("other")
