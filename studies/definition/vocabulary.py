"""Words of a data set that every study has: the outcomes of runs."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from solver.results.record import Status

STATUSES = (*(status.name.lower() for status in Status), "error", "missing")
"""Outcomes: the solver's, then a run that broke, then one not computed."""

OK = Status.OK.name.lower()
OUTSIDE_THEORY = Status.OUTSIDE_THEORY.name.lower()
SOLVED = tuple(status.name.lower() for status in Status if status.solved)
"""Outcomes of runs that have their numbers, which another try would not change."""

LARGE_STRAIN = "large_strain"
"""What a study or a scene may allow: that runs outside small-strain theory are taken as ok."""

ERROR = "error"
MISSING = "missing"


def taken(status: str, allow: Collection[str]) -> str:
    """Return the outcome of a run as a study takes it that allows this."""
    return OK if status == OUTSIDE_THEORY and LARGE_STRAIN in allow else status


KEEP = "keep"
"""Attribute of a run's file, and entry of a study: what is kept beyond the scene's results."""
FIELDS = "fields"
"""Its value for the fields at the nodes of the bodies."""

SYMMETRIC = "symmetric"
"""Attribute of a file: 1 where the bodies are one half of what is symmetric about x = 0, else 0."""

LABEL_ATTRIBUTES: Mapping[str, Mapping[str, Any]] = {
    "status": {"long_name": "outcome of the run"},
    "message": {"long_name": "reason of the outcome"},
}
