"""Words of a data set that every study has: outcomes of runs, labels, flags."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from solver.results.record import Status
from solver.results.shakedown import State as Shakedown

STATUSES = (*(status.name.lower() for status in Status), "error", "missing")
"""Outcomes by flag value: the solver's, then a run that broke, then one not computed."""

OK = STATUSES[Status.OK.code]
ERROR = "error"
MISSING = "missing"

LABEL_ATTRIBUTES: Mapping[str, Mapping[str, Any]] = {
    "status": {
        "long_name": "outcome of the run",
        "standard_name": "status_flag",
        "flag_values": np.arange(len(STATUSES), dtype=np.int8),
        "flag_meanings": " ".join(STATUSES),
    },
    "message": {"long_name": "reason of the outcome"},
    "shakedown_state": {
        "flag_values": np.array(list(Shakedown), dtype=np.int32),
        "flag_meanings": " ".join(state.name.lower() for state in Shakedown),
    },
    "x": {"axis": "X"},
    "y": {"axis": "Y"},
    "depth": {"positive": "down"},
    "component": {"long_name": "component of the stress tensor"},
    "stage": {"long_name": "stage of loading"},
    "body": {"long_name": "body"},
}
