"""What is damaged is noticed, told in one line, set aside and computed again."""

from __future__ import annotations

import errno
import logging
import os
import random
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest
import xarray as xr

from studies import (
    CatalogueDamaged,
    FileDamaged,
    Store,
    Study,
    StudyError,
    open_netcdf,
    open_study,
    run_study,
)
from studies.definition.identity import solver_hash
from studies.execution.task import PathTask, walk
from studies.storage.combine import combine
from studies.storage.dataset import run_content
from studies.storage.runfile import row
from tests.studies.conftest import compute_here, fake_study
from tests.studies.fakes import FAKE, record

pytestmark = pytest.mark.usefixtures("one_worker")

ComputedStudy = tuple[Study, Store]


@pytest.fixture
def damaged(computed: ComputedStudy, tmp_path: Path) -> ComputedStudy:
    """A copy of a computed study, to be damaged."""
    study, source = computed
    return study, Store(shutil.copytree(source.directory, tmp_path / "copy"))


def first(study: Study) -> str:
    return next(study.cases()).id


def repeat(study: Study, store: Store, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Run a study again with the tasks done in this process; return what was computed."""

    def compute(work: object, workers: int, scheduler: object, stop: object) -> None:
        for task in work._tasks(None, lambda: workers):
            walk(task, work._hear, lambda: False)
            work._close(task, None)

    monkeypatch.setattr("studies.execution.run._Work.compute", compute)
    outcome = run_study(study, store)
    assert outcome.counts == {"ok": study.size}
    assert outcome.ok
    return list(outcome.computed)


def true_numbers(study: Study, store: Store) -> None:
    """Assert that the data set holds what the scene gives."""
    with open_study(store.dataset_path(study.id)) as together:
        for case in study.cases():
            at = {name: case.values[name] for name in ("load_ratio", "friction")}
            found = together["peak_residual_tension"].sel(at).item()
            assert found == record(case.parameters).scalars["peak_residual_tension"]


def test_no_flipped_byte_of_a_run_goes_unnoticed(damaged: ComputedStudy) -> None:
    study, store = damaged
    path = store.run_path(first(study))
    whole = path.read_bytes()
    draw = random.Random(5)
    for at in [*draw.sample(range(len(whole)), 200), *range(len(whole) - 120, len(whole))]:
        flipped = bytearray(whole)
        flipped[at] ^= draw.randrange(1, 256)
        path.write_bytes(flipped)
        with pytest.raises(FileDamaged, match=path.stem):
            row(path)
    path.write_bytes(whole)
    assert row(path)["status"] == "ok"


def flip(study: Study, store: Store) -> None:
    path = store.run_path(first(study))
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def swap(study: Study, store: Store) -> None:
    one, *_, other = (store.run_path(case.id) for case in study.cases())
    shutil.copyfile(other, one)


def foreign(study: Study, store: Store) -> None:
    path = store.run_path(first(study))
    xr.Dataset({"a": ("b", np.zeros(3))}, attrs={"id": path.stem}).to_netcdf(path)


def cut(study: Study, store: Store) -> None:
    path = store.run_path(first(study))
    path.write_bytes(path.read_bytes()[:-1])


def empty(study: Study, store: Store) -> None:
    store.run_path(first(study)).write_bytes(b"")


def directory(study: Study, store: Store) -> None:
    store.run_path(first(study)).unlink()
    store.run_path(first(study)).mkdir()


@pytest.mark.parametrize("damage", [flip, swap, foreign, cut, empty, directory])
@pytest.mark.parametrize("quietly", [False, True], ids=["", "same-length-and-time"])
def test_a_damaged_run_is_told_set_aside_and_computed_again(
    damaged: ComputedStudy,
    damage: Callable[[Study, Store], None],
    quietly: bool,
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    study, store = damaged
    damage(study, store)
    if quietly:  # as the disk damages it; the catalogue notices no change
        row = store.catalogue.rows([first(study)]).get(first(study))
        assert row is not None
        state = store.run_path(first(study)).stat()
        store.catalogue.put([row | {"size": state.st_size, "modified": state.st_mtime_ns}])
    with caplog.at_level(logging.WARNING, "studies"):
        assert repeat(study, store, monkeypatch) == [first(study)]
    (line,) = caplog.messages
    assert f"runs/{first(study)}.nc cannot be read and is now unreadable/" in line
    assert str(store.directory) not in line
    assert (store.directory / "unreadable" / f"{first(study)}.nc").exists()
    true_numbers(study, store)
    caplog.clear()
    assert repeat(study, store, monkeypatch) == []
    assert caplog.messages == []


def test_a_run_damaged_in_mid_study_is_missing_and_computed_by_the_next_repeat(
    damaged: ComputedStudy, monkeypatch: pytest.MonkeyPatch
) -> None:
    study, store = damaged
    flip(study, store)
    combined = combine(study, store, list(study.cases()))
    assert combined.counts == {"missing": 1, "ok": 3}
    assert combined.missing == [first(study)]
    assert combined.failed == []
    assert repeat(study, store, monkeypatch) == [first(study)]


@pytest.mark.parametrize("number", [errno.EMFILE, errno.EACCES, errno.ENOMEM, errno.EIO])
def test_a_run_that_the_system_cannot_read_now_stays_unless_the_disk_is_damaged(
    damaged: ComputedStudy, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    study, store = damaged

    def refuse(*given: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr("studies.storage.seal._read", refuse)
    if number == errno.EIO:
        assert store.found(first(study)) is None
    else:
        with pytest.raises(OSError, match=os.strerror(number)):
            store.found(first(study))
    assert store.run_path(first(study)).exists() == (number != errno.EIO)


def test_a_damaged_run_that_cannot_be_moved_is_missing(
    damaged: ComputedStudy, monkeypatch: pytest.MonkeyPatch
) -> None:
    study, store = damaged
    flip(study, store)
    monkeypatch.setattr(Store, "put_aside", lambda *given: None)
    assert combine(study, store, list(study.cases())).counts == {"missing": 1, "ok": 3}


def test_rows_without_files_are_missing(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    """Workers that see another directory report runs that are not here."""
    study = fake_study()
    elsewhere = Store(store.directory.parent / "elsewhere")
    rows = [elsewhere.write_run(case, record(case.parameters)) for case in study.cases()]
    monkeypatch.setattr(
        "studies.execution.run._Work.compute", lambda work, *_: work._keep("path", rows)
    )
    outcome = run_study(study, store)
    assert outcome.counts == {"missing": 4}
    assert not outcome.ok
    assert store.catalogue.stamps() == {}


def test_a_file_deleted_in_mid_study_is_missing(
    damaged: ComputedStudy, monkeypatch: pytest.MonkeyPatch
) -> None:
    study, store = damaged
    failed = store.catalogue.rows([first(study)]).get(first(study))
    assert failed is not None
    store.catalogue.put([failed | {"status": "error"}])  # so that there is something to compute
    last = list(study.cases())[-1].id
    monkeypatch.setattr(
        "studies.execution.run._Work.compute", lambda *_: store.run_path(last).unlink()
    )
    outcome = run_study(study, store)
    assert outcome.counts == {"ok": 3, "missing": 1}
    assert not outcome.ok


def test_a_run_without_its_seal_is_unknown_and_computed_again(
    damaged: ComputedStudy, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It may hold any number: here that of another run."""
    study, store = damaged
    case, *_, other = study.cases()
    wrong = run_content(FAKE, case, record(other.parameters))
    whole = xr.Dataset(wrong.variables, attrs=wrong.attrs)
    whole.to_netcdf(store.run_path(case.id), engine="h5netcdf")
    store.reconcile()
    assert store.catalogue.rows([case.id]).get(case.id) is None
    assert repeat(study, store, monkeypatch) == [case.id]
    true_numbers(study, store)


def test_a_data_set_that_was_changed_or_replaced_is_not_opened(damaged: ComputedStudy) -> None:
    study, store = damaged
    path = store.dataset_path(study.id)
    whole = path.read_bytes()
    other = fake_study("other")
    compute_here(other, store)
    unsealed = whole[: whole.rindex(b"\ndataset ")]
    for wrong in (
        whole.replace(b"fake", b"fume", 1), store.dataset_path(other.id).read_bytes(), unsealed
    ):  # fmt: skip
        path.write_bytes(wrong)
        for use in (open_study, open_netcdf):
            with pytest.raises(StudyError, match="Compute its study again"):
                use(path)
    run = store.run_path(first(study))
    content = run.read_bytes()
    run.write_bytes(content[:-1])
    with pytest.raises(StudyError, match="Compute its study again"):
        open_netcdf(run)
    run.write_bytes(content)
    assert run_study(study, store).ok
    true_numbers(study, store)


def test_numbers_have_checksums_that_every_reader_verifies(computed: ComputedStudy) -> None:
    study, store = computed
    for path in (store.run_path(first(study)), store.dataset_path(study.id)):
        with netCDF4.Dataset(path) as file:
            numbers = [
                variable for name, variable in file.variables.items() if variable.dtype is not str
            ]
            assert {variable.filters()["fletcher32"] for variable in numbers} == {True}


def other_page(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[4096:8192] = bytes(range(256)) * 16
    path.write_bytes(content)


def other_text(path: Path) -> None:
    content = path.read_bytes()
    assert content.count(b'"friction": 0.4') >= 1
    path.write_bytes(content.replace(b'"friction": 0.4', b'"friction": 0.5'))


def other_columns(path: Path) -> None:
    import sqlite3

    path.unlink()
    connection = sqlite3.connect(path)
    connection.execute("CREATE TABLE runs (id TEXT PRIMARY KEY, colour TEXT)")
    connection.close()


def a_directory(path: Path) -> None:
    path.unlink()
    (path / "inside").mkdir(parents=True)


def half(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:5000])


@pytest.mark.parametrize("damage", [other_page, other_text, other_columns, a_directory, half])
def test_a_damaged_catalogue_is_named_and_made_anew_from_the_files(
    damaged: ComputedStudy, damage: Callable[[Path], None], caplog: pytest.LogCaptureFixture
) -> None:
    _, store = damaged
    before = store.catalogue.runs()
    damage(store.catalogue.path)
    with pytest.raises(CatalogueDamaged, match=r"catalogue\.sqlite") as told:
        store.catalogue.runs()
        store.catalogue.stamps()
    assert str(store.directory) not in str(told.value)
    with store.writing():
        assert store.catalogue.runs() == before
    assert [line for line in caplog.messages if "catalogue.sqlite" in line]
    kept = store.directory / "unreadable" / "catalogue.sqlite" / "inside"
    assert kept.exists() == (damage is a_directory)


def test_a_study_under_a_lock_held_elsewhere_makes_a_damaged_catalogue_anew(
    damaged: ComputedStudy,
) -> None:
    study, store = damaged
    before = store.catalogue.runs()
    with store.writing():
        half(store.catalogue.path)
        outcome = run_study(study, Store(store.directory, held=True))
    assert outcome.ok
    assert outcome.computed == []
    assert store.catalogue.runs() == before


@pytest.mark.parametrize("name", ["dataset.nc", "study.json"])
@pytest.mark.parametrize("in_its_place", [b"", b"neither netCDF nor JSON", None])
def test_a_damaged_file_of_a_study_is_written_anew(
    damaged: ComputedStudy, name: str, in_its_place: bytes | None
) -> None:
    study, store = damaged
    path = store.study_path(study.id) / name
    before = path.read_bytes()
    path.unlink()
    if in_its_place is None:
        path.mkdir()
    else:
        path.write_bytes(in_its_place)
    assert run_study(study, store).ok
    if name == "study.json":
        assert path.read_bytes() == before
    true_numbers(study, store)


def test_a_run_that_is_deleted_is_gone_with_its_row(damaged: ComputedStudy) -> None:
    study, store = damaged
    store.discard([first(study)])
    assert not store.run_path(first(study)).exists()
    assert store.catalogue.rows([first(study)]).get(first(study)) is None
    assert store.catalogue.runs()[1] == 3


@pytest.mark.processes
def test_a_repeat_that_stops_leaves_failed_runs_and_the_data_set_as_they_were(
    store: Store,
) -> None:
    study = fake_study(trouble="limit", sweep={"load_ratio": [0.3, 0.9]})
    compute_here(study, store)
    seen: list[bytes] = []
    before = store.dataset_path(study.id).read_bytes()

    def stop() -> bool:
        seen.append(store.dataset_path(study.id).read_bytes())
        return True

    outcome = run_study(study, store, workers=1, should_stop=stop)
    assert outcome.stopped
    assert set(seen) == {before}
    assert outcome.counts == {"ok": 1, "limit_load": 1}, outcome.failed
    assert [message for *_, message in outcome.failed] == ["flows at 0.75"]


def test_a_worker_that_is_cut_off_in_mid_path_stores_no_run_as_failed(store: Store) -> None:
    """A worker that closes finds its connections gone; the scene has not failed."""
    (path, *_) = fake_study().paths()
    told: list[dict[str, object]] = []

    def report(content: dict[str, object]) -> None:
        told.append(content)
        if len(told) > 3:
            raise RuntimeError("ConnectionPool is closed")

    walk(PathTask(FAKE, (path,), store.directory, solver_hash()), report, lambda: False)
    assert not [content for content in told if "row" in content]
    assert not (store.directory / "runs").exists()


def test_a_repeat_replaces_old_files_once_though_a_worker_dies_in_between(store: Store) -> None:
    study = fake_study(sweep={"load_ratio": [0.3, 0.9]})
    compute_here(study, store)
    (path,) = study.paths()
    ids = [case.id for case in study.cases()]
    before = store.modified(ids)
    task = PathTask(FAKE, (path,), store.directory, solver_hash(), stale=before)
    walk(task, lambda _: None, lambda: False)
    after = store.modified(ids)
    assert all(after[run_id] != before[run_id] for run_id in ids)
    told: list[dict[str, Any]] = []
    walk(task, told.append, lambda: False)  # the worker that takes the task over
    assert [content["row"]["id"] for content in told] == ids
    assert store.modified(ids) == after


@pytest.mark.processes
def test_a_repeat_that_is_stopped_keeps_a_data_set_that_holds_more(
    damaged: ComputedStudy,
) -> None:
    study, store = damaged
    store.discard([first(study)])
    stopped = run_study(study, store, workers=1, should_stop=lambda: True)
    assert stopped.stopped and stopped.counts == {"ok": 4}
    true_numbers(study, store)
    again = run_study(study, store, workers=1)
    assert again.computed == [first(study)]
    true_numbers(study, store)
