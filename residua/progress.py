"""The estimated cost of a study, and its progress, on the terminal or in a log."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from typing import Self, TextIO

from solver.errors import ModelError
from studies.definition.cases import Case
from studies.definition.points import is_points
from studies.definition.study import Study
from studies.definition.vocabulary import OK, SOLVED
from studies.execution.estimate import estimate
from studies.execution.run import StudyEvent
from studies.storage.store import Store
from studies.toml import CASE
from studies.views.columns import counted, value_text
from studies.views.scene_tables import doubts_of
from studies.views.summary import bar

_REDRAW = 0.1
"""Seconds between two drawings of the bar."""
_KNOWN = 0.05
"""Share of the work up to which its pace is that of the start of workers, and not told."""
_QUIET = 10.0
"""Seconds after which a log gets a line although no run has ended."""


class Progress:
    """A bar on one line of a terminal; otherwise a plain line for each run, or each 10 s."""

    def __init__(self, study: Study, stream: TextIO | None = None) -> None:
        self._stream = stream or sys.stderr
        self._bar = self._stream.isatty()
        cases = () if self._bar else study.cases()  # a bar names no runs
        self._size, self._asks = study.size, study.kind.chooses
        self._names = {case.id: _place(study, case) for case in cases}
        self._started = time.monotonic()
        self._begun: float | None = None
        self._progress = 0.0
        self._drawn = 0.0
        self._written = self._started
        self._seen = 0
        self._reused = 0
        self._failed = 0
        self._waits: set[str] = set()

    def __call__(self, event: StudyEvent) -> None:
        """Process an event."""
        if self._begun is None:
            self._begun = event.progress
            first = event.kind == "path" and event.fraction == 0.0  # nothing is done yet
            if first and not self._asks:
                self._reused = round(event.progress * self._size)
            if self._reused and not self._bar:
                text = f"{self._reused} of {self._size} runs exist already"
                print(text, file=self._stream, flush=True)
        if event.kind == "waiting" and event.message and event.message not in self._waits:
            self._waits.add(event.message)
            left = "\n" if self._bar and self._drawn else ""
            print(f"{left}waiting: {event.message}", file=self._stream, flush=True)
        now = time.monotonic()
        if event.kind == "run":
            self._seen += 1
            self._failed += event.status != OK
            if not self._bar:
                reason = f": {event.message}" if event.status != OK else ""
                place = event.place or self._names[event.run]
                line = f"{100 * event.progress:3.0f} %  {event.status}  {place}{reason}"
                self._write(line, event, now)
        elif event.kind == "path" and not self._bar and now - self._written > _QUIET:
            self._write(f"{100 * event.progress:3.0f} %  computing", event, now)
        self._progress = event.progress
        if self._bar and now - self._drawn > _REDRAW:
            self._drawn = now
            self._draw()

    def _write(self, line: str, event: StudyEvent, now: float) -> None:
        """Write a line of a log, with the remaining time."""
        self._written = now
        print(f"{line}{self._remaining(event.progress)}", file=self._stream, flush=True)

    def close(self) -> None:
        """Draw the bar a last time and leave its line."""
        if self._bar and self._begun is not None:
            self._draw()
            print(file=self._stream)

    def _draw(self) -> None:
        progress = self._progress
        failed = f", {self._failed} failed" if self._failed else ""
        reused = f" ({self._reused} were there)" if self._reused else ""
        most = "at most " if self._asks else ""
        runs = f"{self._reused + self._seen} of {most}{self._size} runs{reused}{failed}"
        left = "  combining the data set" if progress >= 1.0 else self._remaining(progress)
        text = f"{bar(progress)}  {runs}{left}"
        print(f"\r{text}\x1b[K", end="", file=self._stream, flush=True)

    def _remaining(self, progress: float) -> str:
        """Return the remaining time, at the pace so far."""
        gained = progress - (self._begun or 0.0)
        if gained <= _KNOWN or progress >= 1.0:
            return ""
        seconds = (time.monotonic() - self._started) * (1.0 - progress) / gained
        minutes, rest = divmod(int(seconds), 60)
        hours, minutes = divmod(minutes, 60)
        clock = f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"
        return f"  {clock} left"


def _place(study: Study, case: Case) -> str:
    """Return the values of a run on the axes, and of a point its name and what it sets."""
    parts = []
    for (name, value), index in zip(study.place(case).items(), case.index, strict=True):
        axis = study.sweep[name]
        text = f"{name} = {counted(value)}"
        if is_points(axis):
            sets = axis[index].items()
            own = (each if key == CASE else f"{key} = {value_text(each)}" for key, each in sets)
            text += ": " + ", ".join(own)
        parts.append(text)
    return ", ".join(parts) or study.name


_SHORT = 8.0
"""Likely seconds of processor time up to which `residua run` starts no workers: to start them takes
more than a second, and two would save no more than half of the time."""

ALONE = 60.0
"""Seconds of processor time after which a study that seemed to be short gets workers after all."""


def dry_run(study: Study, store: Store) -> str:
    """Return the estimated cost of computing `study` into `store`."""
    found = estimate(study, store)
    table = (f"{name:<16}{text}" for name, text in found.costs(study.kind.chooses).items())
    first = {**next(study.cases()).values, **study.kind.begins}
    try:
        doubts = doubts_of(study.problem, first)
    except ModelError as error:  # other runs may be possible
        doubts = (f"the first run cannot be computed: {error}",)
    warnings = (f"warning: {each}" for each in doubts)
    return "\n".join([f"{study.name}: nothing is computed or written", *warnings, *table])


@dataclass(frozen=True, slots=True)
class Foreseen:
    """What `residua run` says and does because of the time that a study is likely to take.

    Attributes
    ----------
    text : one line: how many runs it will compute, and the time; empty if there are none
    short : whether it takes less than workers need to start
    """

    text: str = ""
    short: bool = False

    @classmethod
    def of(cls, study: Study, store: Store) -> Self:
        """Return it for the runs of a study that the store lacks."""
        try:
            found = estimate(study, store)
            asked = store.asked(study) if study.kind.chooses else None
            if asked is not None and asked <= store.catalogue.having(SOLVED, asked, study.keep):
                return cls(short=True)  # its search has ended
        except Exception:  # a damaged catalogue must not prevent computing, which makes it again
            return cls()
        short = found.cpu_seconds is not None and found.cpu_seconds[1] <= _SHORT
        if not found.to_compute:
            return cls(short=short)
        runs = f"about {found.usual_runs}" if study.kind.chooses else f"{found.to_compute}"
        text = f"{study.name}: {runs} {'run' if runs == '1' else 'runs'} to compute"
        return cls(f"{text}, {found.time} of processor time" if found.time else text, short)
