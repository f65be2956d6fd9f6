"""What is deleted, what others need, and what a crash in the middle leaves behind."""

from __future__ import annotations

import asyncio
import shutil
import threading
from collections.abc import Callable, Sequence
from dataclasses import asdict
from datetime import UTC, datetime, timedelta
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from fastapi.testclient import TestClient

from service import child
from service.app import create_app
from service.errors import Busy, Conflict, NotFound
from service.job import StudyState
from service.jobs import Jobs, put
from service.pool import Pool
from service.processes import Starter
from service.recovery import Mender
from service.retention import Keeper
from service.settings import Settings
from studies import Store, Study
from studies.execution.access import Access
from tests.service.servers import PATIENCE
from tests.service.test_runner import Scripted
from tests.studies.conftest import compute_here
from tests.studies.test_goal import search_here


class PowerCut(BaseException):
    """The process ends here."""


class Place:
    """A data directory with a queue whose studies have been computed."""

    def __init__(self, directory: Path) -> None:
        self.store = Store(directory)
        self.store.reconcile()
        self.jobs = Jobs(directory / "jobs.sqlite")
        self.stopping: set[str] = set()

    def keeper(self, days: float | None = None, size: int | None = None) -> Keeper:
        return Keeper(self.jobs, self.store, self.stopping.__contains__, days, size)

    def computed(self, name: str, frictions: Sequence[float], known: bool = True) -> Study:
        """Return a study that has been computed, by the queue or by the command line."""
        content = {"name": name, "scene": "punch", "sweep": {"friction": list(frictions)}}
        study = Study.from_dict(content)
        for case in study.cases():
            self.store.catalogue.put([self.store.write_run(case, "reason")])
        (self.store.save_study(study) / "dataset.nc").write_bytes(b"the runs combined")
        if known:
            self.jobs.accept(study.id, study.to_dict(), ids(study))
            taken = self.jobs.take()
            assert taken is not None and taken.id == study.id
            self.jobs.finish(study.id, StudyState.SUCCESSFUL, "")
        return study

    def runs(self) -> set[str]:
        """Return the runs that are there, in the catalogue and as files."""
        files = {path.stem for path in (self.store.directory / "runs").iterdir()}
        assert files == set(self.store.catalogue.stamps())
        return files

    def there(self, study: Study) -> bool:
        """Whether a study or a part of it is still there."""
        with self.jobs.transaction("BEGIN") as queue:
            rows = queue.execute("SELECT 1 FROM run WHERE job = ?", (study.id,)).fetchall()
        known = study.id in {job.id for job in self.jobs.page(limit=100, offset=0)[0]}
        return known or bool(rows) or self.store.study_path(study.id).exists()


@pytest.fixture
def place(tmp_path: Path) -> Place:
    """A data directory without studies."""
    return Place(tmp_path)


def ids(study: Study) -> list[str]:
    """Return the ids of a study's runs in the order of its cases."""
    return [case.id for case in study.cases()]


def test_a_purged_study_takes_only_the_runs_no_other_study_needs(place: Place) -> None:
    shared = place.computed("shared", [0.1, 0.2, 0.3, 0.4])
    other = place.computed("other", [0.2])
    by_hand = place.computed("by-hand", [0.3], known=False)
    unreadable = place.store.directory / "studies" / "unreadable" / "study.json"
    unreadable.parent.mkdir()
    unreadable.write_text("[]")
    freed = place.keeper().purge(shared.id)
    assert freed > 0 and not place.there(shared)
    assert place.runs() == {*ids(other), *ids(by_hand)}
    assert place.store.dataset_path(other.id).is_file()
    assert place.store.dataset_path(by_hand.id).is_file()
    with pytest.raises(NotFound):
        place.keeper().purge(shared.id)


@pytest.mark.parametrize("most", [3, 10**6])
def test_runs_of_a_search_by_the_command_line_are_kept(place: Place, most: int) -> None:
    """Of a search that has not ended every run of its scene may be one."""
    goal = {"of": "peak_contact_pressure", "at": 120.0, "between": [0.1, 4.0]}
    search = Study.from_dict({"name": "goal", "scene": "fake", "goal": goal})
    tried = search_here(search, place.store, most)
    sweep = {"load_ratio": [place.store.run(each)["parameters"]["load_ratio"] for each in tried]}
    shared = Study.from_dict({"name": "shared", "scene": "fake", "sweep": sweep})
    assert {*ids(shared)} == {*tried}
    other = Study.from_dict({"name": "other", "scene": "fake", "sweep": {"load_ratio": [3.9]}})
    compute_here(other, place.store)
    for study in (shared, other):
        place.jobs.accept(study.id, study.to_dict(), ids(study))
        place.jobs.take()
        place.jobs.finish(study.id, StudyState.SUCCESSFUL, "")
        place.keeper().purge(study.id)
    assert place.runs() == {*tried, *(ids(other) if most == 3 else [])}


def test_runs_that_a_search_of_the_queue_may_need_are_kept(place: Place) -> None:
    goal = {"of": "peak_contact_pressure", "at": 120.0, "between": [0.1, 4.0]}
    search = Study.from_dict({"name": "goal", "scene": "fake", "goal": goal})
    tried = search_here(search, place.store)
    place.jobs.accept(search.id, search.to_dict(), [], most=search.size, stage=search.stage())
    sweep = {"load_ratio": [place.store.run(each)["parameters"]["load_ratio"] for each in tried]}
    shared = Study.from_dict({"name": "shared", "scene": "fake", "sweep": sweep})
    place.jobs.accept(shared.id, shared.to_dict(), ids(shared))
    place.jobs.finish(shared.id, StudyState.FAILED, "", standing=StudyState.ACCEPTED)
    with pytest.raises(Conflict, match="a study chooses its runs in the scene of this one"):
        place.keeper().delete_run(tried[0])
    place.keeper().purge(shared.id)
    assert place.runs() == {*tried}
    place.jobs.asked(search.id, tried, search.stage(1))
    place.jobs.finish(search.id, StudyState.SUCCESSFUL, "", standing=StudyState.ACCEPTED)
    place.keeper().purge(search.id)
    assert place.runs() == set()


@pytest.mark.parametrize("end", ["accepted", "running", "stopping"])
def test_what_is_at_work_is_not_deleted(place: Place, end: str) -> None:
    study = place.computed("busy", [0.1])
    place.jobs.retry(study.id)
    if end != "accepted":
        place.jobs.take()
    if end == "stopping":
        place.jobs.dismiss(study.id)
        place.stopping.add(study.id)
    with pytest.raises(Conflict):
        place.keeper().purge(study.id)
    with pytest.raises(Conflict, match=study.id):
        place.keeper().delete_run(ids(study)[0])
    place.keeper(days=1e-9, size=0).sweep()
    assert place.runs() == {*ids(study)}
    assert place.store.dataset_path(study.id).is_file()


def test_a_study_whose_run_was_deleted_keeps_its_data_set(place: Place) -> None:
    study = place.computed("kept", [0.1, 0.2])
    first, second = ids(study)
    place.keeper().delete_run(first)
    assert place.runs() == {second}
    assert place.store.dataset_path(study.id).is_file()
    assert place.jobs.get(study.id).state is StudyState.SUCCESSFUL


@pytest.mark.parametrize("point", ["before the runs", "after the runs", "after the directory"])
def test_a_crash_in_the_middle_leaves_a_study_that_can_be_deleted_again(
    place: Place, monkeypatch: pytest.MonkeyPatch, point: str
) -> None:
    study = place.computed("half", [0.1, 0.2, 0.3])
    owner, name = (
        ("service.retention.shutil", "rmtree")
        if point == "after the directory"
        else ("studies.Store", "discard")
    )
    with monkeypatch.context() as patch:
        act: Callable[..., object] = getattr(shutil if "shutil" in owner else Store, name)

        def interrupted(*arguments: Any) -> None:
            if not point.startswith("before"):
                act(*arguments)
            raise PowerCut

        patch.setattr(f"{owner}.{name}", interrupted)
        with pytest.raises(PowerCut):
            place.keeper().purge(study.id)
    job = place.jobs.get(study.id)
    assert job.state is StudyState.DISMISSED and "delete it again" in job.message
    assert (len(place.runs()) == 0) is point.startswith("after")
    place.keeper().purge(study.id)
    assert not place.there(study) and not place.runs()


def test_a_study_retried_in_the_middle_of_its_deletion_stays(
    place: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    study = place.computed("wanted", [0.1, 0.2])
    monkeypatch.setattr(
        Keeper, "_needed_elsewhere", lambda *_: place.jobs.retry(study.id) and set()
    )
    with pytest.raises(Conflict, match="accepted"):
        place.keeper().purge(study.id)
    assert place.jobs.get(study.id).state is StudyState.ACCEPTED
    assert place.runs() == {*ids(study)}


def test_a_study_deleted_as_its_turn_comes_is_not_begun(place: Place) -> None:
    study = place.computed("gone", [0.1])
    place.jobs.retry(study.id)
    job = place.jobs.take()
    assert job is not None
    place.jobs.dismiss(study.id)
    place.keeper().purge(study.id)
    settings = Settings(data=place.store.directory)
    runner = Scripted(
        settings,
        place.jobs,
        Pool(settings, Starter(0)),
        Starter(0),
        lambda: place.jobs,
        script=[[]],
    )
    asyncio.run(runner._compute(job))
    assert not runner.orders and not place.there(study)


def aged(place: Place, study: Study, days: int) -> None:
    """Make a study older than it is."""
    finished = datetime.now(UTC) - timedelta(days=days)
    with place.jobs.transaction() as queue:
        put(queue, place.jobs.read(queue, study.id), finished=finished.isoformat())


def test_studies_beyond_the_age_are_deleted(place: Place) -> None:
    old, young = place.computed("old", [0.1]), place.computed("young", [0.2])
    by_hand = place.computed("by-hand", [0.3], known=False)
    aged(place, old, 8)
    aged(place, young, 6)
    place.keeper(days=7).sweep()
    assert not place.there(old)
    assert place.runs() == {*ids(young), *ids(by_hand)}


def test_the_oldest_go_until_the_data_fit(place: Place) -> None:
    found = [place.computed(f"study-{i}", [i / 10]) for i in range(3)]
    for study, days in zip(found, (1, 3, 2), strict=True):
        aged(place, study, days)
    folders = [place.store.directory / name for name in ("runs", "studies")]
    everything = sum(p.stat().st_size for f in folders for p in f.rglob("*") if p.is_file())
    for name in ("scenes", "unreadable"):  # these stay: deleting a study does not free them
        (place.store.directory / name).mkdir()
        (place.store.directory / name / "large").write_bytes(b" " * 100_000)
    place.keeper(size=everything).sweep()
    assert all(place.there(study) for study in found)
    place.keeper(size=everything - 1).sweep()
    assert [place.there(study) for study in found] == [True, False, True]


def test_a_sweep_that_fails_is_told_and_tried_again(
    place: Place, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("service.retention.INTERVAL", 0.01)
    place.computed("old", [0.1])
    outcomes = iter([OSError("no"), None])

    def moody(directory: Path) -> None:
        if error := next(outcomes):
            raise error

    monkeypatch.setattr("service.retention.shutil.rmtree", moody)

    async def work() -> None:
        async with asyncio.timeout(PATIENCE), place.keeper(size=0).working():
            while place.jobs.page(limit=1, offset=0)[1]:
                await asyncio.sleep(0.01)

    asyncio.run(work())
    assert "could not be deleted" in caplog.text
    assert not place.runs()


def test_deletion_over_http(place: Place) -> None:
    study = place.computed("remote", [0.1, 0.2])
    app = create_app(Settings(data=place.store.directory))
    client = TestClient(app, "http://localhost")  # without its context: the runner does not work
    run, url = f"/runs/{ids(study)[0]}", f"/studies/{study.id}"
    client.post(f"{url}/retry")
    assert client.delete(run).status_code == 409
    refused = client.delete(url, params={"purge": True})
    assert refused.status_code == 409 and "dismiss it first" in refused.json()["detail"]
    assert client.delete(url).status_code == 200
    assert (client.delete(run).status_code, client.get(run).status_code) == (204, 404)
    assert client.delete(run).status_code == 404
    assert client.get(url).json()["counts"] == {"pending": 1, "error": 1}
    answers = [client.delete(url, params={"purge": True}) for _ in range(2)]
    assert [answer.status_code for answer in answers] == [204, 404]
    assert answers[0].content == b"" and client.get(url).status_code == 404
    assert not place.runs() and not place.there(study)


@pytest.mark.parametrize("there", [True, False])
def test_a_full_queue_deletes_nothing_that_was_there(place: Place, there: bool) -> None:
    study = place.computed("a", [0.0], known=False)
    folder = place.store.study_path(study.id)
    (folder / "study.json").write_text("damaged")
    if not there:
        shutil.rmtree(folder)
    place.jobs.longest = 0
    found = SimpleNamespace(study=study, estimate=SimpleNamespace(bytes=0), runs=ids(study))
    with pytest.raises(Busy):
        place.keeper().accept(found, 0)  # type: ignore[arg-type]
    assert (folder / "dataset.nc").exists() == there == folder.exists()


def test_a_study_that_is_posted_again_or_retried_keeps_its_licence(
    place: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    study = place.computed("mine", [0.1])
    queued, store = study.to_dict(), place.store
    store.save_study(Study.from_dict(queued | {"licence": "CC-BY-4.0"}))  # `residua run`
    other = Study.from_dict(queued | {"licence": "CC0-1.0", "files": {"a.toml": "x"}})
    found = SimpleNamespace(study=other, estimate=SimpleNamespace(bytes=0), runs=ids(study))
    assert not place.keeper().accept(found, 0)[1]
    Mender(place.jobs, store).look([study.id])
    assert (store.study(study.id).licence, store.study(study.id).files) == ("CC-BY-4.0", {})
    computed: list[Study] = []

    def run(study: Study, *_: Any, **__: Any) -> SimpleNamespace:
        computed.append(study)
        return SimpleNamespace(counts={}, asked=(), stage="")

    monkeypatch.setattr(child, "run_study", run)
    order = {"data": store.directory, "id": study.id, "study": queued, "since": 0, "priority": 0}
    outlet = SimpleNamespace(send=lambda *_: None)
    order |= {"access": asdict(Access("tcp://127.0.0.1:1")), "limits": {}}
    child.compute(order, outlet, threading.Event())
    assert [each.licence for each in computed] == ["CC-BY-4.0"]
    store.study_path(study.id, "study.json").unlink()
    Mender(place.jobs, store).look([study.id])
    assert store.study(study.id).licence == "", "what is lost is written from the queue"
