"""Words of a data set that every study has: the outcomes of runs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from solver.results.record import Status

STATUSES = (*(status.name.lower() for status in Status), "error", "missing")
"""Outcomes: the solver's, then a run that broke, then one not computed."""

OK = Status.OK.name.lower()
ERROR = "error"
MISSING = "missing"

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
