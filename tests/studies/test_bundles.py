"""Loading paths that share a set-up are computed by one worker, and judged one by one."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from solver.errors import ModelError
from solver.rolling.scenes.wheel_rail import WheelRailParameters
from solver.rolling.scenes.wheel_rail_contact import _contact_of
from solver.shipped import SCENES
from studies import Limits, Store, Study, run_study
from studies.definition.cases import LoadingPath
from studies.definition.identity import solver_hash
from studies.execution.bundles import bundles
from studies.execution.run import _Work
from studies.execution.task import PathTask, walk
from studies.execution.watch import Ticket
from tests.studies.fakes import FAKE, FakeParameters


def by_friction(parameters: FakeParameters) -> float:
    """The set-up of a path; there is none for the largest friction."""
    if parameters.friction == 1.0:
        raise ModelError("friction", 1.0, "must have a set-up")
    return parameters.friction


SHARING = replace(FAKE, setup=by_friction)


def study_of(sweep: dict[str, Any], **fixed: Any) -> Study:
    content = {"name": "shared", "scene": "fake", "parameters": fixed, "sweep": sweep}
    return Study.from_dict(content, SHARING)


def frictions(sweep: dict[str, Any], workers: int) -> list[list[float]]:
    found = bundles(SHARING, study_of(sweep).paths(), lambda: workers)
    return [[path.parameters.friction for path in bundle] for bundle in found]


def test_bundles_hold_paths_of_one_set_up_whatever_the_order_of_the_sweep() -> None:
    sweep = {"half_width": [10.0 + k for k in range(10)], "friction": [0.1, 0.2, 0.3]}
    assert frictions(sweep, 1) == [[0.1] * 10, [0.2] * 10, [0.3] * 10]
    # two bundles for each worker: 30 paths in at least 8
    assert frictions(sweep, 4) == [[f] * n for f in (0.1, 0.2, 0.3) for n in (2, 3, 2, 3)]
    assert frictions(sweep, 100) == [[f] for f in (0.1, 0.2, 0.3) for _ in range(10)]


def test_a_bundle_is_bounded_and_no_path_is_lost() -> None:
    study = study_of({"half_width": [10.0 + k for k in range(25)], "friction": [0.1, 0.2]})
    found = list(bundles(SHARING, study.paths(), lambda: 1))
    assert max(map(len, found)) <= 12
    paths = Counter(path.id for bundle in found for path in bundle)
    assert paths == Counter(path.id for path in study.paths())


def test_paths_without_a_set_up_are_alone() -> None:
    sweep = {"half_width": [10.0, 11.0, 12.0], "friction": [0.5, 1.0]}
    assert frictions(sweep, 1) == [[0.5] * 3, [1.0], [1.0], [1.0]]
    alone = bundles(FAKE, study_of(sweep).paths(), lambda: 1)
    assert {len(bundle) for bundle in alone} == {1}


def test_a_long_study_is_not_listed() -> None:
    drawn = 0

    def endless() -> Iterator[LoadingPath]:
        nonlocal drawn
        (path,) = study_of({"friction": [0.5]}).paths()
        while True:
            drawn += 1
            yield path

    next(bundles(SHARING, endless(), lambda: 1))
    assert drawn <= 500
    drawn = 0
    next(bundles(FAKE, endless(), lambda: 1))
    assert drawn == 1


def test_limits_and_starts_count_for_each_path() -> None:
    now, limits = time.monotonic(), Limits(path_seconds=5.0)
    ticket = Ticket(None, worker="w", begun=now - 4.0, heard=now - 1.0, starts=2)
    ticket.walks("first")
    assert (ticket.begun, ticket.starts) == (now - 4.0, 2), "the task began with this path"
    ticket.begun = now - 6.0
    assert "path_seconds" in ticket.overdue(limits)
    ticket.walks("second")
    assert ticket.overdue(limits) == ""
    assert ticket.starts == 1
    ticket.walks("second")
    assert ticket.begun == ticket.heard
    ticket.begun, ticket.starts = now - 6.0, 2
    ticket.walks("second", anew=True)
    assert (ticket.overdue(limits), ticket.starts) == ("", 1), "the next run of a search"


def test_a_stopped_bundle_begins_no_other_path(store: Store, tmp_path: Path) -> None:
    study = study_of({"half_width": [10.0, 11.0, 12.0]}, mark=str(tmp_path))
    task = PathTask(SHARING, tuple(study.paths()), store.directory, solver_hash())
    stored: list[str] = []

    def report(content: dict[str, Any]) -> None:
        if "row" in content:
            stored.append(content["path"])

    walk(task, report, lambda: len(stored) == 1)
    assert stored == [task.paths[0].id]
    assert len(list(tmp_path.glob("0.0-*"))) == 1
    walk(task, report, lambda: False)
    assert stored == [task.paths[k].id for k in (0, 0, 1, 2)]
    assert len(list(tmp_path.glob("0.0-*"))) == 3, "the first one is not computed again"


@pytest.mark.parametrize(("late", "failed"), [(0, []), (1, [1])])
def test_a_path_is_not_blamed_for_the_time_of_one_that_was_completed_meanwhile(
    store: Store, late: int, failed: list[int]
) -> None:
    """The first path of a bundle is complete when a limit on the time of a path is exceeded."""
    study = study_of({"half_width": [10.0, 11.0, 12.0]})
    store.save_study(study)
    store.reconcile()
    work = _Work(study, store, set(study.run_ids()), Limits(), 0, lambda event: None)
    paths = tuple(study.paths())
    work._walking.update({path.id: (1, 0.0) for path in paths})
    whole = PathTask(SHARING, paths, store.directory, solver_hash())
    walk(replace(whole, paths=paths[:1]), lambda _: None, lambda: False)
    work._close(whole, RuntimeError("took longer than 5 s"), paths[late].id)
    rows = {row["id"]: row["status"] for row in store.catalogue.runs()[0]}
    assert rows == {paths[0].cases[0].id: "ok"} | {paths[k].cases[0].id: "error" for k in failed}
    (rest,) = work._left
    assert rest.paths == paths[1 + len(failed) :]
    assert work._progress() == pytest.approx((1 + len(failed)) / 3)


@pytest.mark.processes
def test_a_path_that_kills_its_worker_is_blamed_alone(store: Store, tmp_path: Path) -> None:
    troubles = ["none", "die", "raise", "limit"]
    study = study_of({"trouble": troubles}, mark=str(tmp_path), load_ratio=0.9)
    ends: list[tuple[str, float]] = []
    outcome = run_study(
        study, store, workers=1, on_event=lambda event: ends.append((event.kind, event.progress))
    )
    rows = {row["parameters"]["trouble"]: row for row in store.catalogue.runs()[0]}
    assert [rows[each]["status"] for each in troubles] == ["ok", "error", "error", "limit_load"]
    assert rows["die"]["message"].startswith("the worker process died each time")
    assert rows["raise"]["message"] == "ZeroDivisionError: the stiffness is gone"
    assert len(outcome.computed) == 4
    begun = [mark.name.split("-")[-1] for mark in sorted(tmp_path.glob("0.0-*"))]
    # the last messages of a process that kills itself may be lost: then two more workers die
    assert len(begun) in (5, 7), "the fatal path at least twice, the others once"
    # of the later ones too, but Dask may close a worker that has just been started
    assert begun[0] == begun[1], "one worker has the paths of a bundle"
    progress = [progress for _, progress in ends]
    assert progress == sorted(progress) and progress[-1] == pytest.approx(1.0)


def test_a_rail_is_set_up_for_its_geometry_alone() -> None:
    setup: Any = SCENES["wheel_rail"].setup
    first = setup(WheelRailParameters(traction=0.1))
    assert first == setup(WheelRailParameters(traction=-0.5, friction=0.3, yield_stress=400.0))
    assert first != setup(WheelRailParameters(cant=0.0))
    assert first != setup(WheelRailParameters(lateral_position=1.0))


def test_the_contact_of_a_rail_is_searched_once_for_all_drives_and_materials() -> None:
    """A search takes a tenth of a second; a study asks for the set-up of each path."""
    setup: Any = SCENES["wheel_rail"].setup
    searched = _contact_of.cache_info().misses
    for traction in (0.1, 0.2, 0.3):
        for yield_stress in (400.0, 500.0):
            setup(WheelRailParameters(load=87e3, traction=traction, yield_stress=yield_stress))
    assert _contact_of.cache_info().misses == searched + 1
