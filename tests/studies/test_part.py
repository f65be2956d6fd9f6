"""Processes that compute one study in a directory that they share, without talking."""

from __future__ import annotations

import fcntl
import json
import os
import signal
import time
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from residua.cli import main
from studies import Store, StoreBusy, Study, StudyError, open_study, run_study
from studies.definition.identity import solver_hash
from studies.execution.asking import Asking
from studies.execution.part import run_part
from studies.execution.task import PathTask, walk
from studies.storage.claims import Claim, Claims
from tests.studies.conftest import write_study
from tests.studies.killed import FORK

SWEEP = {"friction": [k / 50 for k in range(12)], "load_ratio": [0.25, 0.5]}
GOAL = {"of": "peak_contact_pressure", "at": 120.0, "between": [0.1, 4.0], "within": 0.1}
ASKS = {
    "goal": GOAL,
    "refine": {"of": ["max_plastic_strain"], "until": 0.01, "halvings": 2},
}
SWEPT = {
    "goal": {"friction": SWEEP["friction"][:6]},
    "refine": {"friction": [0.0, 0.2, 0.4], "load_ratio": [0.25, 0.5]},
}
SIZES = {"": 24, "goal": 6, "refine": 15}


def study(folder: Path, seconds: float = 0.0, **content: Any) -> Study:
    """Return a study whose paths write a file each time they begin."""
    (folder / "begun").mkdir(exist_ok=True)
    fixed = {"seconds": seconds, "mark": str(folder / "begun")}
    whole = {"name": "shared", "scene": "fake", "parameters": fixed, "sweep": SWEEP}
    return Study.from_dict(whole | content)


def begun(folder: Path) -> Counter[str]:
    """Return how often a value was begun on the path of a friction."""
    return Counter(
        f"{path.name.split('-')[0]}: {value}"
        for path in (folder / "begun").iterdir()
        for value in path.read_text().split()
    )


def started(of: Study, out: Path, count: int) -> list[Any]:
    solver_hash()  # it is kept, and so need not be made in each process
    parts = [(of, out, (number, count)) for number in range(1, count + 1)]
    every = [FORK.Process(target=run_part, args=each) for each in parts]
    for process in every:
        process.start()
    return every


def runs(out: Path) -> set[str]:
    return {path.stem for path in (out / "runs").glob("*.nc")}


@pytest.mark.processes
@pytest.mark.parametrize(("asks", "count"), [("", 6), ("goal", 4), ("refine", 4)], ids=str)
def test_parts_compute_each_run_once_although_two_are_killed(
    tmp_path: Path, asks: str, count: int
) -> None:
    of, out = study(tmp_path, 0.1), tmp_path / "out"
    if asks:
        of = study(tmp_path, 0.05, **{asks: ASKS[asks]}, sweep=SWEPT[asks])
    parts = started(of, out, count)

    while len(runs(out)) < 4:
        time.sleep(0.02)
    # both are stopped before one is killed: else the second might take over the path of the first
    # and die with it too, and a path with two deaths is blamed
    try:
        for each in parts[:2]:
            os.kill(each.pid, signal.SIGSTOP)
            os.waitid(os.P_PID, each.pid, os.WSTOPPED | os.WEXITED | os.WNOWAIT)
    finally:
        for each in parts[:2]:
            each.kill()
            each.join()
    for each in parts[2:]:
        each.join(60)
        assert each.exitcode == 0
    if not asks:
        assert {*of.run_ids()} == runs(out), "none is lost"
    done = len(begun(tmp_path))
    outcome = run_study(of, Store(out), resume=True)
    assert outcome.ok
    assert outcome.computed == []
    assert len(begun(tmp_path)) == done
    again = [value for value, times in begun(tmp_path).items() if times > 1]
    assert len(again) <= 2 * 4, "only what the two had begun is begun again"
    assert not (out / "claims").exists()
    assert not list(out.rglob("*.part"))
    with open_study(out) as dataset:
        assert dataset.status.size == SIZES[asks]


def test_one_part_computes_all_and_the_next_one_nothing(tmp_path: Path) -> None:
    of, out = study(tmp_path), tmp_path / "out"
    first = run_part(of, out, (2, 3))
    assert (len(first.computed), first.left, first.stopped) == (24, 0, False)
    assert run_part(of, out, (1, 3)).computed == []
    assert not (out / "catalogue.sqlite").exists(), "it is no file that machines may share"


def test_a_goal_is_searched_by_a_part(tmp_path: Path) -> None:
    of = study(tmp_path, scene="numbers", goal=GOAL, sweep={"friction": [0.0, 0.4]})
    events: list[Any] = []
    found = run_part(of, tmp_path / "out", (1, 1), on_event=events.append)
    assert {*found.computed} == runs(tmp_path / "out")
    assert max(begun(tmp_path).values()) == 1
    assert any("round 2 of at most" in each.place for each in events)
    assert run_part(of, tmp_path / "out", (1, 1)).computed == []


@pytest.mark.processes
@pytest.mark.parametrize("scene", ["numbers", "followed"])
def test_a_part_that_begins_later_leaves_a_search_to_who_is_at_it(
    tmp_path: Path, scene: str
) -> None:
    of, out = (
        study(tmp_path, 0.3, scene=scene, goal=GOAL, sweep={"friction": [0.0]}),
        tmp_path / "out",
    )
    (first,) = started(of, out, 1)
    while len(runs(out)) < 2:
        time.sleep(0.02)
    run_part(of, out, (2, 2))
    first.join(60)
    assert max(begun(tmp_path).values()) == 1
    assert run_study(of, Store(out), resume=True).computed == []


def test_a_path_that_ended_at_its_goal_is_complete_without_its_last_runs(tmp_path: Path) -> None:
    of = study(tmp_path, scene="numbers", goal=GOAL, sweep={"friction": [0.0]})
    store = Store(tmp_path / "out")
    asking = Asking(of, store, resume=True)
    asked = next(asking.paths())
    assert asked is not None
    task = PathTask(of.problem, (asked.path,), store.directory, solver_hash(), limit=asked.limit)
    walk(task, lambda row: None, lambda: False)
    there = runs(store.directory)
    assert 1 < len(there) < len(asked.path.cases)
    assert asking.complete(asked, there)
    assert not asking.complete(asked, {asked.path.cases[0].id})


def test_parts_of_another_goal_are_not_blamed_for_those_that_have_ended(tmp_path: Path) -> None:
    of = study(tmp_path, scene="numbers", goal=GOAL, sweep={"friction": [0.0]})
    for number in (1, 2, 3):
        run_part(of, tmp_path / "out", (number, 3))
    other = study(tmp_path, scene="numbers", goal=GOAL | {"at": 200.0}, sweep={"friction": [0.0]})
    run_part(other, tmp_path / "out", (1, 1))
    assert run_study(other, Store(tmp_path / "out"), resume=True).counts == {"ok": 1}


def test_a_part_that_is_stopped_releases_what_it_has(tmp_path: Path) -> None:
    of, out = study(tmp_path), tmp_path / "out"
    stopped = run_part(of, out, (1, 2), should_stop=lambda: len(runs(out)) >= 5)
    assert stopped.stopped
    assert stopped.left > 0
    done = {path.id for path in of.paths() if runs(out) >= {case.id for case in path.cases}}
    assert {claim.stem for claim in (out / "claims").iterdir()} == done
    assert run_part(of, out, (2, 2)).left == 0
    assert max(begun(tmp_path).values()) <= 2


def test_a_path_that_kills_two_is_blamed(tmp_path: Path) -> None:
    of = study(tmp_path, sweep={"friction": [0.0, 0.1], "load_ratio": [0.25]})
    first, second = (path for path in of.paths())
    claims = tmp_path / "out" / "claims"
    claims.mkdir(parents=True)
    machine = Path("/proc/sys/kernel/random/boot_id").read_text().strip()
    for deaths in range(2):
        (claims / f"{first.id}.{deaths}").write_text(json.dumps({"machine": machine}))
    (claims / f"{second.id}.0").write_text(json.dumps({"machine": machine}))
    assert run_part(of, tmp_path / "out", (1, 1)).computed == [second.cases[0].id]
    row = Store(tmp_path / "out").found(first.cases[0].id)
    assert row is not None
    assert row["status"] == "error"
    assert "the processes that computed this loading path died" in row["message"]


@pytest.mark.parametrize("ahead", [100.0, 400.0, 1e7])
def test_a_claim_of_another_machine_is_dead_if_its_time_is_far_in_the_future(
    tmp_path: Path, ahead: float
) -> None:
    """An owner that lives sets it to the time of the file system again and again."""
    claims = Claims(tmp_path)
    left = tmp_path / "a.0"
    left.write_text(json.dumps({"machine": "elsewhere"}))
    os.utime(left, (time.time() + ahead,) * 2)
    with claims.held("a") as claim:
        assert claim == (Claim(1) if ahead > 300.0 else None)


def test_a_claim_has_one_owner_until_it_ends_or_dies(tmp_path: Path) -> None:
    mine, other = Claims(tmp_path / "claims"), Claims(tmp_path / "claims")
    with mine.held("a") as claim:
        assert claim == Claim(0)
        with other.held("a") as second:
            assert second is None
        with other.held("b") as second:
            assert second == Claim(0)
    with other.held("a") as claim:
        assert claim == Claim(0)
    left = tmp_path / "claims" / "c.0"
    left.write_text(json.dumps({"machine": "elsewhere"}))
    with mine.held("c") as claim:
        assert claim is None, "its owner was there a moment ago"
    os.utime(left, (time.time() - 400.0,) * 2)
    with left.open() as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        with mine.held("c") as claim:
            assert claim == Claim(1), "the lock of another machine tells nothing"
            with other.held("c") as second:
                assert second is None
    with other.held("d"), pytest.raises(KeyboardInterrupt), mine.held("e"):
        raise KeyboardInterrupt
    assert [*(tmp_path / "claims").iterdir()] == []
    with mine.held("f") as claim:
        assert claim is not None
        claim.done = True
    assert [path.name for path in (tmp_path / "claims").iterdir()] == ["f.0"]
    for _ in range(3):
        with other.held("f") as claim:
            assert claim == Claim(0), "who has done all has not died"
            claim.done = True


def test_parts_and_a_writer_exclude_each_other(tmp_path: Path) -> None:
    of, store = study(tmp_path), Store(tmp_path / "out")
    with store.writing(), pytest.raises(StoreBusy):
        run_part(of, store.directory, (1, 2))
    other = Store(tmp_path / "out")
    with store.sharing(), other.sharing(), pytest.raises(StoreBusy), other.writing():
        pass
    with pytest.raises(StudyError, match="part = '3/2'"):
        run_part(of, store.directory, (3, 2))


def test_the_command_computes_a_part(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = str(write_study(tmp_path)), str(tmp_path / "out")
    assert main(["run", path, "--out", out, "--part", "1/2"]) == 0
    assert capsys.readouterr().out == "fake: part 1 of 2: 4 runs computed\n"
    for wrong in ("0/2", "3/2", "1", "a/b"):
        with pytest.raises(SystemExit):
            main(["run", path, "--part", wrong])
    assert main(["run", path, "--out", out, "--part", "1/2", "--workers", "2"]) == 2
