"""One scene of the stability set: what it must come to, and what it came to."""

from __future__ import annotations

import re
import signal
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, is_dataclass
from enum import Enum
from functools import partial
from typing import Any, NamedTuple

from solver import LimitLoad, ModelError, NotConverged

PATIENCE = 60.0
"""Seconds of CPU after which a scene counts as hanging; the slowest that fail take 25."""
_NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e[-+]?\d+)?")


class Figure(NamedTuple):
    """A measure of what is wrong with an answer, 0 for a perfect one, and its limit."""

    value: float
    limit: float

    @property
    def right(self) -> bool:
        """Whether the limit is kept; NaN keeps none."""
        return bool(self.value <= self.limit)


Figures = Mapping[str, Figure]


class Verdict(Enum):
    """What a scene came to."""

    ANSWER = "right answers"
    REFUSED = "clear refusals"
    LIMIT = "right limits"
    HONEST = "not converged, as declared"
    NOT_CONVERGED = "not converged"
    WRONG = "wrong answers"
    FALSE_LIMIT = "false limits"
    FALSE_REFUSAL = "refused without reason"
    UNCLEAR = "unclear messages"
    CRASHED = "crashed"
    HUNG = "hung"


RIGHT = (Verdict.ANSWER, Verdict.REFUSED, Verdict.LIMIT, Verdict.HONEST)


class Hung(BaseException):
    """A scene used up its time. Not an `Exception`, so that no handler in the solver keeps it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """A problem and the ways it may end.

    Attributes
    ----------
    what : how it differs from the others of its family
    run : solves it; raises `ModelError`, `LimitLoad` or `NotConverged`
    judge : figures of an answer; None where no answer is right
    refusal : says whether the text of a `ModelError` is clear; None where the input is good
    certain : load factor from which an equilibrium is certain not to exist
    safe : load factor up to which one is certain to exist
    honest : says whether a `NotConverged` is as declared; None where none is right
    in_loads : whether a path that stops must tell the load factors it stopped between
    """

    what: str
    run: Callable[[], Any]
    judge: Callable[[Any], Figures] | None = None
    refusal: Callable[[str], bool] | None = None
    certain: float = float("inf")
    safe: float = float("inf")
    load: float = 1.0
    honest: Callable[[str], bool] | None = None
    in_loads: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """The end of a scene."""

    name: str
    what: str
    verdict: Verdict
    message: str
    seconds: float
    figures: Figures = field(default_factory=dict)

    @property
    def right(self) -> bool:
        """Whether it ended as it must."""
        return self.verdict in RIGHT


@contextmanager
def deadline(seconds: float) -> Iterator[None]:
    """Raise `Hung` in the block when it takes more CPU time."""

    def stop(*_: object) -> None:
        raise Hung(f"still running after {seconds:g} s of CPU")

    before = signal.signal(signal.SIGPROF, stop)
    # again and again: what is raised in a destructor is lost
    signal.setitimer(signal.ITIMER_PROF, seconds, max(seconds, 1.0))
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def attempt(name: str, scene: Scene, patience: float = PATIENCE) -> Trial:
    """Run a scene under a deadline and judge where it ended."""
    started = time.process_time()
    answer: Any = None
    figures: Figures = {}
    try:
        with deadline(patience):
            answer = scene.run()
            figures = scene.judge(answer) if scene.judge is not None else {}
        verdict, message = _answered(scene, figures)
    except Hung as late:
        verdict, message = Verdict.HUNG, str(late)
    except ModelError as error:
        verdict, message = _refused(scene, str(error)), f"ModelError: {error}"
    except Exception as error:  # whatever is not declared is the fault looked for
        message = f"{type(error).__name__}: {error}"
        if _of_hung(error):
            verdict = Verdict.HUNG
        elif isinstance(error, NotConverged):
            verdict = _stopped(scene, error)
        else:
            verdict = Verdict.CRASHED
    return Trial(
        name=name,
        what=scene.what,
        verdict=verdict,
        message=message,
        seconds=time.process_time() - started,
        figures=figures,
    )


def _of_hung(error: BaseException | None) -> bool:
    """Whether an error comes of `Hung`: compiled code returns all the same, and Python objects."""
    return error is not None and (isinstance(error, Hung) or _of_hung(error.__cause__))


def _answered(scene: Scene, figures: Figures) -> tuple[Verdict, str]:
    if scene.judge is None:
        return Verdict.WRONG, "an answer to what has none"
    if scene.load > scene.certain:
        return Verdict.WRONG, f"an answer at {scene.load:g}, none exists above {scene.certain:g}"
    wrong = [f"{n} {f.value:.2e} > {f.limit:.0e}" for n, f in figures.items() if not f.right]
    return (Verdict.WRONG if wrong else Verdict.ANSWER), ", ".join(wrong)


def _refused(scene: Scene, text: str) -> Verdict:
    if scene.refusal is None:
        return Verdict.FALSE_REFUSAL
    return Verdict.REFUSED if scene.refusal(text) else Verdict.UNCLEAR


def _stopped(scene: Scene, error: NotConverged) -> Verdict:
    if scene.in_loads and not _tells_loads(error):
        return Verdict.UNCLEAR
    if isinstance(error, LimitLoad):
        # where an equilibrium is certain to exist, "no equilibrium" is a wrong answer
        return Verdict.LIMIT if error.attempted >= scene.safe * (1 - 1e-9) else Verdict.FALSE_LIMIT
    honest = scene.honest is not None and scene.honest(str(error))
    return Verdict.HONEST if honest else Verdict.NOT_CONVERGED


def _tells_loads(error: NotConverged) -> bool:
    """Whether the loads between which a path stopped are told, to the digits printed."""
    told = numbers(str(error))
    return error.reached != error.attempted and all(
        any(abs(load - n) <= 1e-5 * load for n in told) for load in (error.reached, error.attempted)
    )


def numbers(text: str) -> set[float]:
    """Return the numbers in a text."""
    return {float(n) for n in _NUMBER.findall(text)}


def tells(*patterns: str) -> Callable[[str], bool]:
    """Return the test whether a text holds all of these patterns, in any case."""
    compiled = [re.compile(p, re.IGNORECASE) for p in patterns]
    return lambda text: all(p.search(text) for p in compiled)


def tells_size(size: float, *patterns: str) -> Callable[[str], bool]:
    """Return the test whether a text also tells a size, to one part in a hundred."""
    words = tells(*patterns)
    return partial(_with_size, words, size)


def _with_size(words: Callable[[str], bool], size: float, text: str) -> bool:
    return words(text) and any(abs(n - size) <= 0.01 * size for n in numbers(text))


def brief(given: Any) -> str:
    """Return what differs from the defaults of a dataclass, those in it included."""
    if isinstance(given, tuple):
        return "(" + ", ".join(brief(g) for g in given) + ")"
    if not is_dataclass(given):
        return repr(given)
    changed = [
        f"{f.name}={brief(getattr(given, f.name))}"
        for f in fields(given)
        if getattr(given, f.name) != f.default
    ]
    return f"{type(given).__name__}({', '.join(changed)})"
