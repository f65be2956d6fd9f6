"""What a study tells its followers, when many ask at once."""

from __future__ import annotations

import asyncio
import json
import threading
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from service.errors import NotFound
from service.job import Job, StudyState
from service.jobs import Jobs
from service.overview import KEPT, Detail, Details
from service.pages.shown import cell_text, floors_of, numbers_of, numbers_shown, parameters_shown
from service.schemas import StudyDetail, Window
from service.turns import Share, Turns
from studies import Store
from studies.views.figures import group_of
from studies.views.table import RunTable, column_of

STUDY = {"name": "a", "scene": "fake", "parameters": {}, "sweep": {}}


class Counted(Details):
    """Counts how often it looks up a study, which takes a while."""

    looks = 0
    made = 0
    seconds = 0.05

    def _look(self, study_id: str, window: Window, detail: Detail) -> None:
        self.looks += 1
        super()._look(study_id, window, detail)

    def _look_up(self, job: Job, window: Window) -> StudyDetail:
        self.made += 1
        time.sleep(self.seconds)
        return super()._look_up(job, window)


@pytest.fixture
def details(tmp_path: Path) -> Counted:
    jobs = Jobs(tmp_path / "jobs.sqlite")
    jobs.accept("a", STUDY, ["b"])
    jobs.take()
    return Counted(jobs, Store(tmp_path))


def anyone() -> Share:
    return Share(Turns(2), "anyone")


def status(content: bytes) -> Any:
    return json.loads(content)["status"]


def test_one_look_serves_all_who_asked_before_it(details: Counted) -> None:
    async def crowd() -> None:
        for progress in range(1, 5):  # something changes all the time
            details.jobs.note("a", progress)
            await asyncio.gather(*(details.get("a", Window(), anyone()) for _ in range(50)))

    asyncio.run(crowd())
    assert 4 <= details.looks <= 8


def test_who_waits_while_another_caller_looks_takes_no_slot(details: Counted) -> None:
    """Nor does the answer go that is being looked up, if one who waits for it leaves."""
    began, answered = threading.Event(), threading.Event()
    look_up = details._look_up

    def slow(job: Job, window: Window) -> StudyDetail:
        if window.offset == 0:
            began.set()
            assert answered.wait(20.0), "another page waits for this one"
        return look_up(job, window)

    details._look_up = slow  # type: ignore[method-assign]

    async def three() -> None:
        turns = Turns(2, 60.0)
        anna = asyncio.create_task(details.get("a", Window(), Share(turns, "anna")))
        await asyncio.to_thread(began.wait)
        bert = asyncio.create_task(details.get("a", Window(), Share(turns, "bert")))
        for _ in range(20):
            await asyncio.sleep(0)  # it has got where it waits
        other = await details.get("a", Window(offset=1), Share(turns, "cora"))
        bert.cancel()
        await asyncio.wait([bert])
        assert ("a", 100, 0) in details.kept
        answered.set()
        assert status(other) == status(await anna) == "running"

    asyncio.run(three())
    kept = details.kept.get(("a", 100, 0))
    assert kept is not None and not kept.one.locked()


def test_what_has_not_changed_is_not_looked_up(details: Counted) -> None:
    async def twice() -> None:
        first = await details.get("a", Window(), anyone())
        assert first == await details.get("a", Window(), anyone())

    asyncio.run(twice())
    assert details.made == 1


def test_who_asks_after_a_change_sees_it_although_others_look_already(details: Counted) -> None:
    async def change() -> None:
        before = asyncio.create_task(details.get("a", Window(), anyone()))
        while not details.looks:
            await asyncio.sleep(0.001)
        details.jobs.finish("a", StudyState.FAILED, "why")
        assert status(await details.get("a", Window(), anyone())) == "failed"
        assert status(await before) in ("running", "failed")

    asyncio.run(change())


def test_answers_are_kept_in_a_limited_number(details: Counted) -> None:
    details.seconds = 0.0

    async def pages() -> None:
        for offset in range(KEPT + 20):
            await details.get("a", Window(offset=offset), anyone())

    asyncio.run(pages())
    assert len(list(details.kept)) == KEPT


def test_nothing_is_kept_of_a_study_that_does_not_exist(details: Counted) -> None:
    async def unknown() -> None:
        await details.get("a", Window(), anyone())
        for _ in range(3):
            with pytest.raises(NotFound):
                await details.get("b", Window(), anyone())

    asyncio.run(unknown())
    assert list(details.kept) == [("a", 100, 0)]


def test_a_number_that_is_rounding_is_shown_as_zero() -> None:
    """Beside others of its unit, as in tables of the command; a ratio has no level."""
    scalars = {
        "peak_patch_pressure": 2863.0, "peak_residual_tension": 2e-5, "lateral_force": 2.8e-9,
        "longitudinal_force": 6.1, "max_plastic_strain": 1e-12,
    }  # fmt: skip
    shown = {
        each.name: text for each, (text,) in numbers_shown(numbers_of([{"scalars": scalars}], None))
    }
    assert shown == {
        "peak_patch_pressure": "2863", "peak_residual_tension": "0", "lateral_force": "0",
        "longitudinal_force": "6.1", "max_plastic_strain": "1e−12",
    }  # fmt: skip


def test_slip_and_wear_of_rounding_are_zero_also_alone() -> None:
    """Wear is a product, and no rounding beside other lengths, until it is no length at all."""
    for wear, text in ((1e-11, "1e−11"), (1e-21, "0")):
        run = {"scalars": {"wear_depth": wear, "slip_length": 1e-21}}
        shown = {each.name: own for each, (own,) in numbers_shown(numbers_of([run], None))}
        assert shown == {"wear_depth": text, "slip_length": "0"}


def test_a_run_shows_all_digits_of_its_counts() -> None:
    run = {"scalars": {"degrees_of_freedom": 1234567, "increments": None, "cpu_seconds": 1234567.0}}
    shown = {each.name: text for each, (text,) in numbers_shown(numbers_of([run], None))}
    assert shown == {"degrees_of_freedom": "1234567", "increments": "–", "cpu_seconds": "1.235e+06"}


def test_a_run_shows_the_accuracy_with_which_it_was_computed() -> None:
    for stored, told in ((0, "draft"), (1, "draft, computed with standard")):
        run = {"parameters": {"accuracy": "draft"}, "scalars": {"computed_accuracy": stored}}
        (shown,) = parameters_shown(run, None)
        assert shown["value"] == told


def test_the_table_of_runs_shows_rounding_as_zero() -> None:
    """Beside others of its unit in all runs; not what was asked for, nor the audit."""
    numbers = {
        "peak_patch_pressure": [900.0, 1200.0],
        "peak_residual_tension": [2e-5, 31.0],
        "audit_residual": [1e-13, 2.0],
    }
    columns = {
        name: column_of(name, np.array(values), group_of(name)) for name, values in numbers.items()
    }
    columns["yield_stress"] = replace(
        columns["peak_residual_tension"], name="yield_stress", group="sweep"
    )
    floors = floors_of(RunTable(axes={}, columns=columns))
    shown = {name: cell_text(each, 0, floors) for name, each in columns.items()}
    assert shown == {
        "peak_patch_pressure": "900", "peak_residual_tension": "0", "audit_residual": "1e−13",
        "yield_stress": "2e−05",
    }  # fmt: skip
