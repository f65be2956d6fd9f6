"""The data set of a study while it runs, and as a Zarr store."""

from __future__ import annotations

import asyncio
import gzip
import io
import struct
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import uvicorn
import xarray as xr
from fastapi.testclient import TestClient

from service import datasets, reading
from service.app import create_app
from service.keys import Keys, Scope
from service.settings import Settings
from service.turns import Share, Turns, beyond
from studies import Store, open_study
from studies.storage.tiles import KEYS, Tiles
from tests.service.servers import free_port
from tests.studies.conftest import compute_here, fake_study

AXES = {"load_ratio": [0.3, 0.9], "hardening": ["none", "isotropic"]}


class Running:
    """A service that computes nothing, with a study of which a half has been computed."""

    def __init__(self, home: Path, **settings: Any) -> None:
        self.study, self.store = fake_study(sweep=AXES), Store(home / "out")
        self.half = fake_study(sweep=AXES | {"hardening": ["none"]})
        compute_here(self.half, self.store)
        self.app = create_app(Settings(data=self.store.directory, **settings))
        self.jobs = self.app.state.jobs
        self.jobs.accept(self.study.id, self.study.to_dict(), self.study.run_ids())
        self.jobs.take()
        self.client = TestClient(self.app, "http://localhost", raise_server_exceptions=False)
        self.url = f"/studies/{self.study.id}"

    def dataset(self, **headers: str) -> Any:
        return self.client.get(f"{self.url}/dataset.nc", headers=headers)

    @property
    def whole(self) -> xr.Dataset:
        """The data set of the half that has ended."""
        return open_study(self.store.dataset_path(self.half.id))


pytestmark = pytest.mark.usefixtures("computing_here")


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    found = Running(tmp_path_factory.mktemp("running"))
    yield found
    found.app.state.datasets.close()


@contextmanager
def served(app: Any) -> Iterator[str]:
    """Serve an application from a thread, and give its address."""
    port = free_port()
    server = uvicorn.Server(uvicorn.Config(app, port=port, log_level="warning", lifespan="off"))
    thread = threading.Thread(target=server.run)
    thread.start()
    while not server.started:
        time.sleep(0.01)
    yield f"http://127.0.0.1:{port}"
    server.should_exit = True
    thread.join()


def test_a_running_study_has_a_data_set_of_the_runs_that_are_there(running: Running) -> None:
    answer = running.dataset()
    assert answer.status_code == 200
    found = xr.load_dataset(io.BytesIO(answer.content), engine="h5netcdf")
    there, missing = (found.sel(hardening=name) for name in ("none", "isotropic"))
    ended = running.whole.sel(hardening="none")
    xr.testing.assert_equal(there.drop_vars("hardening"), ended.drop_vars("hardening"))
    assert set(missing["status"].to_numpy().flat) == {"missing"}
    assert missing["residual_stress"].isnull().all()
    assert missing["peak_residual_tension"].isnull().all()
    assert running.dataset(**{"if-none-match": answer.headers["etag"]}).status_code == 304


def test_a_data_set_is_made_again_when_runs_were_added_but_not_too_often(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    running = Running(tmp_path)
    made: list[object] = []
    combined = reading.combined
    monkeypatch.setattr(reading, "combined", lambda *given: made.append(given) or combined(*given))
    monkeypatch.setattr(datasets, "REST", 1e6)

    def count() -> int:
        return xr.load_dataset(io.BytesIO(running.dataset().content))["status"].isin("ok").sum()

    assert [count(), count()] == [2, 2] and len(made) == 1
    more = fake_study(sweep=AXES | {"load_ratio": [0.3]})
    compute_here(more, running.store)
    assert count() == 2, "it was made a moment ago"
    running.app.state.datasets.made[running.study.id].until = 0.0
    assert count() == 3 and len(made) == 2
    running.jobs.dismiss(running.study.id)
    assert count() == 3, "a study that was cancelled has it too"
    folder = running.app.state.datasets.folder
    running.app.state.datasets.close()
    assert not folder.exists()


def test_the_one_before_is_given_while_one_of_more_runs_is_made(
    running: Running, monkeypatch: pytest.MonkeyPatch
) -> None:
    held, made, go = running.app.state.datasets, reading.combined, threading.Event()
    before = running.dataset().content
    offered = held.made[running.study.id]
    offered.of, offered.until, began = None, 0.0, list[object]()  # as when runs were added

    def combined(*given: Any) -> None:
        began.append(given)
        assert go.wait(20.0)
        made(*given)

    async def asked() -> tuple[list[Path], float]:
        job, share = running.jobs.get(running.study.id), Share(Turns(2), "anna")
        start = time.monotonic()
        paths = [await held.current(job, share, share) for _ in range(3)]
        waited = time.monotonic() - start
        go.set()
        await offered.tasks["anna"]
        return [*paths, await held.current(job, share, share)], waited

    monkeypatch.setattr(datasets, "BRIEFLY", 0.05)
    monkeypatch.setattr(datasets, "PATIENCE", 60.0)
    monkeypatch.setattr(datasets, "REST", 1e6)
    monkeypatch.setattr(reading, "combined", combined)
    (*earlier, later), waited = asyncio.run(asked())
    assert len({*earlier}) == 1 and earlier[0].read_bytes() == before and later != earlier[0]
    assert len(began) == 1 and waited < datasets.PATIENCE / 2, "one request waits, and briefly"


def test_one_that_took_long_stays_though_others_were_asked_for_meanwhile(
    running: Running, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(datasets, "KEPT", 1)
    held, made, first = datasets.Datasets(running.jobs, running.store), reading.combined, []
    later = fake_study("later", sweep=AXES | {"load_ratio": [0.3]})
    running.jobs.accept(later.id, later.to_dict(), later.run_ids())
    ended, turns = threading.Event(), Turns(2)

    def combined(content: dict[str, Any], *given: Any) -> None:
        assert content["name"] != later.name or ended.wait(60.0)
        made(content, *given)

    async def current(study_id: str) -> Path:
        share = Share(turns, study_id)
        return await held.current(running.jobs.get(study_id), share, share)

    async def both() -> Path:
        ids = (running.study.id, later.id)
        tasks = [asyncio.create_task(current(each)) for each in ids]
        path = await tasks[0]
        first.append(path.is_file())
        ended.set()
        return await tasks[1]

    monkeypatch.setattr(reading, "combined", combined)
    assert asyncio.run(both()).is_file() and first == [True]
    assert len(list(held.folder.iterdir())) == 1, "the older one is deleted then"
    held.close()


def test_a_study_that_chooses_its_runs_has_none_before_its_end(running: Running) -> None:
    goal = {"find": "first_yield", "between": [0.1, 1.0]}
    study = {"name": "goal", "scene": "fake", "parameters": {}, "sweep": {}, "goal": goal}
    running.jobs.accept("a" * 32, study, [], most=9, stage="0 of 1")
    answer = running.client.get(f"/studies/{'a' * 32}/dataset.nc")
    assert answer.status_code == 404 and "at its end" in answer.json()["detail"]


@pytest.mark.parametrize("ended", [True, False], ids=["ended", "running"])
def test_xarray_opens_a_study_as_a_zarr_store(running: Running, ended: bool) -> None:
    pytest.importorskip("zarr", reason="the extra `zarr` is not installed")
    study = running.half if ended else running.study
    with served(running.app) as address:
        url = f"{address}/studies/{study.id}"
        stored = open_study(url)
        with xr.open_zarr(f"{url}/zarr", chunks=None) as found:
            xr.testing.assert_equal(found.load(), stored)
            for name, each in stored.variables.items():
                assert found[name].attrs == each.attrs, name
                assert (found[name].dtype == each.dtype) == (each.dtype.kind in "fi"), name
            assert found.attrs["id"] == study.id


def test_keys_of_a_zarr_store_are_chunks_or_nothing(running: Running) -> None:
    def get(key: str, **headers: str) -> Any:
        return running.client.get(f"/studies/{running.study.id}/zarr/{key}", headers=headers)

    whole = get("zarr.json").json()
    arrays = whole["consolidated_metadata"]["metadata"]
    assert get("residual_stress/zarr.json").json() == arrays["residual_stress"]
    sizes = arrays["residual_stress"]["chunk_grid"]["configuration"]["chunk_shape"]
    assert sizes[:3] == [1, 1, 1], "a chunk is a run"
    there, missing = (get(f"residual_stress/c/0/0/{k}/0/0/0") for k in (0, 1))
    assert (there.status_code, missing.status_code) == (200, 404)
    tag = there.headers["etag"]
    assert get("residual_stress/c/0/0/0/0/0/0", **{"if-none-match": tag}).status_code == 304
    for key in (
        "", "zarr", "x", "x/c", "x/c/-1", "x/c/9", "x/c/0/0", "nothing/c/0", "nothing/zarr.json",
        "..%2f..%2fdataset.nc", "x/c/" + "9" * 400, ".zgroup", "x/c/\ud800",
    ):  # fmt: skip
        assert get(key.encode("utf-8", "surrogatepass").decode("latin-1")).status_code == 404, key


def test_parts_of_a_data_set_wait_for_the_budget_and_say_if_it_is_gone_then(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = Keys(tmp_path / "out").add("anna", Scope.READ)
    running, waited = Running(tmp_path, require_keys=True), list[str]()
    running.client.headers["authorization"] = f"Bearer {text}"
    state, chunk = running.app.state, f"{running.url}/zarr/residual_stress/c/0/0/0/0/0/0"

    def spend() -> None:
        for turns in (state.reading, state.combining):
            turns.charge("anna", 60.0)

    async def refilled(turns: Turns, caller: str) -> None:
        waited.append(caller)
        turns.refilled.clear()
        if gone:
            for path in state.datasets.folder.iterdir():
                path.unlink()

    monkeypatch.setattr(Turns, "_refilled", refilled)
    for gone in (False, True):
        spend()
        assert running.dataset().status_code == 429
        answer = running.client.get(chunk)
        if gone:
            assert answer.status_code == 503 and "ask again" in answer.json()["detail"]
            assert "retry-after" in answer.headers
        else:
            assert answer.status_code == 200 and "anna" in waited
    state.datasets.close()


def test_the_last_chunk_of_texts_is_as_long_as_the_others(tmp_path: Path) -> None:
    path, words = tmp_path / "words.nc", np.array(["a", "bc", "d"], dtype=object)
    chunks = {"word": {"chunksizes": (2,)}}
    xr.Dataset({"word": ("run", words)}).to_netcdf(path, engine="h5netcdf", encoding=chunks)
    tiles = Tiles(path)
    first, last = (gzip.decompress(tiles.content(f"word/c/{k}") or b"") for k in (0, 1))
    assert first == struct.pack("<II1sI2s", 2, 1, b"a", 2, b"bc")
    assert last == struct.pack("<II1sI", 2, 1, b"d", 0)


def test_one_who_read_another_layout_gets_an_error_in_place_of_values(running: Running) -> None:
    path = running.store.dataset_path(running.half.id)
    before = Tiles(path)
    for turn in range(1, len(KEYS)):
        assert before.content("x/c/0"), "the first encoding"
        with pytest.raises(LookupError, match="open it again"):
            Tiles(path, turn).content("x/c/0")
    job = running.jobs.get(running.half.id)
    with running.jobs.transaction() as queue:
        queue.execute("DELETE FROM layout")
    assert running.jobs.layout_turn(job.id, "another layout") == 0
    address = f"/studies/{job.id}/zarr/"
    assert running.client.get(f"{address}x/c/0").status_code == 409
    metadata = running.client.get(f"{address}x/zarr.json").json()
    assert metadata["chunk_key_encoding"]["configuration"] == {"separator": "."}
    assert running.client.get(f"{address}x/c.0").content == before.content("x/c/0")
    layout = before.layout
    turns = [running.jobs.layout_turn(job.id, each) for each in (layout, "other", layout)]
    assert turns == [1, 2, 3]


def test_a_data_set_that_takes_too_long_to_make_is_told_with_what_to_do(
    running: Running, monkeypatch: pytest.MonkeyPatch
) -> None:
    tried, whole = list[object](), reading.combined

    def combined(*given: Any) -> None:
        tried.append(given)
        Path(f"{given[-1]}.0.part").touch()  # its process is killed while it writes
        time.sleep(0.01)
        raise beyond("data set", running.study.id, datasets.SECONDS)

    monkeypatch.setattr(reading, "combined", combined)
    monkeypatch.setattr(datasets, "REST", 1e4)
    running.app.state.datasets.made.clear()
    for _ in range(2):
        answer = running.dataset()
        assert answer.status_code == 503 and "table.csv" in answer.json()["detail"]
        assert int(answer.headers["retry-after"]) >= 90
    assert len(tried) == 1, "it is not tried again at once"
    held = running.app.state.datasets
    assert not list(held.folder.glob("*.part"))
    held.made.clear()
    with monkeypatch.context() as small:
        small.setattr(reading, "combined", whole)
        before = running.dataset()
    offered = held.made[running.study.id]
    offered.of, offered.until = None, 0.0  # as when runs were added long after
    again = running.dataset()
    assert len(tried) == 2 and offered.until > time.monotonic()
    assert (again.status_code, again.content) == (200, before.content), "the one before stays"
    held.made.clear()
