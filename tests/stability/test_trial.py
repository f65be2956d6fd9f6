"""How the end of a scene is judged: by what came out, and by the time it took."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from solver import LimitLoad, ModelError, NotConverged
from tests.stability.table import describe, summary
from tests.stability.trial import Figure, Scene, Verdict, attempt, tells, tells_size


def raising(error: BaseException) -> Callable[[], Any]:
    def run() -> Any:
        raise error

    return run


def end(run: Callable[[], Any], patience: float = 5.0, **expected: Any) -> Verdict:
    return attempt("test-0", Scene(what="test", run=run, **expected), patience).verdict


def right(_: object) -> dict[str, Figure]:
    return {"figure": Figure(0.5, 1.0)}


LIMIT = LimitLoad("no equilibrium between 0.9 and 1", 0.9, 1.0)
LOST = NotConverged("failed between 0.9 and 1: too far", 0.9, 1.0)
BAD = ModelError("mesh", 3, "element 7 of body 'b' is folded")


@pytest.mark.parametrize(
    ("run", "expected", "verdict"),
    [
        (lambda: 1, {"judge": right}, Verdict.ANSWER),
        (lambda: 1, {"judge": lambda _: {"a": Figure(2.0, 1.0)}}, Verdict.WRONG),
        (lambda: 1, {"judge": lambda _: {"a": Figure(float("nan"), 1.0)}}, Verdict.WRONG),
        (lambda: 1, {}, Verdict.WRONG),
        (lambda: 1, {"judge": right, "load": 1.1, "certain": 1.0}, Verdict.WRONG),
        (raising(BAD), {"judge": right}, Verdict.FALSE_REFUSAL),
        (raising(BAD), {"refusal": tells("element 7", "'b'")}, Verdict.REFUSED),
        (raising(BAD), {"refusal": tells("element 8")}, Verdict.UNCLEAR),
        (raising(BAD), {"refusal": tells_size(7.05, "fold")}, Verdict.REFUSED),
        (raising(BAD), {"refusal": tells_size(7.5, "fold")}, Verdict.UNCLEAR),
        (raising(LIMIT), {"safe": 1.0}, Verdict.LIMIT),
        (raising(LIMIT), {"safe": 1.01}, Verdict.FALSE_LIMIT),
        (raising(LIMIT), {}, Verdict.FALSE_LIMIT),
        (raising(LimitLoad("none", 0.9, 1.0)), {"safe": 1.0}, Verdict.UNCLEAR),
        (raising(LOST), {}, Verdict.NOT_CONVERGED),
        (raising(LOST), {"honest": tells("too far")}, Verdict.HONEST),
        (raising(LOST), {"honest": tells("too near")}, Verdict.NOT_CONVERGED),
        (raising(ZeroDivisionError()), {"refusal": tells("")}, Verdict.CRASHED),
    ],
)
def test_a_scene_is_judged_by_what_came_out(
    run: Callable[[], Any], expected: dict[str, Any], verdict: Verdict
) -> None:
    assert end(run, **expected) is verdict


def test_a_scene_that_hangs_is_stopped_even_where_errors_are_kept() -> None:
    def run() -> None:
        while True:
            try:
                sum(range(1000))
            except Exception:
                continue

    assert end(run, 0.05, judge=right) is Verdict.HUNG


@pytest.mark.parametrize("kind", [SystemError, NotConverged])
def test_a_scene_hangs_whose_end_became_another_error(kind: type[Exception]) -> None:
    """Compiled code returns all the same; Python then raises an error, and the solver its own."""

    def run() -> None:
        try:
            while True:
                sum(range(1000))
        except BaseException as hung:
            error = SystemError("returned a result with an exception set")
            error.__cause__ = hung
            raise kind("no state was found") from error

    assert end(run, 0.05, judge=right) is Verdict.HUNG


def test_the_table_counts_every_verdict_and_names_the_scene() -> None:
    trials = [
        attempt("good-0", Scene(what="fine", run=lambda: 1, judge=right)),
        attempt("bad-0", Scene(what="folded mesh", run=lambda: 1)),
    ]
    text = "\n".join(summary(trials))
    assert "2 scenes: 1 right answers" in text
    assert "1 wrong answers, 0 false limits, 0 hung" in text
    assert describe(trials[1]).startswith("bad-0: wrong answers")
    assert "folded mesh" in describe(trials[1])
