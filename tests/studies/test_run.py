"""A study carried out by worker processes."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest

from residua.cli import main
from studies import Store, Study, StudyEvent, StudyOutcome, open_study, run_study
from studies.definition.identity import solver_hash
from studies.execution.task import PathTask, Unfit, walk
from tests.studies.conftest import compute_here, fake_study
from tests.studies.fakes import FAKE, INCREMENTS, FakeParameters

pytestmark = [pytest.mark.processes, pytest.mark.usefixtures("one_worker")]

TROUBLES = ["none", "limit", "raise", "die"]


@pytest.fixture(scope="module")
def troubled(
    tmp_path_factory: pytest.TempPathFactory,
) -> tuple[Study, Store, StudyOutcome, list[StudyEvent], Path]:
    """A study in which every kind of path occurs, computed once by two workers."""
    directory = tmp_path_factory.mktemp("troubled")
    marks = directory / "marks"
    marks.mkdir()
    sweep = {"load_ratio": [0.3, 0.9], "trouble": TROUBLES}
    study = fake_study("troubled", sweep, mark=str(marks), seconds=0.2)
    store = Store(directory / "out")
    events: list[StudyEvent] = []
    outcome = run_study(study, store, workers=2, on_event=events.append)
    return study, store, outcome, events, marks


Troubled = tuple[Study, Store, StudyOutcome, list[StudyEvent], Path]


def test_one_path_in_trouble_does_not_take_the_others_with_it(troubled: Troubled) -> None:
    study, store, outcome, _, _ = troubled
    assert outcome.counts == {"ok": 5, "limit_load": 1, "error": 2}
    assert not outcome.ok
    assert not outcome.stopped
    with open_study(outcome.dataset) as together:
        found = {
            (load, trouble): together["status"].sel(load_ratio=load, trouble=trouble).item()
            for load in (0.3, 0.9)
            for trouble in TROUBLES
        }
    assert {found[0.3, trouble] for trouble in TROUBLES} == {"ok"}
    assert [found[0.9, t] for t in TROUBLES] == ["ok", "limit_load", "error", "error"]
    messages = {status: message for _, status, message in outcome.failed}
    assert messages["limit_load"] == "flows at 0.75"
    assert {message for _, status, message in outcome.failed if status == "error"} == {
        "ZeroDivisionError: the stiffness is gone",
        "the worker process died each time it computed this loading path; if memory ran out, "
        "use fewer workers or allow each more memory",
    }
    assert store.catalogue.runs(scene="fake")[1] == study.size


def test_a_path_that_kills_its_worker_is_tried_twice_and_no_more(troubled: Troubled) -> None:
    marks = troubled[4]
    begun = Counter(mark.read_text() for mark in marks.iterdir())
    # Three paths and the first attempt of the fatal one walk both loads; its second attempt
    # finds the first load done.
    assert begun == {"0.3 0.9": 4, "0.9": 1}


def test_events_tell_every_run_once_and_progress_ends_at_one(troubled: Troubled) -> None:
    study, _, _, events, _ = troubled
    runs = [event for event in events if event.kind == "run"]
    assert sorted(event.run for event in runs) == sorted(case.id for case in study.cases())
    progress = [event.progress for event in events]
    assert progress == sorted(progress)
    assert progress[-1] == pytest.approx(1.0)
    healthy = runs[0].path
    fractions = [
        event.fraction for event in events if event.path == healthy and event.kind == "path"
    ]
    assert fractions == sorted(fractions)
    assert len(fractions) >= 2 * INCREMENTS
    assert {event.path for event in events} == {path.id for path in study.paths()}


def test_nothing_is_left_of_unfinished_files(troubled: Troubled) -> None:
    store = troubled[1]
    assert list(store.directory.rglob("*.part")) == []


def test_resuming_leaves_failed_runs_and_needs_no_workers(troubled: Troubled) -> None:
    study, store, _, _, marks = troubled
    before = len(list(marks.iterdir()))
    outcome = run_study(study, store, resume=True)
    assert outcome.computed == []
    assert outcome.counts == {"ok": 5, "limit_load": 1, "error": 2}
    assert len(list(marks.iterdir())) == before


def test_running_again_computes_only_what_is_missing_or_failed(
    store: Store, tmp_path: Path
) -> None:
    study = fake_study(trouble="die_once", mark=str(tmp_path))
    first = run_study(study, store, workers=1)
    assert first.ok, "a path is taken up again where the dead worker left it"
    assert first.counts == {"ok": 4}
    lost = next(study.cases()).id
    store.run_path(lost).unlink()
    kept = {path: path.stat().st_mtime_ns for path in (store.directory / "runs").iterdir()}
    second = run_study(study, store, workers=1)
    assert second.computed == [lost]
    assert second.counts == {"ok": 4}
    assert all(path.stat().st_mtime_ns == before for path, before in kept.items())


def test_failed_runs_are_tried_again(store: Store, tmp_path: Path) -> None:
    study = fake_study(sweep={"load_ratio": [0.3, 0.9]}, trouble="limit", mark=str(tmp_path))
    assert run_study(study, store, workers=1).counts == {"ok": 1, "limit_load": 1}
    again = run_study(study, store, workers=1)
    assert again.counts == {"ok": 1, "limit_load": 1}
    assert len(again.computed) == 1
    assert sorted(mark.read_text() for mark in tmp_path.glob("0.*")) == ["0.3 0.9", "0.9"]


def test_a_record_that_cannot_be_written_breaks_its_own_run_only(store: Store) -> None:
    study = fake_study(sweep={"load_ratio": [0.3, 0.9, 1.2]}, trouble="unwritable")
    outcome = run_study(study, store, workers=1)
    assert outcome.counts == {"ok": 2, "error": 1}
    assert not outcome.stopped
    reason = "ValueError: residual_stress has dimensions without coordinates: ['nowhere']"
    assert list(outcome.failed) == [(list(study.cases())[1].id, "error", reason)]


def test_runs_left_over_without_a_wish_to_stop_are_no_stop(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("studies.execution.run._Work.compute", lambda *arguments: None)
    outcome = run_study(fake_study(), store, workers=1)
    assert outcome.counts == {"missing": 4}
    assert not outcome.stopped


def test_a_study_shares_the_runs_of_another(store: Store, tmp_path: Path) -> None:
    narrow = fake_study("narrow", {"friction": [0.0]}, load_ratio=0.3, mark=str(tmp_path))
    wide = fake_study("wide", {"friction": [0.0, 0.4]}, load_ratio=0.3, mark=str(tmp_path))
    assert run_study(narrow, store, workers=1).counts == {"ok": 1}
    shared = next(narrow.cases()).id
    outcome = run_study(wide, store, workers=1)
    assert outcome.counts == {"ok": 2}
    assert shared not in outcome.computed
    assert len(outcome.computed) == 1


def test_stopping_keeps_finished_runs_and_leaves_the_rest_missing(store: Store) -> None:
    study = fake_study(sweep={"friction": [i / 10 for i in range(10)]}, seconds=1.0)
    finished: list[str] = []

    def hear(event: StudyEvent) -> None:
        if event.kind == "run":
            finished.append(event.run)

    outcome = run_study(study, store, workers=2, on_event=hear, should_stop=lambda: bool(finished))
    assert outcome.stopped
    assert 1 <= outcome.counts["ok"] <= 4, "those that were running, and no more"
    assert outcome.counts["missing"] == 10 - outcome.counts["ok"]
    assert outcome.failed == []
    assert {path.stem for path in (store.directory / "runs").iterdir()} == set(outcome.computed)
    with open_study(outcome.dataset) as together:
        assert (together["status"] == "missing").sum() == outcome.counts["missing"]


def test_an_error_of_the_listener_stops_the_work_and_frees_the_store(store: Store) -> None:
    def hear(event: StudyEvent) -> None:
        raise LookupError("listener")

    with pytest.raises(LookupError, match="listener"):
        run_study(fake_study(seconds=0.5), store, workers=1, on_event=hear)
    with store.writing():
        pass


def test_the_command_builds_a_parameter_object_once_for_each_case_and_each_path(
    study_file: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A case is checked by building it; of a path the first one tells the cost, and goes on."""
    built: list[FakeParameters] = []
    checked = FakeParameters.__post_init__

    def counted(self: FakeParameters) -> None:
        built.append(self)
        checked(self)

    monkeypatch.setattr(FakeParameters, "__post_init__", counted)
    assert main(["run", str(study_file()), "--out", str(tmp_path / "out"), "--workers", "1"]) == 0
    points = [(each.load_ratio, each.friction) for each in built]
    assert points[:4] == [(0.3, 0.0), (0.3, 0.4), (0.9, 0.0), (0.9, 0.4)]
    assert points[4:] == [*2 * [(0.3, 0.0), (0.3, 0.4)], (0.9, 0.4)], "the last for its caption"


def test_a_worker_with_another_solver_refuses(store: Store) -> None:
    (path, *_) = fake_study().paths()
    task = PathTask(FAKE, (path,), store.directory, "0" * 32)
    assert task.source != solver_hash()
    with pytest.raises(Unfit, match="another version of the solver"):
        walk(task, lambda content: None, lambda: False)


def test_of_failed_runs_those_before_a_retry_are_computed_again(store: Store) -> None:
    study = fake_study(sweep={"load_ratio": [0.3, 0.9]}, trouble="limit")
    compute_here(study, store)
    failed = {
        run_id for run_id, row in store.sound(study.run_ids()).items() if row["status"] != "ok"
    }
    asked = time.time_ns()
    assert failed
    first = run_study(study, store, workers=1, resume=True, since=asked)
    assert set(first.computed) == failed
    again = run_study(study, store, workers=1, resume=True, since=asked)
    assert again.computed == []
