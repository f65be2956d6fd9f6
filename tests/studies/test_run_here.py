"""A study that its own process computes, without workers."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from residua.cli import main
from residua.progress import ALONE
from studies import Store, StudyEvent, open_study, run_study
from studies.errors import StudyError
from studies.execution.executor import Here, Limits
from studies.execution.run import _Work
from tests.studies.conftest import fake_study

TROUBLES = ["none", "limit", "raise", "unwritable"]


def test_each_path_ends_as_on_a_worker_and_tells_its_progress(store: Store) -> None:
    study = fake_study(sweep={"load_ratio": [0.3, 0.9], "trouble": TROUBLES})
    events: list[StudyEvent] = []
    outcome = run_study(study, store, workers=0, on_event=events.append)
    assert outcome.counts == {"ok": 5, "limit_load": 1, "error": 2}
    assert len(outcome.computed) == 8 and not outcome.stopped
    progress = [event.progress for event in events]
    assert progress == sorted(progress) and progress[-1] == 1.0
    assert {event.run for event in events if event.kind == "run"} == set(outcome.computed)
    again = run_study(study, store, workers=0, resume=True)
    assert again.computed == [] and again.counts == outcome.counts


@pytest.mark.parametrize("scene", ["numbers", "followed"])
def test_a_goal_is_searched(store: Store, scene: str) -> None:
    """The pressure is 100 load_ratio (1 + friction) + 50; `followed` goes on along one path."""
    goal = {"of": "peak_contact_pressure", "at": 120.0, "between": [0.1, 4.0]}
    content = {"name": "goal", "scene": scene, "sweep": {"friction": [0.0, 0.4]}, "goal": goal}
    outcome = run_study(content, store, workers=0)
    assert not outcome.stopped
    assert len(outcome.computed) == len(outcome.asked) > 4
    with open_study(outcome.dataset) as found:
        assert found["load_ratio"].values == pytest.approx([0.7, 0.5], rel=0.02)


def test_the_report_is_not_prepared_in_the_processor_time_of_runs(
    study_file: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    prepared: list[None] = []
    monkeypatch.setattr("studies.views.report.prepare", lambda: prepared.append(None))
    options = ["--out", str(tmp_path / "out"), "--workers", "0"]
    assert main(["run", str(study_file()), *options]) == 0
    assert not prepared


def test_stopping_keeps_what_is_finished(store: Store) -> None:
    finished: list[str] = []

    def hear(event: StudyEvent) -> None:
        if event.kind == "run":
            finished.append(event.run)

    outcome = run_study(
        fake_study(), store, workers=0, on_event=hear, should_stop=lambda: bool(finished)
    )
    assert outcome.stopped
    assert outcome.counts == {"ok": 1, "missing": 3}


def test_an_error_of_the_listener_is_raised_and_frees_the_store(store: Store) -> None:
    def hear(event: StudyEvent) -> None:
        raise LookupError("listener")

    with pytest.raises(LookupError, match="listener"):
        run_study(fake_study(), store, workers=0, on_event=hear)
    with store.writing():
        pass


@pytest.mark.parametrize("goal", [False, True])
def test_workers_take_what_is_left_after_some_time(
    goal: bool, store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    content: dict[str, Any] = {"name": "late", "scene": "fake", "sweep": {"friction": [0.0, 0.4]}}
    if goal:
        content["goal"] = {"of": "peak_contact_pressure", "at": 120.0, "between": [0.1, 4.0]}
    by_workers: list[str] = []

    def compute(work: _Work, *_: object) -> None:
        before = set(work.computed)
        assert work.lacks and before
        work.compute_by(Here(math.inf), lambda: False)
        by_workers.extend(work.computed - before)

    monkeypatch.setattr(_Work, "compute", compute)
    events: list[StudyEvent] = []
    outcome = run_study(content, store, alone=1e-9, on_event=events.append)
    assert by_workers and not outcome.stopped
    assert set(by_workers) < set(outcome.computed)
    told = [event.run for event in events if event.kind == "run"]
    assert sorted(told) == list(outcome.computed), "each run is computed once"
    progress = [event.progress for event in events]
    assert progress == sorted(progress) and progress[-1] == 1.0
    run_study(content, store, alone=1e-9)  # nothing is left: no workers are started


@pytest.mark.parametrize(
    "limit", [{"stall_seconds": 9.0}, {"path_seconds": 9.0}, {"memory": "2GB"}]
)
def test_limits_that_end_a_worker_are_refused(store: Store, limit: dict[str, float | str]) -> None:
    with pytest.raises(StudyError, match=f"^{next(iter(limit))}"):
        run_study(fake_study(), store, workers=0, limits=Limits(**limit))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("seconds", "options", "workers", "alone"),
    [
        (0.1, [], None, ALONE),
        (0.1, ["--workers", "3"], 3, 0.0),
        (0.1, ["--memory", "2GB"], None, 0.0),
        (60.0, [], None, 0.0),
        (60.0, ["--workers", "0"], 0, 0.0),
    ],
)
def test_the_command_starts_no_workers_for_a_short_study(
    seconds: float,
    options: list[str],
    workers: int | None,
    alone: float,
    study_file: Callable[..., Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[object] = []

    def computed(*arguments: object, **given: object) -> None:
        asked.extend([given["workers"], given["alone"]])
        raise StudyError("study", "fake", "is not computed here")

    found = SimpleNamespace(
        cpu_seconds=(seconds / 2, seconds, 2 * seconds), to_compute=4, usual_runs=4, time="soon"
    )
    monkeypatch.setattr("residua.progress.estimate", lambda *of: found)
    monkeypatch.setattr("studies.execution.run.run_study", computed)
    assert main(["run", str(study_file()), "--out", str(tmp_path / "out"), *options]) == 2
    assert asked == [workers, alone]
