"""``python -m tests.stability``: what it runs, what it prints, and how it ends."""

from __future__ import annotations

import pytest

from tests.stability import command, pool
from tests.stability.families import EVERY, NAMES
from tests.stability.trial import Trial, Verdict


def ended(*verdicts: Verdict) -> list[Trial]:
    return [
        Trial(name=f"test-{k}", what="", verdict=verdict, message="", seconds=1.0)
        for k, verdict in enumerate(verdicts)
    ]


def test_names_are_scenes_or_whole_families() -> None:
    assert command.chosen([], NAMES) == NAMES
    assert command.chosen(["same", "endless-37"], EVERY) == ["same-0", "same-1", "endless-37"]
    with pytest.raises(KeyError):
        command.chosen(["endless-100000"], EVERY)


@pytest.mark.parametrize(
    ("verdicts", "status"),
    [
        ([Verdict.ANSWER] * 1000, 0),
        ([Verdict.LIMIT, Verdict.REFUSED, Verdict.HONEST], 0),
        ([Verdict.ANSWER] * 999 + [Verdict.WRONG], 1),
        ([Verdict.ANSWER] * 999 + [Verdict.FALSE_LIMIT], 1),
        ([Verdict.ANSWER] * 999 + [Verdict.CRASHED], 1),
        ([Verdict.ANSWER] * 999 + [Verdict.HUNG], 1),
        ([Verdict.ANSWER] * 997 + [Verdict.NOT_CONVERGED] * 3, 0),
        ([Verdict.ANSWER] * 996 + [Verdict.NOT_CONVERGED] * 2 + [Verdict.UNCLEAR] * 2, 1),
    ],
)
def test_wrong_hanging_and_many_unexplained_scenes_are_bad(
    verdicts: list[Verdict], status: int
) -> None:
    assert command.verdict(ended(*verdicts)) == status


def test_every_verdict_is_counted_once() -> None:
    counted = [v for verdicts in command.COUNTED.values() for v in verdicts]
    assert sorted(counted, key=str) == sorted(Verdict, key=str)


@pytest.mark.processes
def test_scenes_run_in_processes_and_are_told_by_name(capsys: pytest.CaptureFixture[str]) -> None:
    assert command.report(["same-0", "wild-0"], 1) == 0
    text = capsys.readouterr().out
    assert "wild-0: right answers" in text
    assert text.rstrip().rpartition("\n")[2].startswith("good")
    assert command.report(["endless-1"], 1, patience=0.01) == 1
    text = capsys.readouterr().out
    assert "endless-1: hung: still running after 0.01 s of CPU" in text
    assert text.rstrip().rpartition("\n")[2].startswith("bad")


@pytest.mark.processes
def test_a_process_that_does_not_answer_or_is_gone_is_ended() -> None:
    late = pool._Worker(patience=-pool.START)
    late.take("endless-1")
    trial = late.lost()
    assert trial is not None
    assert trial.verdict is Verdict.HUNG
    assert "no answer" in trial.message
    gone = pool._Worker(patience=1e6)
    gone.take("endless-1")
    gone._process.kill()
    gone._process.join()
    trial = gone.lost()
    assert trial is not None
    assert trial.verdict is Verdict.HUNG
    assert "ended with -9" in trial.message
