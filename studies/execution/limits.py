"""How long, and with how much memory, a study may be carried out."""

from __future__ import annotations

from dataclasses import dataclass


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
    """

    stall_seconds: float | None = 900.0
    path_seconds: float | None = None
    memory: str | None = None
    patience: float | None = None
