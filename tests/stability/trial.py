"""One extreme scene, walked as the studies walk it, and what came out."""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import pytest

from solver import SCENES, Branch, Path, Record, Status, System
from solver.scenes import punch
from solver.scenes.punch import PunchParameters
from tests.stability.oracle import judge

PATIENCE = 60.0
"""Seconds of wall time after which a scene counts as hanging; the slowest take a few."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """Outcome of a scene: its record, the loads a failed one stopped between, own figures."""

    number: int
    parameters: PunchParameters
    record: Record
    seconds: float
    reached: float
    attempted: float
    figures: dict[str, float] = field(default_factory=dict)

    @property
    def status(self) -> Status:
        """As recorded."""
        return self.record.status

    @property
    def hardens(self) -> bool:
        """Whether a higher load always finds an equilibrium."""
        return self.parameters.hardening != "none" and self.parameters.hardening_ratio > 0


@contextmanager
def deadline(seconds: float) -> Iterator[None]:
    """Raise `TimeoutError` in the block when it takes longer."""

    def stop(*_: object) -> None:
        raise TimeoutError(f"still running after {seconds:g} s")

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def attempt(number: int, parameters: PunchParameters) -> Trial:
    """Run a scene under a deadline and judge where it ended."""
    seen: list[tuple[System, Branch]] = []

    class Watched(Path):
        def branches(self, loads: Sequence[float]) -> Iterator[Branch]:
            for branch in super().branches(loads):
                seen.append((self.system, branch))
                yield branch

    started = time.perf_counter()
    with pytest.MonkeyPatch.context() as patch, deadline(PATIENCE):
        patch.setattr(punch, "Path", Watched)
        (record,) = SCENES["punch"].path(
            parameters, [parameters.load_ratio], lambda share, message: None
        )
    seconds = time.perf_counter() - started
    ((system, branch),) = seen
    figures = {} if branch.error else judge(parameters, system, branch)
    return Trial(
        number=number,
        parameters=parameters,
        record=record,
        seconds=seconds,
        reached=branch.error.reached if branch.error else parameters.load_ratio,
        attempted=branch.error.attempted if branch.error else parameters.load_ratio,
        figures=figures,
    )
