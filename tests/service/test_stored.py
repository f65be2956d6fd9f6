"""What is stored is checked whenever it is read; what fails is set aside and made again."""

from __future__ import annotations

import asyncio
import errno
import json
import logging
import os
import random
import shutil
import sqlite3
import sys
import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import httpx
import pytest

from service import retention
from service.app import create_app
from service.errors import Conflict
from service.examined import Examined
from service.examiner import Inspector
from service.job import StudyState
from service.jobs import Jobs
from service.keys import Keys, KeysError, Scope
from service.metrics import look
from service.recovery import Mender, open_queue
from service.retention import Keeper
from service.settings import Settings
from service.turns import Share, Turns
from studies import FileDamaged, Store, Study, StudyError, estimate, open_netcdf
from studies.errors import CatalogueDamaged, SceneError
from studies.scenes import scene as scene_module
from studies.scenes.scene import FileScene, read_scene
from studies.storage import seal, shelf
from tests.architecture.sources import ROOT
from tests.service.servers import NOWHERE, PATIENCE, Server, fake_study, wait_until
from tests.service.test_access import Ask, asking
from tests.service.test_errors import UNKNOWN, problem
from tests.studies.conftest import compute_here
from tests.studies.conftest import fake_study as fake

Damage = Callable[[Path], None]


def flip(path: Path) -> None:
    """Flip 3000 bytes that are spread over a file."""
    content = bytearray(path.read_bytes())
    for at in random.Random(7).sample(range(len(content)), min(3000, len(content))):
        content[at] ^= 0xFF
    path.write_bytes(content)


def edit(path: Path) -> None:
    """Set all numbers of a data set to 777, as a program for HDF5 files does."""
    with h5py.File(path, "r+") as file:
        for each in file.values():
            if each.ndim and each.dtype.kind == "f" and not each.is_scale:
                each[...] = 777.0


def emptied(path: Path) -> None:
    path.write_bytes(b"")


def pages(path: Path) -> None:
    """Overwrite all of a file but its first page."""
    content = path.read_bytes()
    path.write_bytes(content[:4096] + b"\xff" * (len(content) - 4096))


def other_file(path: Path) -> None:
    path.write_text("something else" * 1000)


@pytest.fixture
def place(tmp_path: Path) -> tuple[Study, Store, Jobs]:
    """A computed study of four runs, in the queue of a directory."""
    study, store = fake(), Store(tmp_path)
    compute_here(study, store)
    jobs = open_queue(tmp_path / "jobs.sqlite", store, None)
    assert jobs.get(study.id).state is StudyState.SUCCESSFUL
    return study, store, jobs


def warned(caplog: pytest.LogCaptureFixture, about: str) -> list[str]:
    """Return the lines of the log, of warnings and errors, about a file."""
    lines = [r.getMessage() for r in caplog.records if r.levelno >= logging.WARNING]
    return [line for line in lines if about in line]


# -- data sets ---------------------------------------------------------------------------------


def fetched(server: Server, study_id: str) -> bytes | None:
    """Return the data set of a study, or None while it is made again."""
    answer = server.client.get(f"/studies/{study_id}/dataset.nc")
    if answer.status_code == 200:
        return answer.content
    assert answer.headers.get("retry-after") or answer.status_code == 404, answer.text
    return None


def test_a_damaged_or_foreign_data_set_is_never_sent_but_made_again(lively: Server) -> None:
    study_id, other_id = (lively.post(fake_study(name)) for name in ("stored", "foreign"))
    for each in (study_id, other_id):
        assert lively.finished(each)["status"] == "successful"
    path, other = (lively.data / "studies" / each / "dataset.nc" for each in (study_id, other_id))
    with open_netcdf(path) as dataset:
        true = dataset.load()
    before, other_before = len(lively.computed()), other.read_bytes()

    def swap(path: Path) -> None:
        shutil.copyfile(other, path)

    damages: list[Damage] = [swap, edit, flip, emptied, Path.unlink]
    for damage in damages:
        damage(path)
        wrong = path.read_bytes() if path.exists() else b""
        sent = fetched(lively, study_id)
        assert sent is None, damage
        content = wait_until(lambda: fetched(lively, study_id))
        assert content != wrong and path.read_bytes() == content
        with open_netcdf(path) as dataset:
            assert dataset.load().equals(true)
        assert lively.finished(study_id)["counts"] == {"ok": 4}
    assert len(lively.computed()) == before, "the runs are there: none is computed again"
    aside = list((lively.data / "unreadable").glob(f"{study_id}.dataset.nc*"))
    assert len(aside) == len(damages) - 1
    assert other_before in [each.read_bytes() for each in aside], "nothing is deleted"
    log = (lively.home / "service.log").read_text()
    assert log.count(f"studies/{study_id}/dataset.nc cannot be read and is now unreadable/") == 4


@pytest.mark.parametrize("own", [True, False], ids=["own data set", "foreign data set"])
def test_a_study_without_its_runs_is_not_successful_when_the_queue_is_lost(
    place: tuple[Study, Store, Jobs], own: bool
) -> None:
    study, store, jobs = place
    if not own:
        other = fake("other", sweep={"load_ratio": [0.3, 0.9], "friction": [0.1, 0.2]})
        compute_here(other, store)
        shutil.copyfile(store.dataset_path(other.id), store.dataset_path(study.id))
    store.discard(list(study.run_ids()))
    jobs.path.unlink()
    queue = open_queue(jobs.path, store, None)
    assert queue.get(study.id).state is StudyState.ACCEPTED
    if not own:
        assert queue.get(other.id).state is StudyState.SUCCESSFUL


def test_a_check_is_kept_until_the_file_changes(
    place: tuple[Study, Store, Jobs], monkeypatch: pytest.MonkeyPatch
) -> None:
    study, store, _ = place
    store.dataset(study.id)
    read: list[object] = []
    fed = seal._fed
    monkeypatch.setattr(seal, "_fed", lambda *given: read.append(given) or fed(*given))
    store.dataset(study.id)
    assert read == []
    path = store.dataset_path(study.id)
    state = path.stat()
    flip(path)
    os.utime(path, ns=(state.st_atime_ns, state.st_mtime_ns))  # length and time are the same
    with pytest.raises(FileDamaged):
        store.dataset(study.id)


# -- runs --------------------------------------------------------------------------------------


def test_a_run_without_its_seal_is_unknown(
    place: tuple[Study, Store, Jobs], caplog: pytest.LogCaptureFixture
) -> None:
    """Its numbers may be those of another run; a picture of it was a failure of the service."""
    study, store, _ = place
    first, *_, other = study.run_ids()
    ask = asking(create_app(Settings(data=store.directory)))
    assert ask("GET", f"/runs/{first}.nc").status_code == 200
    content = store.run_path(other).read_bytes()
    store.run_path(first).write_bytes(content[: content.rindex(b"\nrun ")])
    for part in (".nc", "/map.png", ".vtu", ""):
        problem(ask("GET", f"/runs/{first}{part}"), 404)
    assert ask("GET", "/runs").json()["total"] == 3
    (line,) = warned(caplog, first)
    assert f"runs/{first}.nc cannot be read and is now unreadable/{first}.nc" in line
    assert str(store.directory) not in line


# -- catalogue and queue -----------------------------------------------------------------------

WELL = {
    "data_writable": True, "queue_readable": True, "catalogue_readable": True, "waiting": {}
}  # fmt: skip


@pytest.mark.parametrize("damage", [Path.unlink, other_file, emptied, pages])
@pytest.mark.parametrize("name", ["catalogue.sqlite", "jobs.sqlite"])
def test_a_lost_catalogue_or_queue_is_told_by_health_and_made_again_unasked(
    place: tuple[Study, Store, Jobs], name: str, damage: Damage, caplog: pytest.LogCaptureFixture
) -> None:
    study, store, jobs = place
    mender = Mender(jobs, store)
    mender.look([])
    assert look(store, jobs) == WELL
    before = store.catalogue.runs()
    damage(store.directory / name)
    found = look(store, jobs)
    if damage is not pages:  # that is found when the pages are read
        broken = f"{'queue' if name == 'jobs.sqlite' else 'catalogue'}_readable"
        assert {k for k in WELL if k != "waiting" and not found.get(k)} == {broken}
    mender.look([])
    assert look(store, jobs) == WELL
    assert store.catalogue.runs() == before
    assert jobs.get(study.id).state is StudyState.SUCCESSFUL
    assert warned(caplog, f"{name} has been made again")
    kept = list((store.directory / "unreadable").glob(f"{name}*"))
    assert len(kept) == (damage is not Path.unlink)


def test_a_catalogue_that_is_lost_is_not_taken_for_an_empty_one(
    place: tuple[Study, Store, Jobs],
) -> None:
    _, store, _ = place
    ask = asking(create_app(Settings(data=store.directory)))
    assert ask("GET", "/runs").json()["total"] == 4
    store.catalogue.path.unlink()
    problem(ask("GET", "/runs"), 503)
    assert ask("GET", "/health").json()["catalogue_readable"] is False


def test_a_run_that_is_stored_while_the_catalogue_is_made_again_is_in_it(
    place: tuple[Study, Store, Jobs], monkeypatch: pytest.MonkeyPatch
) -> None:
    study, store, _ = place
    late = store.run_path(next(study.run_ids()))
    content, aside = late.read_bytes(), Store.put_aside
    late.unlink()
    store.catalogue.path.unlink()

    def stored_meanwhile(self: Store, *given: Any) -> None:
        late.write_bytes(content)
        aside(self, *given)

    monkeypatch.setattr(Store, "put_aside", stored_meanwhile)
    store.reconcile()
    assert set(store.catalogue.stamps()) == set(study.run_ids())


def test_a_running_service_makes_its_lost_files_again(lively: Server) -> None:
    study_id = lively.post(fake_study("through"))
    assert lively.finished(study_id)["status"] == "successful"
    total = lively.client.get("/runs").json()["total"]

    def well(path: Path) -> bool:
        health = lively.client.get("/health")
        runs = lively.client.get("/runs")
        return path.exists() and {health.status_code, runs.status_code} == {200}

    for name in ("catalogue.sqlite", "jobs.sqlite"):
        for damage in (other_file, Path.unlink):
            damage(lively.data / name)
            wait_until(partial(well, lively.data / name))
            assert lively.client.get("/runs").json()["total"] == total
            assert lively.study(study_id)["status"] == "successful"
    assert lively.finished(lively.post(fake_study("after")))["status"] == "successful"


# -- scenes and studies ------------------------------------------------------------------------


@pytest.mark.parametrize(
    "content",
    ["[]", "null", "1", '{"content": ' + "[" * 900 + "]" * 900 + "}", "[" * 100_000, '{"file": 1}'],
    ids=["list", "null", "number", "deep", "endless", "entries"],
)
def test_a_damaged_scene_is_set_aside_and_spoils_nothing_else(
    tmp_path: Path, content: str, caplog: pytest.LogCaptureFixture
) -> None:
    store = Store(tmp_path)
    pin = read_scene(ROOT / "data/scenes/pin.toml")
    text = (ROOT / "data/scenes/pin.toml").read_text().replace("clearance", "play")
    (tmp_path / "other.toml").write_text(text)
    shutil.copy(ROOT / "data/scenes/pin.msh", tmp_path)
    other = read_scene(tmp_path / "other.toml")
    study = Study.from_dict({"name": "pins", "sweep": {"friction": [0.0]}}, scene=pin)
    store.save_study(study)
    store.save_scene(other)
    (tmp_path / "scenes" / pin.id / "scene.json").write_text(content)
    ask = asking(create_app(Settings(data=tmp_path)))  # the queue is lost too
    listed = ask("GET", "/scenes").json()
    assert other.id in {each["id"] for each in listed}
    assert pin.id not in {each["id"] for each in listed}
    assert ask("GET", "/runs?play=0.01").json() == {"total": 0, "items": []}
    assert ask("GET", f"/scenes/{pin.id}").status_code == 404
    assert ask("GET", f"/scenes/{other.id}").status_code == 200
    told = [line for line in warned(caplog, f"scenes/{pin.id}") if "is now unreadable/" in line]
    assert len(told) == 1
    assert (tmp_path / "unreadable" / pin.id / "scene.json").read_text() == content
    store.save_scene(pin)
    assert store.scene(pin.id) is not None


def test_a_scene_that_a_later_version_refuses_stays_and_is_not_listed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    pin = read_scene(ROOT / "data/scenes/pin.toml")
    Store(tmp_path).save_scene(pin)
    store, wrong = Store(tmp_path), StudyError("clearance", 0.01, "must be larger")
    for each in (SceneError("pin.toml", [wrong]), ValueError("a stricter rule")):
        with monkeypatch.context() as patch:
            patch.setattr(scene_module, "file_scene", lambda description, each=each: raised(each))
            assert [store.scenes(9), store.scenes(9), store.scene(pin.id)] == [[], [], None]
    assert len(warned(caplog, f"scenes/{pin.id} is not allowed in this version: ")) == 1
    assert not (tmp_path / "unreadable").exists()
    (kept,) = store.scene_files()
    assert kept.size > len(pin.description.meshes["pin.msh"].data), "its files count"
    assert [each.id for each in Store(tmp_path).scenes(9)] == [pin.id], "this version allows it"
    monkeypatch.setattr(scene_module, "file_scene", lambda description: raised(wrong))
    app = create_app(Settings(data=tmp_path, max_scenes_bytes=kept.size))
    with pytest.raises(Conflict, match="the posted scenes would take"):
        app.state.keeper.keep_scene("0" * 32, pin.description, "anna")
    ask = asking(app)
    assert ask("DELETE", f"/scenes/{pin.id}").status_code == 204
    assert not (tmp_path / "scenes" / pin.id).exists()


def raised(error: Exception) -> None:
    raise error


def test_a_pipe_in_place_of_a_mesh_is_damage(tmp_path: Path) -> None:
    pin, store = read_scene(ROOT / "data/scenes/pin.toml"), Store(tmp_path)
    store.save_scene(pin)
    mesh = tmp_path / "scenes" / pin.id / "pin.msh"
    mesh.unlink()
    os.mkfifo(mesh)
    assert store.scene(pin.id) is None
    assert (tmp_path / "unreadable" / pin.id / "pin.msh").is_fifo()


@pytest.mark.parametrize("content", [None, "", "[]", "{}", '{"name": "other"}'])
def test_the_definition_of_a_running_study_is_written_again(
    place: tuple[Study, Store, Jobs], content: str | None
) -> None:
    study, store, jobs = place
    path = store.study_path(study.id, "study.json")
    before = path.read_bytes()
    shutil.rmtree(path.parent)
    if content is not None:
        path.parent.mkdir()
        path.write_text(content)
    Mender(jobs, store).look([study.id])
    assert path.read_bytes() == before
    kept = list((store.directory / "unreadable").glob(f"{study.id}.study.json"))
    assert [each.read_text() for each in kept] == ([] if content is None else [content])


def test_the_definition_of_an_earlier_version_is_read(place: tuple[Study, Store, Jobs]) -> None:
    study, store, jobs = place
    (store.study_path(study.id, "study.json")).write_text(json.dumps(study.to_dict()))
    assert store.study(study.id) == study
    jobs.path.unlink()
    assert open_queue(jobs.path, store, None).get(study.id).state is StudyState.SUCCESSFUL
    store.save_study(study)
    assert not (store.directory / "unreadable").exists()


@pytest.mark.parametrize("open_and_close", ["[]", '{"a":}'])
def test_a_body_of_lists_deep_inside_one_another_is_refused(
    tmp_path: Path, open_and_close: str
) -> None:
    ask = asking(create_app(Settings(data=tmp_path)))
    half = len(open_and_close) // 2
    for deep in (60, 900):
        start, end = open_and_close[:-1] * deep, open_and_close[-1] * deep
        text = f'{{"name": "a", "sweep": {start}{"[]" if half > 1 else ""}{end}}}'
        answer = ask("POST", "/studies", content=text, headers={"content-type": "application/json"})
        assert "deep" in problem(answer, 422)["detail"]


# -- keys --------------------------------------------------------------------------------------


@pytest.fixture
def keyed(tmp_path: Path) -> tuple[Ask, dict[str, str]]:
    """A service that asks for keys, and the header of one."""
    header = {"authorization": f"Bearer {Keys(tmp_path).add('anna', Scope.READ)}"}
    ask = asking(create_app(Settings(data=tmp_path, require_keys=True)))
    assert ask("GET", "/studies", headers=header).status_code == 200
    return ask, header


def test_a_pipe_or_a_large_file_in_place_of_the_keys_holds_nobody_up(
    keyed: tuple[Ask, dict[str, str]], tmp_path: Path
) -> None:
    ask, header = keyed
    path = tmp_path / "keys.json"
    whole = path.read_bytes()

    def pipe() -> None:
        path.unlink()
        os.mkfifo(path)

    for put in (pipe, lambda: path.write_bytes(whole + b" " * 2_000_000), lambda: flip(path)):
        put()
        problem(ask("GET", "/studies", headers=header), 503)
        assert ask("POST", "/ui/sign-in", data={"key": "any"}).status_code == 503
        assert ask("GET", "/health").json() == {"status": "failing"}, "no runner is at work"
        assert ask("GET", "/health", headers=header).json() == {"status": "failing"}
        path.unlink()
        path.write_bytes(whole)
        assert ask("GET", "/studies", headers=header).status_code == 200


def test_keys_on_a_disk_that_hangs_hold_nobody_up(
    keyed: tuple[Ask, dict[str, str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    ask, header = keyed
    answers = threading.Event()
    monkeypatch.setattr("service.keys.SECONDS", 0.3)
    monkeypatch.setattr("service.keys.state_of", lambda path: answers.wait())
    try:
        for _ in range(2):
            assert "0.3 s" in problem(ask("GET", "/studies", headers=header), 503)["detail"]
            assert ask("GET", "/health").json() == {"status": "failing"}, "no runner is at work"
            assert ask("POST", "/ui/sign-in", data={"key": "any"}).status_code == 503
    finally:
        answers.set()


def test_the_file_of_keys_is_read_when_it_has_changed(
    keyed: tuple[Ask, dict[str, str]], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    ask, header = keyed
    with monkeypatch.context() as patch:
        patch.delattr("service.keys.content_of")
        assert ask("GET", "/studies", headers=header).status_code == 200
    Keys(tmp_path).remove("anna")
    problem(ask("GET", "/studies", headers=header), 401)


def test_keys_of_an_earlier_version_count_and_a_damaged_file_is_set_aside_by_the_next_change(
    keyed: tuple[Ask, dict[str, str]], tmp_path: Path
) -> None:
    ask, header = keyed
    path = tmp_path / "keys.json"
    content = json.loads(path.read_text())
    del content["seal"]
    path.write_text(json.dumps(content))
    assert ask("GET", "/studies", headers=header).status_code == 200
    path.write_text("{")
    Keys(tmp_path).add("bert", Scope.ADMIN)
    assert list(Keys(tmp_path).all()) == ["bert"]
    assert (tmp_path / "unreadable" / "keys.json").read_text() == "{"


@pytest.mark.parametrize("number", [errno.EMFILE, errno.EACCES, errno.ENOMEM, errno.EIO])
def test_keys_that_the_system_cannot_read_now_are_not_damaged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    Keys(tmp_path).add("anna", Scope.READ)
    for failing in ("studies.storage.seal.read_file", "studies.storage.seal.state_of"):
        with monkeypatch.context() as patch:
            patch.setattr(failing, partial(refuse, number))
            for change in (lambda keys: keys.add("bert", Scope.READ), lambda k: k.remove("anna")):
                with pytest.raises(KeysError, match="cannot be read"):
                    change(Keys(tmp_path))
    assert list(Keys(tmp_path).all()) == ["anna"]
    assert not (tmp_path / "unreadable").exists()
    (tmp_path / "keys.json").write_text("{")
    with pytest.raises(KeysError, match="damaged"):
        Keys(tmp_path).remove("anna")
    assert (tmp_path / "keys.json").read_text() == "{"


def refuse(number: int, *given: Any, **named: Any) -> None:
    """Fail as the system does when it has no descriptor, no right or no memory."""
    raise OSError(number, os.strerror(number))


def test_a_key_that_is_removed_ends_its_streams(mortal: Server) -> None:
    keys = Keys(mortal.data)
    headers = {
        name: {"authorization": f"Bearer {keys.add(name, Scope.SUBMIT)}"} for name in ("a", "b")
    }
    mortal.settings = NOWHERE | {"RESIDUA_REQUIRE_KEYS": "true", "RESIDUA_GRACE_SECONDS": "1"}
    mortal.start()
    mortal.client.headers.update(headers["a"])
    study_id = mortal.post(fake_study("watched"))

    async def watched() -> list[bool]:
        """Return whether the streams of two keys have ended after the first key is removed."""
        ended = [False, False]

        async def follow(number: int, header: dict[str, str]) -> None:
            base = str(mortal.client.base_url)
            async with (
                httpx.AsyncClient(base_url=base, timeout=60.0) as client,
                client.stream("GET", f"/studies/{study_id}/events", headers=header) as stream,
            ):
                async for _ in stream.aiter_lines():
                    begun.release()
                ended[number] = True

        begun = asyncio.Semaphore(0)
        tasks = [asyncio.create_task(follow(n, h)) for n, h in enumerate(headers.values())]
        for _ in tasks:
            await begun.acquire()
        await asyncio.to_thread(keys.remove, "a")
        await asyncio.wait({tasks[0]}, timeout=PATIENCE)
        found = list(ended)
        tasks[1].cancel()
        await asyncio.wait(tasks)
        return found

    assert asyncio.run(watched()) == [True, False]
    problem(mortal.client.get(f"/studies/{UNKNOWN}"), 401)


# -- many scenes -------------------------------------------------------------------------------


def test_scenes_are_read_once_for_lists_and_searches(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store, ids = Store(tmp_path / "data"), []
    for scene in scenes(tmp_path / "files", 5):
        store.save_scene(scene)
        ids.append(scene.id)
    ask = asking(create_app(Settings(data=store.directory)))

    def listed(query: str = "") -> list[str]:
        return [each["id"] for each in ask("GET", f"/scenes{query}").json() if each["id"]]

    assert set(listed("?limit=1000")) == set(ids)
    read: list[str] = []
    content_of = shelf.content_of
    made = shelf._made

    def without_meshes(folder: Path, *, whole: bool) -> Any:
        assert not whole
        return made(folder, whole=whole)

    monkeypatch.setattr(shelf, "_made", without_meshes)
    monkeypatch.setattr(shelf, "content_of", lambda p, n: read.append(n) or content_of(p, n))
    shelf._described.cache_clear()
    every = ask("GET", "/scenes?limit=1000").json()
    assert every == [each for k in range(len(every)) for each in page(ask, k)]
    assert ask("GET", "/runs?status=ok").json()["total"] == 0
    assert read == []
    for _ in range(2):
        assert ask("GET", "/runs?play3=0.01").json()["total"] == 0
    assert read == [f"scene {ids[3]}"], "only the scene that has the parameter, and once"
    for wrong in ("play3=-1", "play9=1", "scene=pine", "scene=pin&load=1"):
        problem(ask("GET", f"/runs?{wrong}"), 422)
    (store.directory / "scenes.sqlite").write_text("no index" * 100)
    assert set(listed("?limit=1000")) == set(ids)
    assert (store.directory / "unreadable" / "scenes.sqlite").exists()


@pytest.mark.parametrize("begun", [False, True], ids=["missing", "damaged"])
def test_an_index_of_scenes_that_cannot_be_made_again_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, begun: bool
) -> None:
    store = Store(tmp_path)
    store.save_scene(read_scene(ROOT / "data/scenes/pin.toml"))
    if begun:
        (tmp_path / "scenes.sqlite").write_text("no index" * 100)
        monkeypatch.setattr(Path, "rename", partial(refuse, errno.EROFS))
    else:  # as in a directory that is read-only
        cannot_open = sqlite3.OperationalError("unable to open database file")
        cannot_open.sqlite_errorcode = sqlite3.SQLITE_CANTOPEN
        monkeypatch.setattr(sqlite3, "connect", lambda *given, **named: raised(cannot_open))
    with pytest.raises(CatalogueDamaged if begun else OSError, match=r"scenes\.sqlite"):
        store.scenes(9)


def page(ask: Ask, offset: int) -> list[dict[str, Any]]:
    """Return a page of one scene."""
    found: list[dict[str, Any]] = ask("GET", f"/scenes?limit=1&offset={offset}").json()
    return found


def test_a_scene_is_deleted_unless_a_study_needs_it(tmp_path: Path) -> None:
    store = Store(tmp_path)
    pin = read_scene(ROOT / "data/scenes/pin.toml")
    study = Study.from_dict({"name": "pins", "sweep": {"friction": [0.0]}}, scene=pin)
    store.save_study(study)
    app = create_app(Settings(data=tmp_path))
    ask = asking(app)
    assert "needs this scene" in problem(ask("DELETE", f"/scenes/{pin.id}"), 409)["detail"]
    app.state.jobs.dismiss(study.id)
    assert ask("DELETE", f"/studies/{study.id}?purge=true").status_code == 204
    folder = store.save_study(study)  # as the command line does: the queue does not know it
    assert "needs this scene" in problem(ask("DELETE", f"/scenes/{pin.id}"), 409)["detail"]
    shutil.rmtree(folder)
    assert ask("DELETE", f"/scenes/{pin.id}").status_code == 204
    problem(ask("DELETE", f"/scenes/{pin.id}"), 404)
    assert pin.id not in {each["id"] for each in ask("GET", "/scenes").json()}


def test_scenes_of_a_key_and_of_all_have_a_largest_size(tmp_path: Path) -> None:
    first, second, third = scenes(tmp_path / "files", 3)
    taken = sum(len(mesh.data) for mesh in (first.description.meshes or {}).values())
    most = {"max_scenes_bytes": 29 * taken // 10, "max_key_scenes_bytes": 5 * taken // 2}
    keep = create_app(Settings(data=tmp_path / "data", **most)).state.keeper.keep_scene
    assert keep(first.id, first.description, "anna")
    assert not keep(first.id, first.description, "bert"), "it is known, and counts for the first"
    assert keep(second.id, second.description, "anna")
    for owner, whose in (("anna", "your"), ("bert", "the")):
        with pytest.raises(Conflict, match=f"^{whose} posted scenes would take .* delete some"):
            keep(third.id, third.description, owner)


def test_scenes_that_no_study_needs_are_deleted_before_studies(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    used, old, new = scenes(tmp_path / "files", 3)
    store = Store(tmp_path / "data")
    study = Study.from_dict({"name": "pins", "sweep": {"friction": [0.0]}}, scene=used)
    store.save_study(study)
    for scene in (old, new):
        store.save_scene(scene)
    keeper = create_app(Settings(data=store.directory, keep_bytes=0)).state.keeper
    keeper.sweep()
    assert len(store.scenes(9)) == 3, "all are of today"
    monkeypatch.setattr(retention, "FRESH", 0)
    keeper.jobs.accept(study.id, study.to_dict(), study.run_ids())
    looked: list[object] = []
    users = Keeper._users
    monkeypatch.setattr(Keeper, "_users", lambda self: looked.append(self) or users(self))
    keeper.sweep()
    assert len(looked) == 1, "the studies are read once for all scenes"
    assert [each.id for each in store.scenes(9)] == [used.id]
    assert keeper.jobs.get(study.id).state is StudyState.ACCEPTED


def scenes(folder: Path, count: int) -> list[FileScene]:
    """Return scenes that differ in the name of a parameter; their meshes are beside them."""
    folder.mkdir()
    shutil.copy(ROOT / "data/scenes/pin.msh", folder)
    text = (ROOT / "data/scenes/pin.toml").read_text()
    for number in range(count):
        (folder / f"{number}.toml").write_text(text.replace("clearance", f"play{number}"))
    return [read_scene(folder / f"{number}.toml") for number in range(count)]


def test_a_scene_is_not_deleted_while_a_study_of_it_is_accepted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (pin,) = scenes(tmp_path / "files", 1)
    study = Study.from_dict({"name": "pins", "sweep": {"friction": [0.0]}}, scene=pin)
    store = Store(tmp_path / "data")
    store.save_scene(pin)
    keeper = create_app(Settings(data=store.directory)).state.keeper
    saved, deleting = Store.save_study, threading.Thread(target=keeper.delete_scene, args=(pin.id,))

    def save(self: Store, study: Study, keep: bool) -> Path:
        folder = saved(self, study, keep)
        shutil.rmtree(folder)  # else the file would tell of the study
        deleting.start()
        deleting.join(0.5)
        return folder

    monkeypatch.setattr(Store, "save_study", save)
    monkeypatch.setattr(threading, "excepthook", lambda _: None)
    keeper.accept(Examined(study, list(study.run_ids()), estimate(study, store)), 0)
    deleting.join()
    assert store.scene(pin.id) is not None


def test_the_meshes_of_a_posted_scene_are_read_once_for_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever uses them later reads arrays: the library of meshes stays in a process shut in."""
    text, mesh = ((ROOT / "data/scenes" / name).read_bytes() for name in ("pin.toml", "pin.msh"))
    share = Share(Turns(1), "anna")
    text = text.replace(b"0.01", b"0.011")  # no other test has made this scene
    found, content = asyncio.run(Inspector(60.0).inspect(text, {"pin.msh": mesh}, share))
    store = Store(tmp_path)
    assert store.keep_scene(found.id, content, "anna")
    monkeypatch.setitem(sys.modules, "meshio", None)
    scene = store.scene(found.id)
    assert scene is not None and len(scene.model(scene.parameters()).bodies) == 2
    arrays = tmp_path / "scenes" / found.id / "pin.msh.arrays"
    flip(arrays)
    assert store.scene(found.id) is None
    assert store.keep_scene(found.id, content, "anna") and store.scene(found.id) is not None


def test_a_mesh_that_has_changed_spoils_its_scene_until_it_is_posted_again(tmp_path: Path) -> None:
    store = Store(tmp_path)
    pin = read_scene(ROOT / "data/scenes/pin.toml")
    store.save_scene(pin)
    mesh = tmp_path / "scenes" / pin.id / "pin.msh"
    whole = mesh.read_bytes()
    for find in (lambda: store.scene(pin.id), lambda: store.keep_scene(pin.id, pin.description)):
        mesh.write_bytes(whole.replace(b"1", b"2", 1))
        find()
        store.save_scene(pin)
        assert mesh.read_bytes() == whole and store.scene(pin.id) is not None
    assert len(list((tmp_path / "unreadable").glob(f"{pin.id}*"))) == 2
