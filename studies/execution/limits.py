"""How long, and with how much memory, a study may be carried out."""

from __future__ import annotations

import re
from dataclasses import dataclass

from studies.errors import StudyError

_SIZE = re.compile(r"[1-9]\d*(\.\d+)? ?[kMGT]i?B")


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Bounds on the work of a study; None sets no bound.

    Attributes
    ----------
    stall_seconds : time a loading path may be on a worker without progress [s]; then its runs
        are stored as ``error`` and the worker is replaced
    path_seconds : time a loading path may be on a worker in all [s]; then the same
    memory : most memory of each worker process of our own, such as ``"2GB"``; by default its
        share of the machine's. A worker that needs more is killed and replaced
    patience : time to wait while no worker takes the work [s]; then `GridLost` is raised

    Raises
    ------
    StudyError
        when a time is not above zero, or `memory` is no size
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
        if self.memory is not None and not _SIZE.fullmatch(self.memory):
            raise StudyError("memory", self.memory, "must be a size such as 500MB or 2GB")
