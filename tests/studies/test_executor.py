"""An executor of one's own: threads of this process."""

from __future__ import annotations

import queue
from collections.abc import Callable, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from studies import Store, StudyEvent, open_study, run_study
from studies.execution.executor import Event, Finished, Function, Limits, Message, StopCheck
from tests.studies.conftest import fake_study, results_of


class Threads:
    """Computes tasks by `concurrent.futures`."""

    workers = 3

    def run(
        self,
        function: Function,
        tasks: Iterable[Any],
        hear: Callable[[Event], None],
        should_stop: StopCheck,
        limits: Limits,
        priority: int,
    ) -> None:
        """See `Executor`."""
        told, given, running = queue.SimpleQueue[Event](), iter(tasks), 0

        def ended(task: Any, future: Future[Any]) -> None:
            error = future.exception()
            told.put(Finished(task, error if isinstance(error, Exception) else None))

        with ThreadPoolExecutor(self.workers) as pool:
            while True:
                while running < self.workers and not should_stop() and (task := next(given, None)):
                    report = lambda content: told.put(Message(content))  # noqa: E731
                    future = pool.submit(function, task, report, should_stop)
                    future.add_done_callback(partial(ended, task))
                    running += 1
                if not running:
                    return
                event = told.get()
                running -= isinstance(event, Finished)
                hear(event)


@pytest.mark.parametrize("goal", [False, True])
def test_a_study_is_computed_as_by_the_executors_of_the_package(goal: bool, tmp_path: Path) -> None:
    sweep = {"friction": [0.0, 0.2, 0.4]}
    study: Any = fake_study(sweep=sweep | {"load_ratio": [0.3, 0.9], "trouble": ["none", "raise"]})
    if goal:
        searched = {"of": "peak_contact_pressure", "at": 120.0, "between": [0.1, 4.0]}
        study = {"name": "goal", "scene": "fake", "sweep": sweep, "goal": searched}
    events: list[StudyEvent] = []
    own, here = Store(tmp_path / "own"), Store(tmp_path / "here")
    outcome = run_study(study, own, executor=Threads(), on_event=events.append)
    expected = run_study(study, here, workers=0)
    assert not outcome.stopped and outcome.counts == expected.counts
    assert set(outcome.computed) == set(expected.computed)
    assert sorted(event.run for event in events if event.kind == "run") == list(outcome.computed)
    with open_study(outcome.dataset) as found, open_study(expected.dataset) as same:
        assert results_of(found).identical(results_of(same).assign_attrs(found.attrs))
    again = run_study(study, own, executor=Threads(), resume=True)
    assert again.computed == [] and not again.anew


def test_a_study_is_stopped(store: Store) -> None:
    heard: list[str] = []
    paths = Threads.workers + 1
    sweep = {"friction": [k / 10 for k in range(paths)], "load_ratio": [0.25, 0.5]}
    outcome = run_study(
        fake_study(sweep=sweep), store, executor=Threads(),
        on_event=lambda event: heard.append(event.kind), should_stop=lambda: "run" in heard,
    )  # fmt: skip
    # however fast the paths are that run by then, the last one waits for the end of one of them
    assert outcome.stopped and 1 <= outcome.counts["ok"] <= 2 * Threads.workers
