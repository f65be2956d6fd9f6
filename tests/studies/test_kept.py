"""Of a complete study nothing is made again: data set, report and picture are kept."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from residua.cli import main
from studies import Store, Study, run_study
from studies.storage import made
from tests.studies.conftest import compute_here, write_study
from tests.studies.test_damage import true_numbers

ROOT = Path(__file__).parents[2]
HEAVY = {
    "dask", "distributed", "fastapi", "h5netcdf", "h5py", "matplotlib", "netCDF4", "numba",
    "pandas", "scipy", "service", "skfem", "xarray",
}  # fmt: skip
RESULTS = ["dataset.nc", "report.txt", "residual_stress_xx.png"]
REPORT = RESULTS[1:]
Make = Callable[[], list[str]]
"""Runs the command; returns the names of the files that it has written, not kept."""


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a study whose command ran to its end, without worker processes."""
    folder = tmp_path_factory.mktemp("told")
    compute_here(Study.from_toml(write_study(folder)), Store(folder / "out"))
    assert main(arguments(folder)) == 0
    return folder


@pytest.fixture
def complete(told: Path, tmp_path: Path) -> tuple[Study, Store]:
    """A copy of that study, to be changed."""
    shutil.copytree(told, tmp_path, dirs_exist_ok=True)
    return Study.from_toml(tmp_path / "study.toml"), Store(tmp_path / "out")


def arguments(folder: Path) -> list[str]:
    return ["run", str(folder / "study.toml"), "--out", str(folder / "out")]


@pytest.fixture
def again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Make:
    def run() -> list[str]:
        capsys.readouterr()
        assert main(arguments(tmp_path)) == 0
        lines = [line.split() for line in capsys.readouterr().out.splitlines()]
        return [Path(line[1]).name for line in lines if line and line[0] == "wrote"]

    return run


def states(study: Study, store: Store) -> dict[str, tuple[int, int]]:
    """Return what every writing of a file of the study changes."""
    files = store.study_path(study.id).iterdir()
    return {path.name: (path.stat().st_ino, path.stat().st_mtime_ns) for path in files}


def refused(*arguments: object) -> None:
    raise AssertionError("made again")


def test_a_complete_study_is_told_again_and_nothing_is_made(
    complete: tuple[Study, Store], tmp_path: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    before = states(*complete)
    assert before.keys() == {"study.json", "made.json", *RESULTS}
    for maker in (
        "studies.storage.combine.combine",
        "studies.views.plots.maps.map_figure",
        "studies.views.tables.runs_table",
    ):
        monkeypatch.setattr(maker, refused)
    assert main(arguments(tmp_path)) == 0
    assert states(*complete) == before
    told, directory = capsys.readouterr().out, complete[1].study_path(complete[0].id)
    assert told.startswith((directory / "report.txt").read_text().rstrip() + ", 0 computed in ")
    assert told.splitlines()[-3:] == [f"kept {directory / name}" for name in RESULTS]


@pytest.mark.processes
def test_a_complete_study_imports_nothing_that_computes_or_draws(
    complete: tuple[Study, Store], tmp_path: Path
) -> None:
    """These imports take two seconds, and the answer less than one."""
    code = (
        "import sys, tests.studies.fakes; from residua.cli import main;"
        "assert main(sys.argv[1:]) == 0; print(*sys.modules, file=sys.stderr)"
    )
    command = [sys.executable, "-c", code, *arguments(tmp_path)]
    told = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT)
    assert told.stdout.count("kept ") == len(RESULTS)
    assert HEAVY & set(told.stderr.split()) == set()


@pytest.mark.processes
@pytest.mark.parametrize("arguments", [["--help"], ["scenes"], ["scenes", "punch"]])
def test_scenes_are_told_without_libraries_that_compute_or_draw(arguments: list[str]) -> None:
    code = (
        "import atexit, sys; from residua.cli import main;"
        "atexit.register(lambda: print(*sys.modules, file=sys.stderr)); main(sys.argv[1:])"
    )
    command = [sys.executable, "-c", code, *arguments]
    told = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT)
    assert "punch" in told.stdout or "usage" in told.stdout
    assert HEAVY & set(told.stderr.split()) == set()


def flip(path: Path) -> None:
    """Damage a file as a disk does: its length and its time stay."""
    state, content = path.stat(), bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    os.utime(path, ns=(state.st_atime_ns, state.st_mtime_ns))


def directory(path: Path) -> None:
    path.unlink()
    path.mkdir()


@pytest.mark.parametrize(
    ("damage", "name"),
    [
        *((damage, "dataset.nc") for damage in (flip, Path.unlink, directory)),
        (flip, "report.txt"),
        (Path.unlink, "residual_stress_xx.png"),
        (directory, "residual_stress_xx.png"),
    ],
)
def test_a_result_that_is_damaged_or_gone_is_made_again(
    complete: tuple[Study, Store], again: Make, damage: Callable[[Path], None], name: str
) -> None:
    study, store = complete
    path = store.study_path(study.id) / name
    before = path.read_bytes()
    damage(path)
    # the data set tells when it was made: what is made of it is made anew
    assert set(again()) >= ({name} if name == "dataset.nc" else set(REPORT))
    assert len(path.read_bytes()) == len(before)
    true_numbers(study, store)
    assert again() == []


@pytest.mark.parametrize("content", [b"", b"[]", b'{"data set": 1}', b'{"report": {"files": {}}}'])
def test_where_it_is_not_known_what_results_were_made_of_all_are_made_again(
    complete: tuple[Study, Store], again: Make, content: bytes
) -> None:
    study, store = complete
    (store.study_path(study.id, "made.json")).write_bytes(content)
    assert "dataset.nc" in again()
    assert again() == []


def test_a_run_written_anew_makes_all_results_anew(
    complete: tuple[Study, Store], again: Make
) -> None:
    study, store = complete
    run = store.run_path(next(study.cases()).id)
    state = run.stat()
    os.utime(run, ns=(state.st_atime_ns, state.st_mtime_ns - 10**12))  # older, and yet another one
    assert "dataset.nc" in again()
    assert again() == []


@pytest.mark.parametrize("what", ["source", "library"])
def test_other_sources_and_libraries_make_all_results_anew(
    complete: tuple[Study, Store], again: Make, tmp_path: Path, what: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    changed = tmp_path / "other.py"
    changed.write_text("# only a word")
    if what == "source":
        known = made.sources
        monkeypatch.setattr(made, "sources", lambda scene: [*known(scene), changed])
    else:
        monkeypatch.setattr("importlib.metadata.version", lambda name: "0.0")
    assert set(REPORT) <= set(again()), "a picture of the same data set too"
    assert again() == []


def test_a_study_with_failed_runs_is_kept_where_they_are_not_tried_again(
    study_file: Callable[..., Path], store: Store
) -> None:
    study = Study.from_toml(study_file(trouble="limit"))
    compute_here(study, store)
    first, second = (run_study(study, store, resume=True) for _ in range(2))
    assert (first.anew, second.anew) == (True, False)
    assert second.counts == first.counts == {"ok": 2, "limit_load": 2}
    assert second.failed == first.failed
    assert len(second.failed) == 2
