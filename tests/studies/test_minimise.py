"""Minima: what they ask for, what they find, and all that a kind of study gives."""

from __future__ import annotations

import random
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from residua.cli import main
from solver.results.record import Record, Status
from studies import Store, Study, StudyError, estimate, open_study, run_study
from studies.kinds import found_of
from studies.kinds.kind import Found
from studies.kinds.minimise.search import Minimising
from tests.studies.fakes import Canned, FakeParameters, bare, record
from tests.studies.killed import runs_before_a_kill

OF, BOUND = "peak_contact_pressure", "peak_residual_tension"
ASKED = {
    "of": OF, "where": f"{BOUND} < 0.25 MPa", "most": 40,
    "ranges": {"load_ratio": [0.05, 1.2], "friction": [0.0, 0.9]},
}  # fmt: skip
LEAST = 0.18
"""The least `valley` where x y < 1/4: at x = y = 1/2, by symmetry."""


def valley(x: float, y: float) -> float:
    """Return a number that has no minimum of its own where x y < 1/4."""
    return (x - 0.8) ** 2 + (y - 0.8) ** 2 + 0.5 * (x - y) ** 2


def numbers(run: FakeParameters, values: Any, monitor: Any) -> Iterator[Record]:
    """Yield the number and the bound of each run; those in a corner fail."""
    for x in values:
        own, y = bare(record(replace(run, load_ratio=x))), run.friction
        monitor(1.0)
        if x > 1.0 and y > 0.5:
            yield replace(own, status=Status.LIMIT_LOAD, message="flows", scalars={})
        else:
            yield replace(own, scalars=dict(own.scalars) | {OF: valley(x, y), BOUND: x * y})


SCENE = Canned(
    name="valley", summary="a number under a bound", parameters=FakeParameters,
    branch="load_ratio", records=numbers,
)  # fmt: skip


def study(scene: Canned = SCENE, sweep: Any = None, **asked: Any) -> Study:
    content = {"name": "least", "minimise": ASKED | asked}
    return Study.from_dict(content | ({"sweep": sweep} if sweep else {}), scene)


def searched(seed: int, **asked: Any) -> Minimising:
    """Carry out a search whose runs end in random order."""
    ((_, program),) = study(**asked).kind.programs({}, lambda names: lambda row: {}.get, [])
    assert isinstance(program, Minimising)
    order = random.Random(seed)
    while wants := program.wants:
        key = order.choice(wants)
        x, y = (program.sets(key)[name] for name in ("load_ratio", "friction"))
        row: Mapping[str, Any] = {"status": "ok", "scalars": {OF: valley(x, y), BOUND: x * y}}
        program.tell(key, row if x < 1.0 else {"status": "limit_load", "scalars": {}})
    return program


def found_in(out: Path) -> tuple[Found, int]:
    with open_study(out) as dataset:
        found = found_of(dataset)
        assert found is not None
        return found, dataset.sizes["point"]


def test_it_asks_for_the_same_runs_in_whichever_order_they_end() -> None:
    first, second = (searched(seed, most=20) for seed in (0, 1))
    assert list(first.rows) == list(second.rows)
    assert len(first.rows) <= 20
    assert first.reason == second.reason == "most"


@pytest.mark.parametrize(("where", "least"), [(f"{BOUND} < 0.25", LEAST), ([], 0.0)])
def test_three_starts_find_the_least_number_under_a_condition(
    tmp_path: Path, where: Any, least: float
) -> None:
    asked = study(where=where)
    outcome = run_study(asked, Store(tmp_path), workers=0)
    assert len(outcome.computed) <= 40
    with open_study(outcome.dataset) as dataset:
        there = dataset[OF].where((dataset[BOUND] < 0.25) | (not where))
        assert there.min().item() == pytest.approx(least, rel=0.01, abs=1e-3)
    found, runs = found_in(tmp_path)
    assert runs == len(outcome.computed)
    assert found.marks[0]["friction"][0] == pytest.approx(0.8 if not where else 0.5, abs=0.05)
    assert not found.warning


def test_a_failed_run_is_stored_and_the_search_goes_on(tmp_path: Path) -> None:
    outcome = run_study(
        study(first={"load_ratio": 1.1, "friction": 0.6}, starts=1), Store(tmp_path), workers=0
    )
    assert {status for _, status, _ in outcome.failed} == {"limit_load"}
    found, _ = found_in(tmp_path)
    assert float(found.rows[0][-1]) == pytest.approx(LEAST, rel=0.01)


def test_a_condition_that_no_run_meets_is_reported(tmp_path: Path) -> None:
    run_study(study(where=f"{OF} < -1", most=9), Store(tmp_path), workers=0)
    found, _ = found_in(tmp_path)
    assert "no run" in found.warning
    assert not found.marks


def test_a_search_of_one_run_lists_it_without_a_mark(tmp_path: Path) -> None:
    run_study(study(where=[], starts=1, most=1), Store(tmp_path), workers=0)
    found, _ = found_in(tmp_path)
    assert len(found.rows) == 1
    assert not found.marks


@pytest.mark.processes
def test_a_search_that_is_stopped_before_its_first_run_has_a_data_set(tmp_path: Path) -> None:
    stopped = run_study(study(), Store(tmp_path), workers=1, should_stop=lambda: True)
    assert stopped.stopped
    assert set(stopped.counts) == {"missing"}


def test_each_place_of_an_axis_has_a_minimum(tmp_path: Path) -> None:
    own = study(sweep={"hardening": ["none", "isotropic"]}, starts=1)
    most = estimate(own, Store(tmp_path))
    assert most.runs == most.to_compute == most.paths == own.size == 2 * 40
    outcome = run_study(own, Store(tmp_path), workers=0)
    with open_study(outcome.dataset) as dataset:
        least = dataset[OF].where(dataset[BOUND] < 0.25).groupby("hardening").min()
        assert least.to_numpy() == pytest.approx([LEAST, LEAST], rel=0.01)


@pytest.mark.processes
def test_a_killed_search_is_taken_up_and_computes_no_run_twice(tmp_path: Path) -> None:
    slow = study(replace(SCENE, records=slowly), most=9)
    before = runs_before_a_kill(slow, tmp_path / "killed", 4)
    after = run_study(slow, Store(tmp_path / "killed"), workers=0).computed
    whole = run_study(slow, Store(tmp_path / "whole"), workers=0).computed
    assert not before & set(after)
    assert before | set(after) == set(whole)


def slowly(run: FakeParameters, values: Any, monitor: Any) -> Iterator[Record]:
    for each in numbers(run, values, monitor):
        time.sleep(0.05)
        yield each


def test_the_content_is_read_again_with_its_id() -> None:
    own = study()
    again = Study.from_dict(own.to_dict(), SCENE)
    assert (again.id, again.kind) == (own.id, own.kind)
    assert study(most=41).id != own.id
    assert "friction" not in own.fixed


@pytest.mark.parametrize(
    ("asked", "field", "allowed"),
    [
        ({"of": "peak"}, "minimise.of", "must be a variable"),
        ({"where": f"{BOUND} = 3"}, "minimise.where", "must be NAME < NUMBER"),
        ({"where": [f"{BOUND} < 3 mm"]}, "minimise.where[0]", "MPa"),
        ({"where": f"{BOUND} < much"}, "minimise.where", "finite number"),
        ({"starts": 0}, "minimise.starts", "at least 1"),
        ({"starts": 9, "most": 8}, "minimise.most", "at least 9"),
        ({"ranges": {"friction": [0.5, 0.1]}}, "minimise.ranges.friction", "lowest value"),
        ({"ranges": {}}, "minimise.ranges", "bounds of each parameter"),
        ({"first": {"friction": 2.0}}, "minimise.first.friction", "<="),
    ],
)
def test_a_mistake_is_reported(asked: dict[str, Any], field: str, allowed: str) -> None:
    with pytest.raises(StudyError) as refused:
        study(**asked)
    assert refused.value.field == field
    assert allowed in refused.value.allowed


def test_the_command_computes_estimates_and_draws(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "least.toml"
    file.write_text(
        f'name = "least"\nscene = "fake"\n[minimise]\nof = "{OF}"\nmost = 9\nstarts = 1\n'
        "[minimise.ranges]\nfriction = [0.1, 0.5]\n"
    )
    out = ["--out", str(tmp_path / "out")]
    assert main(["run", str(file), "--dry-run", *out]) == 0
    assert "at most 9" in capsys.readouterr().out
    assert main(["run", str(file), "--workers", "0", *out]) == 0
    told = capsys.readouterr()
    assert "of at most 9)" in told.err
    assert next(tmp_path.glob(f"out/studies/*/{OF}.png")).stat().st_size > 10_000
    assert main(["run", str(file), "--workers", "0", "--resume", *out]) == 0
    assert "0 computed" in capsys.readouterr().out
    assert np.isfinite(float(found_in(tmp_path / "out")[0].rows[0][-1]))
