"""What a refinement has found: the errors that it has left in its cells."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from studies.kinds.kind import Found
from studies.kinds.refine.cells import ERROR
from studies.kinds.refine.refinement import FAILED, MOST, OPEN, SETTLED, SMALLEST
from studies.views.columns import unit_of, value_text, words

_STATES = {
    SETTLED: "settled",
    FAILED: "in which all runs failed",
    SMALLEST: "as small as is allowed",
    MOST: "left when the runs were used up",
    OPEN: "left when the work was stopped",
}


def found(dataset: xr.Dataset, refine: Mapping[str, Any]) -> Found:
    """Return the errors that a refinement has left in its cells."""
    count = Counter(dataset["cell_state"].to_numpy().astype(str).tolist())
    states = ", ".join(f"{number} {_STATES[state]}" for state, number in count.most_common())
    numbers = [n.removeprefix(ERROR) for n in map(str, dataset.data_vars) if ERROR in n]
    rows = []
    for name in numbers:
        left, values = dataset[f"{ERROR}{name}"].max().item(), dataset[name]
        width = values.max().item() - values.min().item()
        unit = unit_of(values)
        share = 100.0 * left / width if width > 0.0 else np.nan
        rows.append([words(name), value_text(left), unit, value_text(share)])
    until = refine["until"]
    if isinstance(until, Mapping):
        miss = ", ".join(f"{words(name)} by {value_text(each)}" for name, each in until.items())
    else:
        miss = f"a number by {value_text(100.0 * until)} % of its range"
    return Found(
        about=[
            f"{dataset.sizes['cell']} cells: {states}.",
            f"A cell is divided where its runs miss {miss} or more.",
        ],
        headings=["number", "largest error left", "unit", "of its range"],
        units=["", "", "", "%"],
        rows=rows,
        words=1,
    )
