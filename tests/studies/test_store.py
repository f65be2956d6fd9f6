"""What lies in the directory, and what the catalogue says of it."""

from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import pytest

from solver.files import appearing
from studies import CatalogueDamaged, Store, StoreBusy, Study, run_study
from tests.studies.conftest import compute_here, fake_study

pytestmark = pytest.mark.usefixtures("one_worker")

ROOT = Path(__file__).parents[2]
ComputedStudy = tuple[Study, Store]


def test_a_file_appears_whole_or_not_at_all(tmp_path: Path) -> None:
    target = tmp_path / "a.txt"
    with pytest.raises(ZeroDivisionError), appearing(target) as part:
        part.write_text("half")
        assert part.parent == target.parent
        raise ZeroDivisionError
    assert list(tmp_path.iterdir()) == []
    with appearing(target) as part:
        part.write_text("whole")
        assert not target.exists()
    assert target.read_text() == "whole"
    assert list(tmp_path.iterdir()) == [target]


def test_two_writers_of_one_file_do_not_mix(tmp_path: Path) -> None:
    target = tmp_path / "a.txt"
    with appearing(target) as one, appearing(target) as other:
        one.write_text("one")
        other.write_text("other")
    assert target.read_text() == "one"


def test_the_writer_clears_what_killed_writers_left(store: Store) -> None:
    runs = store.directory / "runs"
    runs.mkdir(parents=True)
    (runs / f"{'0' * 32}.nc.abc.part").write_text("half")
    with store.writing():
        assert list(runs.iterdir()) == []


def test_a_claim_that_cannot_be_deleted_ends_no_writer(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    claims, unlink = store.directory / "claims", os.unlink
    claims.mkdir(parents=True)
    for name in (".nfs01", "a.0", "b.0"):
        (claims / name).touch()

    def held(path: Any, **more: Any) -> None:
        if str(path).endswith(".nfs01"):
            raise OSError(errno.EBUSY, "busy")
        unlink(path, **more)

    monkeypatch.setattr(os, "unlink", held)
    with store.writing():
        assert [path.name for path in claims.iterdir()] == [".nfs01"]


@pytest.mark.processes
def test_a_second_writer_is_refused_and_the_lock_dies_with_its_process(store: Store) -> None:
    code = (
        "import sys; from studies import Store\n"
        f"with Store({str(store.directory)!r}).writing():\n"
        "    print('held', flush=True); sys.stdin.read()"
    )
    holder = subprocess.Popen(
        [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=ROOT
    )
    with holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == b"held\n"
        with pytest.raises(StoreBusy), store.writing():
            pass
        holder.kill()
    with store.writing():
        pass


def test_reading_makes_nothing(store: Store) -> None:
    assert store.catalogue.runs() == ([], 0)
    assert store.catalogue.rows(["0" * 32]).get("0" * 32) is None
    assert store.catalogue.rows(["0" * 32]) == {}
    assert not store.directory.exists()


@pytest.mark.parametrize("bad", ["", "x" * 32, "../../etc/passwd", "0" * 31, "0" * 32 + "\n"])
def test_ids_that_are_not_ids_reach_no_file(store: Store, bad: str) -> None:
    for locate in (store.run_path, store.study_path, store.dataset_path):
        with pytest.raises(ValueError, match="content id"):
            locate(bad)


def test_a_saved_study_is_found_again(computed: ComputedStudy) -> None:
    study, store = computed
    assert store.study(study.id) == study
    text = (store.study_path(study.id, "study.json")).read_text()
    assert json.loads(text)["name"] == study.name


def test_a_folder_with_another_name_than_an_id_holds_no_study(store: Store) -> None:
    folder = store.directory / "studies" / "copy"
    folder.mkdir(parents=True)
    (folder / "study.json").write_text('{"name": "copy"}')
    assert store.study_ids() == [] and store.definition("copy") is None


def test_a_row_says_what_the_run_is(computed: ComputedStudy) -> None:
    study, store = computed
    case = next(study.cases())
    row = store.catalogue.rows([case.id]).get(case.id)
    assert row is not None
    assert row["scene"] == "fake"
    assert row["status"] == "ok"
    assert row["parameters"] == case.values
    assert row["scalars"]["increments"] == 10
    assert row["cpu_seconds"] == 0.0
    assert (store.directory / row["path"]).is_file()


def test_the_catalogue_is_queried_by_parameter(computed: ComputedStudy) -> None:
    _, store = computed
    query = store.catalogue.runs
    assert query()[1] == 4
    assert query(friction=0.4)[1] == 2
    assert query(friction=0.4, load_ratio=0.9)[1] == 1
    assert query(hardening="none", state="plane_stress", scene="fake", status="ok")[1] == 4
    assert query(hardening="isotropic")[1] == 0
    assert query(scene="punch")[1] == 0
    assert query(status="error")[1] == 0
    assert query(**{"a' OR 1 --": 1})[1] == 0
    assert query(**{'a"': 1})[1] == 0


def test_pages_cover_every_run_once(computed: ComputedStudy) -> None:
    _, store = computed
    pages = [store.catalogue.runs(limit=3, offset=offset) for offset in (0, 3, 6)]
    assert [len(rows) for rows, _ in pages] == [3, 1, 0]
    assert {total for _, total in pages} == {4}
    assert len({row["id"] for rows, _ in pages for row in rows}) == 4


def test_a_catalogue_that_was_deleted_is_made_anew_from_the_files(store: Store) -> None:
    compute_here(fake_study(trouble="limit"), store)
    before = store.catalogue.runs()
    store.catalogue.path.unlink()
    with pytest.raises(CatalogueDamaged, match=r"catalogue\.sqlite is missing or damaged"):
        store.catalogue.runs()
    with store.writing():
        pass
    assert store.catalogue.runs() == before
    assert {row["status"] for row in before[0]} == {"ok", "limit_load"}
    assert json.dumps(before[0], allow_nan=False)


def test_the_catalogue_forgets_files_that_are_gone(store: Store) -> None:
    study = fake_study()
    compute_here(study, store)
    gone = next(study.cases()).id
    store.run_path(gone).unlink()
    store.reconcile()
    assert store.catalogue.runs()[1] == 3
    assert store.catalogue.rows([gone]).get(gone) is None


def test_a_damaged_catalogue_is_made_anew(store: Store) -> None:
    compute_here(fake_study(), store)
    rows = store.catalogue.runs()
    store.catalogue.path.write_text("not a catalogue at all, but long enough to be one" * 20)
    with store.writing():
        assert store.catalogue.runs() == rows


@pytest.mark.processes
def test_a_run_cut_short_is_no_run_and_is_computed_again(store: Store) -> None:
    study = fake_study()
    first, *others = (case.id for case in study.cases())
    compute_here(study, store)
    whole = store.run_path(first).read_bytes()
    store.run_path(first).write_bytes(whole[: len(whole) // 2])
    with store.writing():
        assert set(store.catalogue.stamps()) == set(others)
    outcome = run_study(study, store, workers=1)
    assert outcome.counts == {"ok": 4}
    assert outcome.computed == [first]


def test_a_reader_sees_whole_transactions_while_a_writer_writes(computed: ComputedStudy) -> None:
    _, source = computed
    store = Store(source.directory.parent / "busy")
    store.directory.mkdir()
    rows, _ = source.catalogue.runs()
    counts: list[int] = []
    done = threading.Event()

    def read() -> None:
        while not done.is_set():
            counts.append(store.catalogue.runs(limit=1)[1])

    reader = threading.Thread(target=read)
    reader.start()
    for number in range(50):
        store.catalogue.put([row | {"id": f"{number:031x}{k}"} for k, row in enumerate(rows)])
    done.set()
    reader.join()
    assert store.catalogue.runs(limit=1)[1] == 200
    assert counts == sorted(counts)
    assert {count % 4 for count in counts} == {0}
