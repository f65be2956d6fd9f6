"""A data set is read if it is as it was written, wherever it is and whoever reads it."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from residua.cli import main
from service.view import application
from studies import Store, Study, StudyError, open_netcdf, open_study
from studies.views.reading import loaded

ComputedStudy = tuple[Study, Store]


def unsealed(path: Path) -> None:
    """As another program writes it: with a number of its own."""
    with xr.load_dataset(path, engine="h5netcdf") as dataset:
        dataset["peak_residual_tension"][:] = 777.0
    dataset.to_netcdf(path, engine="h5netcdf")


def without_its_last_line(path: Path) -> None:
    content = path.read_bytes()
    path.write_bytes(content[: content.rindex(b"\ndataset ")])


def edited(path: Path) -> None:
    content = path.read_bytes()
    assert b"fake" in content
    path.write_bytes(content.replace(b"fake", b"f\xffke"))


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:5000])


def emptied(path: Path) -> None:
    path.write_bytes(b"")


DAMAGES = [unsealed, without_its_last_line, edited, cut, emptied]
COMMANDS = [
    ["show"],
    ["table"],
    ["best", "--of", "peak_residual_tension"],
    ["plot", "--out", "a.png"],
    ["report", "--out", "a.html"],
    ["sensitivity", "--of", "peak_residual_tension"],
    ["export", "--vtu", "vtu"],
]


@pytest.fixture
def damaged_copy(computed: ComputedStudy, tmp_path: Path) -> Callable[..., Path]:
    """Copy the data set, in its store or alone, and damage it."""

    def made(damage: Callable[[Path], None], in_store: bool) -> Path:
        study, store = computed
        if in_store:
            copy = Store(shutil.copytree(store.directory, tmp_path / "out"))
            path = copy.dataset_path(study.id)
        else:
            path = shutil.copyfile(store.dataset_path(study.id), tmp_path / "alone.nc")
        damage(path)
        return path

    return made


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize("in_store", [True, False], ids=["store", "alone"])
def test_a_data_set_that_is_not_as_written_is_refused_by_everybody(
    damaged_copy: Callable[..., Path],
    damage: Callable[[Path], None],
    in_store: bool,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    path = damaged_copy(damage, in_store)
    monkeypatch.chdir(tmp_path)
    for command in [*COMMANDS, ["diff", str(path)]]:
        assert main([command[0], str(path), *command[1:]]) == 2, command
        found = capsys.readouterr()
        assert found.err.startswith("residua: path = ") and found.err.count("\n") == 1, command
        assert found.out == "", command
    assert not list(tmp_path.glob("a.*"))
    for read in (open_study, open_netcdf, lambda path: loaded(path.read_bytes(), str(path))):
        with pytest.raises(StudyError, match="not a file as Residua has written it"):
            read(path)
    with pytest.raises(StudyError), application(path):
        pass


def test_a_changed_file_is_opened_unchecked_for_who_wants_it(
    damaged_copy: Callable[..., Path],
) -> None:
    path = damaged_copy(unsealed, False)
    with open_study(path, unchecked=True) as dataset:
        np.testing.assert_array_equal(dataset["peak_residual_tension"], 777.0)
    damaged_copy(cut, False)
    with pytest.raises(StudyError, match="not a file as Residua has written it"):
        open_study(path, unchecked=True)


def test_a_copy_goes_with_its_seal(computed: ComputedStudy, tmp_path: Path) -> None:
    study, store = computed
    for path in (store.dataset_path(study.id), store.run_path(next(study.cases()).id)):
        copy = shutil.copyfile(path, tmp_path / "any name.nc")
        with open_netcdf(copy) as dataset:
            assert dataset.attrs["scene"] == "fake"
