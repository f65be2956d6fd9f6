"""A store at an address of fsspec, with a folder for what is in use."""

from __future__ import annotations

import json
import shutil
import time
import uuid
from datetime import UTC, datetime, timedelta
from pathlib import Path
from unittest.mock import Mock

import fsspec
import pytest
import xarray as xr

from residua.cli import main
from service.settings import chosen
from studies import Store, StoreBusy, StudyError, open_study, run_study
from studies.execution.estimate import estimate
from studies.execution.part import run_part
from studies.storage import claims
from studies.storage.blobs import directory_of
from studies.storage.claims import Claim
from studies.views.reading import begun_studies
from tests.studies.conftest import fake_study, results_of

FILES = fsspec.filesystem("memory")


@pytest.fixture
def address(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setenv("RESIDUA_CACHE", str(tmp_path / "here"))
    return f"memory://{uuid.uuid4().hex}/results"


def elsewhere(address: str, monkeypatch: pytest.MonkeyPatch) -> Store:
    """The store as another machine has it, where nothing was brought yet."""
    monkeypatch.setenv("RESIDUA_CACHE", f"{directory_of(address)}-{uuid.uuid4().hex}")
    return Store(address)


def test_a_study_is_computed_resumed_and_read(
    address: str, store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    study = fake_study()
    ids = sorted(study.run_ids())
    assert sorted(run_study(study, Store(address), workers=0).computed) == ids
    other = elsewhere(address, monkeypatch)
    assert estimate(study, other).to_compute == 0
    assert not list(other.directory.glob("*/*"))
    outcome = run_study(study, other, workers=0, resume=True)
    assert not outcome.computed and not outcome.anew and outcome.ok
    assert other.address == address and outcome.dataset.is_relative_to(other.directory)
    elsewhere(address, monkeypatch)
    run_study(study, store, workers=0)
    with open_study(store.directory) as own, open_study(address, study.name) as found:
        xr.testing.assert_equal(results_of(own), results_of(found))
    with pytest.raises(StudyError, match="must be a data set, a study or an output directory"):
        open_study(address, "nothing")
    assert not list(directory_of(address).glob("runs/*")), "only what is read is brought"
    run_study(fake_study("other", friction=0.1, sweep={"load_ratio": [0.1]}), other, workers=0)
    with pytest.raises(StudyError, match="holds several studies"):
        open_study(f"{address}/")


def test_what_others_store_is_seen(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    study, here = fake_study(sweep={"friction": [0.0, 0.2]}), Store(address)
    run_study(study, here, workers=0)
    first, second = study.run_ids()
    other = elsewhere(address, monkeypatch)
    with other.writing():
        other.discard([first])
        case = next(case for case in study.cases() if case.id == second)
        other.write_run(case, "it failed")
    here.reconcile()
    assert here.run(first) is None and here.run(second)["message"] == "it failed"  # type: ignore[index]
    assert here.catalogue.counts() == {"error": 1}
    other.save_study(fake_study("begun", sweep={"friction": [0.3]}))
    assert begun_studies(here.directory)[0].startswith("begun: 0 of 1 runs finished")
    here.discard_study(study.id)
    assert other.study_ids() != [study.id] and study.id not in other.study_ids()


def test_many_blobs_are_listed_as_each_is_asked_for(
    address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = Store(address)
    blobs, root = store.blobs, address.removeprefix("memory:/")
    names = [f"runs/{number:032x}.nc" for number in range(30)]
    for name in [*names, "runs/x/y.nc", "studies/z/study.json"]:
        FILES.pipe_file(f"{root}/{name}", name.encode())
    assert sorted(blobs.names("runs/*.nc")) == names
    assert blobs.stamps([*names, "runs/none.nc"]) == {n: blobs.stamps([n])[n] for n in names}
    for some in (names[::-1], names[:9][::-1]):
        assert list(blobs.stamps(some)) == some
    assert blobs.names("studies/*/study.json") == ["studies/z/study.json"]
    with monkeypatch.context() as patch:
        find = Mock(side_effect=FILES.find)
        patch.setattr(type(FILES), "find", find)
        assert store.size("studies/z/*", *names, "runs/none.nc") == sum(map(len, names)) + 20
    assert find.call_count == 2, "the folder, and all at once"
    path = blobs.path(names[0])
    state = path.stat()
    assert (state.st_size, state.st_mtime_ns) == blobs.stamps([names[0]])[names[0]]
    assert not blobs.path("runs/none.nc").exists() and blobs.stamps([]) == {}


def test_stamps_agree_where_a_listing_has_milliseconds(
    address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    blobs, root = Store(address).blobs, address.removeprefix("memory:/")
    tags = [f'"{number}"' for number in range(30)]
    at = datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)

    def known(path: str, more: timedelta) -> dict[str, object]:
        tag = tags[int(path[-2:])]
        return {"type": "file", "size": 1, "LastModified": at + more, "ETag": tag}

    names = [f"runs/{number:02}" for number in range(30)]
    exact, listed = timedelta(0), timedelta(milliseconds=678)
    found = {f"{root}/{name}": known(name, listed) for name in names}
    monkeypatch.setattr(type(FILES), "info", lambda self, path: known(path, exact))
    monkeypatch.setattr(type(FILES), "find", lambda self, path, detail: found)
    stamps = blobs.stamps(names)
    assert stamps == {name: blobs.stamps([name])[name] for name in names}
    assert len(set(stamps.values())) == 30, "the tag counts"


def test_a_damaged_blob_is_set_aside_and_a_damaged_copy_brought_again(
    address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    study, store = fake_study(sweep={"friction": [0.0, 0.2]}), Store(address)
    run_study(study, store, workers=0)
    first, second = study.run_ids()
    root = address.removeprefix("memory:/")
    store.run_path(first).write_bytes(b"damaged")
    assert store.found(first) is None and store.found(first) is not None
    assert FILES.exists(f"{root}/runs/{first}.nc") and not FILES.exists(f"{root}/unreadable")
    FILES.pipe_file(f"{root}/runs/{second}.nc", b"damaged")
    other = elsewhere(address, monkeypatch)
    assert run_study(study, other, workers=0, resume=True).computed == [second]
    assert FILES.cat_file(f"{root}/unreadable/{second}.nc") == b"damaged"
    assert run_study(study, store, workers=0, resume=True).ok


def test_a_damaged_file_of_a_scene_is_brought_again(address: str) -> None:
    blobs, root = Store(address).blobs, address.removeprefix("memory:/")
    names = ["scenes/a/scene.json", "scenes/a/wheel.msh"]

    def brought() -> list[bytes]:
        return [blobs.path(name).read_bytes() for name in names]

    for name in names:
        FILES.pipe_file(f"{root}/{name}", name.encode())
    sound = brought()
    (blobs.directory / "unreadable").mkdir()
    blobs.path(names[1]).write_bytes(b"damaged")
    blobs.move("scenes/a", "unreadable/a")
    assert brought() == sound and not FILES.exists(f"{root}/unreadable")
    blobs.move("scenes/a", "unreadable/b")
    assert not FILES.exists(f"{root}/scenes/a") and not blobs.path(names[0]).exists()


def test_a_writer_has_a_lease(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    here, other = Store(address), elsewhere(address, monkeypatch)
    with here.writing(), pytest.raises(StoreBusy, match="on another machine computes here"):
        other.writing().__enter__()
    with other.writing():
        pass
    lease = f"{address.removeprefix('memory:/')}/lock/writer.0"
    with here.writing():
        own = json.loads(FILES.cat_file(lease))["owner"]
    for owner, age, free in (("x", 100.0, False), ("x", 400.0, True), (own, 1.0, True)):
        known = {"owner": owner, "at": time.time() - age, "done": False}
        FILES.pipe_file(lease, json.dumps(known).encode())
        if free:
            with here.writing():
                continue
        with pytest.raises(StoreBusy), here.writing():
            pass


def test_machines_with_one_home_are_two_owners(
    address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    here = Store(address)
    with here.writing():
        shutil.copytree(tmp_path / "here", tmp_path / "again")  # without its lock
        monkeypatch.setenv("RESIDUA_CACHE", str(tmp_path / "again"))
        monkeypatch.setattr(claims, "_machine", lambda: "another")
        with pytest.raises(StoreBusy, match="on another machine"):
            Store(address).writing().__enter__()


def test_parts_share_a_store_and_respect_its_writer(
    address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    here, other = Store(address), elsewhere(address, monkeypatch)
    with here.sharing():
        with other.sharing(), here.sharing(), pytest.raises(StoreBusy):
            other.writing().__enter__()  # on one machine a writer sees those who share
        with other.writing(), pytest.raises(StoreBusy, match="on another machine computes here"):
            elsewhere(address, monkeypatch).sharing().__enter__()
    with here.sharing(), other.sharing():
        pass


def test_parts_meet_at_an_address(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    study, here = fake_study(), Store(address)
    other = elsewhere(address, monkeypatch)
    leases = here.blobs.claims()
    with leases.held("a") as claim:
        assert claim == Claim(0)
        with other.blobs.claims().held("a") as second:
            assert second is None
    with leases.held("a") as claim:
        assert claim == Claim(0)
        claim.done = True
    with leases.held("a") as claim:
        assert claim is None, "it stays for those that do not see yet what was done"
    computed = run_part(study, other.directory, (1, 2)).computed
    assert sorted(computed) == sorted(study.run_ids())
    assert not run_part(study, here.directory, (2, 2)).computed
    assert not run_study(study, here, workers=0, resume=True).computed


def test_leases_survive_trouble(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    leases, root = Store(address).blobs.claims(), f"{address.removeprefix('memory:/')}/claims"
    monkeypatch.setattr(claims, "_HALF", 0.0)
    FILES.pipe_file(f"{root}/a.0", b'{"owner": "", "at"')
    with leases.held("a") as claim:
        assert claim == Claim(1), "half a lease is that of an owner that died"

    def lost(*given: object, **named: object) -> None:
        raise RuntimeError("412 Precondition Failed")

    for done in (False, True):
        with monkeypatch.context() as patch, leases.held(f"b{done}") as claim:
            assert claim == Claim(0)
            claim.done = done
            for method in ("rm_file", "pipe_file"):
                patch.setattr(type(FILES), method, lost)
    with leases.held("c") as claim:
        assert claim == Claim(0)
        monkeypatch.setattr(type(FILES), "pipe_file", lost)
        with leases.held("c") as second:
            assert second is None
        with pytest.raises(StudyError), leases.held("d"):
            pass
        monkeypatch.setattr(type(FILES), "cat_file", lost)
        with pytest.raises(StudyError), leases.held("c"):
            pass  # who cannot read a lease does not take it over


@pytest.mark.parametrize("address", ["sftp://me:se/cret@host/x", "ftp://:secret@host:21/x"])
def test_a_password_in_an_address_is_refused_and_not_shown(
    address: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("RESIDUA_CACHE", str(tmp_path))
    monkeypatch.setenv("RESIDUA_DATA", address)
    for refused in (lambda: Store(address), chosen):
        with pytest.raises(StudyError, match=r"must have no password.* ~/.config/fsspec") as error:
            refused()
        assert "cret" not in str(error.value)
    with pytest.raises(SystemExit) as end:
        main(["table", address])
    assert end.value.code == 2
    told = capsys.readouterr().err
    assert "must have no password" in told and "cret" not in told and told.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_addresses_with_ports_and_signs_have_no_password(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RESIDUA_CACHE", str(tmp_path))
    for address in ("sftp://me@host:22/a", "hdfs://host:8020/a@b", "abfs://box@host/a:b@c"):
        assert directory_of(address).is_dir()


def test_a_file_at_an_address_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("RESIDUA_CACHE", str(tmp_path))
    with pytest.raises(SystemExit):
        main(["table", str(tmp_path), "--out", "s3://bucket/table.csv"])
    assert "--out: must be on this machine, not at an address" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(["table", "s3:/bucket"])
    assert "is an address" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_an_address_that_cannot_be_used_is_named(
    address: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    with pytest.raises(StudyError, match=r"directory = 'nowhere://x': cannot be used: Protocol"):
        Store("nowhere://x/")
    with pytest.raises(StudyError, match=r"directory = 's3:/x': is an address: give it as a text"):
        Store(Path("s3://x"))
    store = Store(address)

    def lost(*given: object, **named: object) -> None:
        raise RuntimeError("no route to the host")

    monkeypatch.setattr(type(FILES), "info", lost)
    reached = r"directory = 'memory://.*': must be an address that can be reached; the log has"
    with pytest.raises(StudyError, match=reached):
        store.run("0" * 32)
    monkeypatch.setattr(fsspec, "url_to_fs", lost)
    with pytest.raises(StudyError, match=reached):
        Store(address)
    assert caplog.text.count("cannot be reached: RuntimeError: no route to the host") == 2
