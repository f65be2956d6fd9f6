"""Limits on the time and the memory of the execution of a study."""

from __future__ import annotations

from dataclasses import dataclass

from solver.memory import bytes_in
from studies.errors import StudyError

LOADED = 240_000_000
"""Bytes of a worker that has loaded all libraries; up to 70 MB less where the system maps less of
their files."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Bounds on the work of a study; None sets no bound.

    Attributes
    ----------
    stall_seconds : longest time of a loading path without progress on a worker [s]; after it its
        runs are stored as ``error`` and the worker is replaced
    path_seconds : longest total time of a loading path on a worker, or of each run of a search [s],
        with the same consequence
    memory : largest memory of each worker process started here, such as ``"2GB"``; by default its
        share of the machine's. A worker that needs more is killed and replaced
    patience : longest time to wait for a worker [s]; after it `GridLost` is raised

    Raises
    ------
    StudyError
        if a time is not above zero, or `memory` is not a size or less than `LOADED`
    """

    stall_seconds: float | None = 900.0
    path_seconds: float | None = None
    memory: str | None = None
    patience: float | None = None

    def __post_init__(self) -> None:
        for name in ("stall_seconds", "path_seconds", "patience"):
            value = getattr(self, name)
            if value is not None and not value > 0.0:
                raise StudyError(name, value, "must be greater than 0")
        if self.memory is None:
            return
        if not (size := bytes_in(self.memory)):
            raise StudyError("memory", self.memory, "must be a size such as 500MB or 2GB")
        if size < LOADED:
            allowed = f"must be at least {LOADED / 1e6:.0f}MB, which a worker needs for libraries"
            raise StudyError("memory", self.memory, f"{allowed}, and more for its runs")

    def check_without_workers(self) -> None:
        """Refuse limits that need workers, because there are none; the usual ones are let pass.

        Raises
        ------
        StudyError
            naming the limit
        """
        for name in ("stall_seconds", "path_seconds", "memory"):
            if (value := getattr(self, name)) not in (None, getattr(Limits(), name)):
                raise StudyError(name, value, "must be left out with 0 workers: it ends a worker")
