"""What a minimum has found: its best runs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import xarray as xr

from studies.errors import StudyError
from studies.kinds.kind import Found
from studies.kinds.ranged import FOUND, MOST
from studies.views.best import best_runs
from studies.views.columns import unit_of, value_text

_ENDS = {FOUND: "the search settled", MOST: "its runs were used up", "open": "it was stopped"}
"""What the words of ``search_state`` say."""


def found(dataset: xr.Dataset, asked: Mapping[str, Any]) -> Found:
    """Return the best runs that meet the conditions, and mark the first."""
    try:
        best, warning = best_runs(dataset, asked["of"], asked["where"], lowest=True, count=5), ""
    except StudyError as error:
        best, warning = [], error.allowed
    names = list(best[0]) if best else []
    where = " where " * bool(asked["where"]) + " and ".join(asked["where"])
    state = _ENDS[dataset["search_state"].item()]
    return Found(
        about=[f"Least {asked['of']}{where}: {dataset.sizes['point']} runs; {state}."],
        warning=warning,
        headings=names,
        units=[unit_of(dataset[name]) for name in names],
        rows=[list(map(value_text, run.values())) for run in best],
        words=0,
        # a run alone has no axis to mark it on
        marks=[{n: (run[n], None, None) for n in asked["ranges"]} for run in best[:1] if names[1:]],
    )
