"""A full disk is one line, costs no run its outcome, and a repeat computes the rest."""

from __future__ import annotations

import errno
import pickle
import resource
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import h5netcdf
import numpy as np
import pytest

from studies import Store, StoreFull, Study, StudyError, run_study
from studies.definition.identity import solver_hash
from studies.execution.task import PathTask, walk
from studies.storage.combine import combine
from studies.storage.room import Reservoir
from tests.studies.conftest import compute_here, fake_study
from tests.studies.fakes import FAKE, record

pytestmark = pytest.mark.processes

ROOT = Path(__file__).parents[2]
Limit = Callable[[int], None]
LIMITED = """
import resource, sys
limit = int(sys.argv.pop(1))
resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
from residua.cli import main
import tests.studies.fakes
sys.exit(main(sys.argv[1:]))
"""
"""The command in a process whose files may not grow beyond a length; its workers inherit that."""


@pytest.fixture
def limited() -> Iterator[Callable[[int], None]]:
    """Limit the length of files in this process; Python ignores the signal that comes with it."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)

    def limit(length: int) -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (length, before[1]))

    yield limit
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


def command(limit: int, file: Path, out: Path) -> subprocess.CompletedProcess[str]:
    arguments = [str(limit), "run", str(file), "--out", str(out), "--workers", "1"]
    return subprocess.run(
        [sys.executable, "-c", LIMITED, *arguments],
        cwd=ROOT, capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip


def test_the_command_ends_with_one_line_and_a_repeat_computes_the_rest(
    study_file: Callable[..., Path], tmp_path: Path
) -> None:
    out = tmp_path / "out"
    file = study_file(points=60)
    told = command(100_000, file, out)
    assert told.returncode == 1
    assert told.stderr == f"fake: 4 runs to compute\nresidua: no room is left in {out}\n"
    assert "Traceback" not in told.stdout
    store = Store(out)
    assert store.catalogue.runs(status="error")[1] == 0
    assert not list(out.rglob("*.nc"))
    study = Study.from_toml(file)
    compute_here(study, store)  # as a repeat does, without the seconds that worker processes take
    assert combine(study, store, list(study.cases())).counts == {"ok": 4}
    assert list(out.rglob("*.part")) == []


def test_a_study_without_room_for_a_run_begins_nothing(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    usage = shutil.disk_usage(store.directory.parent)
    monkeypatch.setattr(shutil, "disk_usage", lambda path: usage._replace(free=9_000_000))
    monkeypatch.setattr(
        "studies.execution.run.own_workers", lambda *_: pytest.fail("a worker is started")
    )
    with pytest.raises(StoreFull, match="no room is left in"):
        run_study(fake_study(points=30), store, workers=1)
    assert not list(store.directory.glob("runs/*"))


def test_a_worker_without_room_stores_no_run_as_failed(store: Store, limited: Limit) -> None:
    (path, *_) = fake_study(points=60).paths()
    reports: list[dict[str, object]] = []
    limited(100_000)
    with pytest.raises(StoreFull, match=str(store.directory)):
        walk(PathTask(FAKE, (path,), store.directory, solver_hash()), reports.append, lambda: False)
    assert list((store.directory / "runs").iterdir()) == []
    assert not any("row" in each for each in reports)


def test_a_data_set_without_room_leaves_the_one_before(store: Store, limited: Limit) -> None:
    study = fake_study(points=30)
    compute_here(study, store)
    before = store.dataset_path(study.id).read_bytes()
    for length in (100, 5_000, len(before) // 2, len(before) - 1):
        limited(length)
        with pytest.raises(StoreFull):
            combine(study, store, list(study.cases()))
        limited(resource.RLIM_INFINITY)
        assert store.dataset_path(study.id).read_bytes() == before
        assert list(store.directory.rglob("*.part")) == []
    assert combine(study, store, list(study.cases())).counts == {"ok": 4}


def test_a_catalogue_without_room_is_told_and_stays_as_it_was(
    computed: tuple[Study, Store], tmp_path: Path, limited: Limit
) -> None:
    store = Store(shutil.copytree(computed[1].directory, tmp_path / "copy"))
    before = store.catalogue.runs()
    (row, *_) = before[0]
    limited(store.catalogue.path.stat().st_size)
    with pytest.raises(StoreFull, match="no room is left in"):
        store.catalogue.put(row | {"id": f"{number:032x}"} for number in range(500))
    limited(resource.RLIM_INFINITY)
    assert store.catalogue.runs() == before


def test_what_hdf5_wrote_without_room_is_read_back(tmp_path: Path, limited: Limit) -> None:
    """HDF5 sees one sound file, whatever part of it is on the disk."""
    limited(20_000)
    noise = np.random.default_rng(3).random((600, 500))  # more than HDF5 holds itself
    with Reservoir(tmp_path / "a.nc") as disk:
        with h5netcdf.File(disk, "w") as file:
            file.dimensions = {"a": 600, "b": 500}
            variable = file.create_variable("v", ("a", "b"), "f8", chunks=(1, 500))
            for position, values in enumerate(noise):
                variable[position] = values
            np.testing.assert_array_equal(variable[...], noise)
        with pytest.raises(OSError) as told:
            disk.check()
    assert told.value.errno == errno.EFBIG
    assert (tmp_path / "a.nc").stat().st_size <= 20_000


def test_a_file_with_room_is_what_was_written(tmp_path: Path) -> None:
    with Reservoir(tmp_path / "a") as disk:
        disk.write(b"0123456789")
        disk.seek(4)
        disk.write(b"xy")
        disk.check()
    assert (tmp_path / "a").read_bytes() == b"0123xy6789"


def test_a_real_device_without_room_is_told(tmp_path: Path) -> None:
    """On a file system of 1 MB, where one may be mounted: the limit above stands in elsewhere."""
    small = tmp_path / "small"
    small.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=1m", "none", str(small)],
        capture_output=True, check=False,
    )  # fmt: skip
    if mounted.returncode:
        pytest.skip("no file system may be mounted here")
    try:
        store = Store(small / "out")
        case = next(fake_study(points=400).cases())
        with pytest.raises(StoreFull, match=r"no room is left in .*small/out"):
            store.write_run(case, record(case.parameters))
        (small / "filler").write_bytes(b"")
        with pytest.raises(OSError), (small / "filler").open("wb", buffering=0) as filler:
            while True:
                filler.write(b"x" * 4096)
        with pytest.raises(StoreFull), store.writing():
            store.catalogue.put([])
        assert list(store.directory.rglob("*.nc")) == []
    finally:
        subprocess.run(["umount", "-l", str(small)], check=True)


@pytest.mark.parametrize("name", ["runs", "studies"])
@pytest.mark.parametrize("in_its_place", ["file", "refuses"])
def test_a_directory_that_cannot_be_written_to_is_refused_at_once(
    store: Store, name: str, in_its_place: str
) -> None:
    store.directory.mkdir()
    if in_its_place == "file":
        (store.directory / name).touch()
    else:
        (store.directory / name).symlink_to("/proc")  # where not even root makes files
    with pytest.raises(StudyError, match="must be a directory to write in") as told:
        run_study(fake_study(), store, workers=1)
    assert told.value.value == str(store.directory)


def test_errors_survive_the_way_from_a_worker(store: Store) -> None:
    told = pickle.loads(pickle.dumps(StoreFull("out")))
    assert (type(told), str(told), told.directory) == (StoreFull, "no room is left in out", "out")


def test_a_store_whose_lock_is_held_takes_none(store: Store) -> None:
    with store.writing():
        half = store.directory / "runs" / "half.part"
        half.touch()
        with Store(store.directory, held=True).writing():
            assert half.exists()
