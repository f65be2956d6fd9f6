"""What is accepted is computed, whatever happens to the processes."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

import psutil
import pytest

from service.app import create_app
from service.jobs import Jobs
from service.settings import Settings
from studies import Store, Study, open_netcdf
from tests.architecture.sources import ROOT
from tests.service.servers import (
    COARSE_PUNCH,
    NOWHERE,
    PROGRAM,
    Server,
    environment,
    fake_study,
    free_port,
    wait_until,
)


def long_study(name: str, seconds: float = 0.2) -> dict[str, Any]:
    """Return a study of twelve runs in six paths that takes some seconds."""
    study = fake_study(name, seconds=seconds)
    study["sweep"]["friction"] = [i / 10 for i in range(6)]
    return study


def search(name: str) -> dict[str, Any]:
    """Return a study that searches at six places for some seconds."""
    goal = {"of": "max_plastic_strain", "at": 0.6, "between": [0.2, 1.0], "within": 0.1}
    sweep = {"friction": long_study(name)["sweep"]["friction"]}
    return fake_study(name, seconds=0.1) | {"sweep": sweep, "goal": goal}


def stored(server: Server) -> set[Path]:
    """Return the files of the finished runs."""
    return set((server.data / "runs").glob("*.nc"))


def repeated(server: Server, before: set[Path], since: int) -> list[str]:
    """Return the runs ``before`` that were computed again: in the log from line ``since`` on."""
    again, labels = set(server.computed()[since:]), []
    for path in before:
        with open_netcdf(path) as run:
            labels.append(json.dumps(json.loads(run.attrs["parameters"]), sort_keys=True))
    assert set(labels) <= set(server.computed())
    return [label for label in labels if label in again]


def children(server: Server) -> list[psutil.Process]:
    """Return the processes a service has started."""
    assert server.process is not None
    return psutil.Process(server.process.pid).children(recursive=True)


def alive(processes: list[psutil.Process]) -> list[psutil.Process]:
    """Return those that still run; an ended one may wait for its parent to notice."""
    return [
        process
        for process in processes
        if process.is_running() and process.status() != psutil.STATUS_ZOMBIE
    ]


def test_studies_outlive_a_service_that_is_stopped(lively: Server) -> None:
    others, computed = stored(lively), len(lively.computed())
    first = lively.post(long_study("first"))
    second = lively.post(fake_study("second", seconds=0.01))
    wait_until(lambda: len(stored(lively) - others) >= 3)
    with lively.client.stream("GET", f"/studies/{first}/events") as stream:
        next(stream.iter_lines())
        lively.stop()
    at_stop, stopped = stored(lively) - others, len(lively.computed())
    assert 3 <= len(at_stop) < 12
    lively.start()
    for study_id, runs in ((first, 12), (second, 4)):
        study = lively.finished(study_id)
        assert (study["status"], study["counts"]) == ("successful", {"ok": runs})
    assert len(stored(lively) - others) == 16
    assert repeated(lively, at_stop, stopped) == []
    assert len(lively.computed()) - computed <= 16 + lively.workers
    path = lively.data / "studies" / first / "dataset.nc"
    with open_netcdf(path) as dataset:
        assert bool(dataset["max_plastic_strain"].notnull().all())


def punch_study(frictions: int) -> dict[str, Any]:
    """Return a study of the real punch, coarse, in steps so small that a path takes a second."""
    return {
        "name": "interrupted",
        "scene": "punch",
        "parameters": COARSE_PUNCH | {"load_step": 0.04},
        "sweep": {
            "load_ratio": [0.4, 0.7],
            "friction": [round(0.1 + i / 50, 2) for i in range(frictions)],
        },
    }


@pytest.mark.long
def test_a_study_of_the_punch_outlives_a_service_that_is_killed(mortal: Server) -> None:
    mortal.workers = 2
    mortal.start()
    study = punch_study(frictions=4)
    study_id = mortal.post(study)
    wait_until(lambda: len(stored(mortal)) >= 2)
    family = children(mortal)
    mortal.kill()
    wait_until(lambda: not alive(family))
    kept = {path: path.stat() for path in stored(mortal)}
    assert 2 <= len(kept) < 8

    mortal.start()
    assert mortal.post(study) == study_id
    found = mortal.finished(study_id)

    assert (found["status"], found["counts"]) == ("successful", {"ok": 8})
    assert {path.stem for path in stored(mortal)} == {run["id"] for run in found["runs"]}
    for path, before in kept.items():
        now = path.stat()
        assert (now.st_ino, now.st_mtime_ns) == (before.st_ino, before.st_mtime_ns)
    assert not list(mortal.data.rglob("*.part"))
    with open_netcdf(mortal.data / "studies" / study_id / "dataset.nc") as dataset:
        assert dataset["residual_stress"].sizes["friction"] == 4
        assert bool(dataset["max_plastic_strain"].notnull().all())


def refinement(name: str) -> dict[str, Any]:
    """Return a refinement of 15 runs that takes some seconds."""
    refine = {"of": ["max_plastic_strain"], "most": 20}
    axes = {"load_ratio": [0.25, 0.5], "friction": [0.5, 0.75, 1.0]}
    return fake_study(name, seconds=0.1) | {"sweep": axes, "refine": refine}


def test_studies_that_choose_outlive_a_service_that_is_killed_and_a_caller_who_stops_them(
    lively: Server,
) -> None:
    others = stored(lively)
    refined_id = lively.post(refinement("refined"))
    study_id = lively.post(search("search"))
    wait_until(lambda: 2 <= len(lively.study(refined_id)["runs"]))
    assert lively.study(refined_id)["stage"].startswith("round 1, run ")
    family = children(lively)
    lively.kill()
    wait_until(lambda: not alive(family))
    at_kill, killed = stored(lively) - others, len(lively.computed())
    lively.start()
    refined = lively.finished(refined_id)
    assert (refined["status"], refined["stage"]) == ("successful", "ended")
    wait_until(lambda: lively.study(study_id)["stage"].startswith("2 of 6"))
    assert 0.0 < lively.study(study_id)["progress"] < 100.0
    before, stopped = stored(lively) - others, len(lively.computed())
    assert lively.client.delete(f"/studies/{study_id}").json()["status"] == "dismissed"
    assert lively.client.post(f"/studies/{study_id}/retry").status_code == 202
    found = lively.finished(study_id)
    assert (found["status"], found["stage"]) == ("successful", "6 of 6 searches ended")
    chosen = {run["id"] for each in (refined, found) for run in each["runs"]}
    assert {path.stem for path in stored(lively) - others} == chosen
    # a run that is killed or stopped before it is stored is computed again
    assert len(at_kill) >= 2 and repeated(lively, at_kill, killed) == []
    assert len(before) > len(at_kill) and repeated(lively, before, stopped) == []


def test_the_death_of_a_study_leaves_the_service_alive_and_is_made_good(lively: Server) -> None:
    others = stored(lively)
    study_id = lively.post(long_study("wounded", seconds=0.15))
    wait_until(lambda: len(stored(lively) - others) >= 3)
    before, killed = stored(lively) - others, len(lively.computed())
    for child in children(lively):
        child.kill()
    assert lively.client.get("/health").status_code == 200
    assert lively.finished(study_id)["counts"] == {"ok": 12}
    assert repeated(lively, before, killed) == []


def test_runs_that_kill_their_worker_fail_and_the_next_study_succeeds(lively: Server) -> None:
    deadly = fake_study("deadly", behaviour="die")
    deadly["sweep"] = {"friction": [0.1]}
    deadly_id, next_id = lively.post(deadly), lively.post(fake_study("next"))
    study = lively.finished(deadly_id)
    assert (study["status"], study["counts"]) == ("failed", {"error": 1})
    assert "worker" in study["runs"][0]["message"]
    assert lively.finished(next_id)["status"] == "successful"


@pytest.mark.long
def test_a_temporary_folder_that_a_kill_leaves_is_removed_at_the_next_start(
    mortal: Server, tmp_path: Path
) -> None:
    """The name of the folder is too long for a socket; workers start all the same."""
    (temporary := tmp_path / ("temporary" * 12)).mkdir()
    mortal.settings["TMPDIR"] = str(temporary)
    study = mortal.start().post(fake_study("left", seconds=0.5))
    wait_until(mortal.computed)
    assert mortal.process is not None
    left = set(temporary.iterdir())
    assert {each.name.rpartition("-")[0] for each in left} == {"residua-scratch"}
    family = psutil.Process(mortal.process.pid).children(recursive=True)
    for each in (mortal.process, *family):
        each.kill()
    mortal.process.wait()
    psutil.wait_procs(family, timeout=60)
    assert left == set(temporary.iterdir())
    mortal.start()
    assert not left & set(temporary.iterdir())
    assert mortal.finished(study)["status"] == "successful"


@pytest.mark.long
def test_a_copy_of_the_directory_is_restored_with_studies_that_ran_and_waited(
    mortal: Server, tmp_path: Path
) -> None:
    """The copy is made file by file while the service works, and the queue may be damaged in it."""
    mortal.settings["RESIDUA_STUDIES_AT_ONCE"] = "1"
    mortal.start()
    ended = mortal.post(fake_study("ended"))
    assert mortal.finished(ended)["status"] == "successful"
    ran = mortal.post(fake_study("ran", seconds=1.0))
    waited = mortal.post(fake_study("waited", seconds=0.01))
    wait_until(lambda: mortal.study(ran)["counts"].get("ok"))
    assert mortal.study(waited)["status"] == "accepted"
    elsewhere = Server(tmp_path / "elsewhere", settings=mortal.settings)
    with suppress(shutil.Error):  # a journal may be gone when its turn comes; the rest is copied
        shutil.copytree(mortal.data, elsewhere.data)
    mortal.kill()
    kept = len(list((elsewhere.data / "runs").glob("*.nc")))
    assert 4 < kept < 8
    try:
        elsewhere.start()
        for study in (ended, ran, waited):
            assert elsewhere.finished(study)["status"] == "successful"
            answer = elsewhere.client.get(f"/studies/{study}/dataset.nc")
            (fetched := tmp_path / "fetched.nc").write_bytes(answer.content)
            with open_netcdf(fetched) as dataset:
                plastic = dataset["max_plastic_strain"].sel(load_ratio=0.5)
                assert plastic.values.ravel().tolist() == [0.5, 0.5]
        assert len(elsewhere.computed()) == 12 - kept, "what the copy has is not computed again"
    finally:
        elsewhere.close()


def test_a_study_that_hangs_keeps_neither_a_stopped_nor_a_killed_service(lively: Server) -> None:
    def begun() -> int:
        return sum('"behaviour": "hang"' in line for line in lively.computed())

    study_id = lively.post(fake_study("hangs", behaviour="hang"))
    wait_until(begun)
    lively.stop()
    lively.start()
    wait_until(lambda: begun() >= 2)
    orphans = children(lively)
    lively.kill()
    lively.start()
    wait_until(lambda: not alive(orphans))
    assert lively.client.delete(f"/studies/{study_id}").json()["status"] == "dismissed"


def test_a_study_of_another_solver_fails_with_advice(mortal: Server) -> None:
    mortal.settings = NOWHERE
    mortal.data.mkdir(parents=True)
    jobs = Jobs(mortal.data / "jobs.sqlite")
    study = {"name": "old", "scene": "fake", "parameters": {}, "sweep": {}}
    jobs.accept("a" * 32, study, ["b" * 32])
    jobs.accept("c" * 32, study | {"parameters": {"gone": 1}}, ["d" * 32])
    mortal.start()
    assert "post it again" in mortal.finished("a" * 32)["message"]
    refused = mortal.finished("c" * 32)
    assert refused["status"] == "failed" and "parameters.gone" in refused["message"]


def refusal(data: Path, **settings: str) -> str:
    """Return the one line with which a service refuses to start."""
    ended = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(free_port()), str(data)],
        env=environment(Path(os.devnull)) | settings,
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert ended.returncode == 2, ended.stderr
    (line,) = ended.stderr.splitlines()
    return line


def test_a_second_service_on_the_same_directory_is_refused(lively: Server) -> None:
    line = refusal(lively.data, RESIDUA_LOCK_SECONDS="0.2")
    assert "has a service in this directory; stop it" in line
    assert lively.client.get("/health").status_code == 200


def test_bad_settings_are_refused_by_name(tmp_path: Path) -> None:
    assert "RESIDUA_WORKERS = 'many'" in refusal(tmp_path / "data", RESIDUA_WORKERS="many")
    file = tmp_path / "file"
    file.touch()
    assert str(file) in refusal(file)


def test_a_damaged_queue_is_named_kept_and_made_anew(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    queue = tmp_path / "jobs.sqlite"
    queue.write_text("no queue" * 1000)
    create_app(Settings(data=tmp_path))
    (line,) = [r.getMessage() for r in caplog.records if r.levelname == "WARNING"]
    assert "jobs.sqlite cannot be read and is now unreadable/jobs.sqlite" in line
    assert (tmp_path / "unreadable" / "jobs.sqlite").read_text() == "no queue" * 1000
    assert Jobs(queue).page(limit=1, offset=0) == ([], 0)


def test_a_damaged_catalogue_is_made_anew_from_the_runs(tmp_path: Path) -> None:
    study = Study.from_dict(punch_study(frictions=1))
    store = Store(tmp_path)
    case = next(study.cases())
    store.write_run(case, "reason")
    store.catalogue.path.write_text("no catalogue" * 1000)
    create_app(Settings(data=tmp_path))
    assert set(store.catalogue.stamps()) == {case.id}
