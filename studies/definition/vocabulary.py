"""Words that every study shares: statuses of runs, and names of attributes."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from solver.results.record import Status

STATUSES = (*(status.name.lower() for status in Status), "error", "missing")
"""Statuses: the solver's, then that of a run with an error, then that of a run not computed."""

OK = Status.OK.name.lower()
OUTSIDE_THEORY = Status.OUTSIDE_THEORY.name.lower()
SOLVED = tuple(status.name.lower() for status in Status if status.solved)
"""Statuses of runs that have results, which another computation would not change."""

LARGE_STRAIN = "large_strain"
"""Entry of ``allow`` in a study or a scene: runs outside small-strain theory count as ok."""

NO_EQUILIBRIUM = ("limit_load", "not_converged")
"""Statuses of runs without equilibrium, which another computation would not find."""

ERROR = "error"
MISSING = "missing"


def taken(status: str, allow: Collection[str]) -> str:
    """Return the status of a run in a study with these entries of ``allow``."""
    return OK if status == OUTSIDE_THEORY and LARGE_STRAIN in allow else status


KEEP = "keep"
"""Attribute of a run's file, and entry of a study: what is kept in addition to the results."""
FIELDS = "fields"
"""Value of ``keep`` for the fields at the nodes of the bodies."""

SYMMETRIC = "symmetric"
"""Attribute of a file: 1 if only the half x >= 0 of symmetric bodies was computed, else 0."""

LABEL_ATTRIBUTES: Mapping[str, Mapping[str, Any]] = {
    "status": {"long_name": "outcome of the run"},
    "message": {"long_name": "reason of the outcome"},
}

STOPPED = "stopped before its end"
"""Message of a search that has not ended, and of a refinement."""
