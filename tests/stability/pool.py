"""Scenes in processes of their own, each of which is ended when a scene hangs in it."""

from __future__ import annotations

import multiprocessing
import time
from collections import deque
from collections.abc import Iterator, Sequence
from multiprocessing.connection import Connection, wait

import psutil

from tests.stability.families import scene
from tests.stability.trial import Trial, Verdict, attempt

START = 120.0
"""Seconds that a process has to begin with."""
_BUSY = 10.0
"""Largest ratio of the clock to CPU time: more than that no process waits for others."""


def trials(names: Sequence[str], jobs: int, patience: float) -> Iterator[Trial]:
    """Yield the ends of scenes as they come, computed by so many processes.

    A scene that uses up its CPU time is stopped where it can be (see `trial.deadline`). A process
    that does not answer after twice as much and half a minute, or ten times as long by the clock,
    is ended, and the scene counts as hanging; so does one that took its process with it.
    """
    waiting = deque(names)
    workers = [_Worker(patience) for _ in range(min(jobs, len(names)))]
    try:
        while waiting or any(worker.name for worker in workers):
            for number, worker in enumerate(workers):
                if worker.name:
                    if (lost := worker.lost()) is not None:
                        yield lost
                        workers[number] = _Worker(patience)
                elif waiting:
                    worker.take(waiting.popleft())
            busy = {w.pipe: w for w in workers if w.name}
            for ready in wait(list(busy), timeout=1.0):
                end = busy[ready].end()  # type: ignore[index]
                if end is not None:
                    yield end
    finally:
        for worker in workers:
            worker.stop()


class _Worker:
    """A process that computes one scene at a time."""

    def __init__(self, patience: float) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, other = context.Pipe()
        self.name, self._began, self._used, self._patience = "", 0.0, 0.0, patience
        self._room = START
        self._process = context.Process(target=_serve, args=(other, patience), daemon=True)
        self._process.start()
        other.close()

    def take(self, name: str) -> None:
        """Begin a scene."""
        self.name, self._began, self._used = name, time.monotonic(), self._cpu()
        self.pipe.send(name)

    def end(self) -> Trial | None:
        """Return the end of the scene; None where the process is gone."""
        try:
            trial = self.pipe.recv()
        except (EOFError, OSError):
            self._room = -1.0
            self._patience = 0.0
            return None
        self.name, self._room = "", 30.0
        assert isinstance(trial, Trial)
        return trial

    def lost(self) -> Trial | None:
        """Return the end of a scene that hangs, or that ended its process; None while it runs."""
        seconds, most = time.monotonic() - self._began, 2 * self._patience + self._room
        if self._process.is_alive() and seconds < _BUSY * most and self._cpu() - self._used < most:
            return None
        code = self._process.exitcode
        self.stop()
        text = f"no answer in {seconds:.0f} s" if code is None else f"its process ended with {code}"
        return Trial(
            name=self.name, what=scene(self.name).what, verdict=Verdict.HUNG, message=text,
            seconds=seconds,
        )  # fmt: skip

    def _cpu(self) -> float:
        """Return the CPU time of the process [s]; infinite for one that has ended."""
        try:
            times = psutil.Process(self._process.pid).cpu_times()
        except psutil.Error:
            return float("inf")
        return float(times.user + times.system)

    def stop(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.join()
        self.pipe.close()


def _serve(pipe: Connection, patience: float) -> None:
    """Answer names with trials until the other side is closed."""
    while True:
        try:
            name = pipe.recv()
        except EOFError:
            return
        pipe.send(attempt(name, scene(name), patience))
