"""The kinds of study: a folder each, and their list."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from studies.kinds.fit.fitting import Fit
from studies.kinds.goal.search import Goal
from studies.kinds.kind import Found, Kind, SweepStudy
from studies.kinds.minimise.search import Minimise
from studies.kinds.refine.refinement import Refine

KINDS: Mapping[str, type[Kind]] = {each.name: each for each in (Goal, Refine, Fit, Minimise)}
"""The kinds that choose their runs, by the entry of a study."""


def kind_of(content: Mapping[str, Any]) -> type[Kind]:
    """Return the kind of a study of this content."""
    return next((kind for name, kind in KINDS.items() if content.get(name)), SweepStudy)


def found_of(dataset: Any) -> Found | None:
    """Return what the study of a data set has found; None if it chose no runs."""
    for name, kind in KINDS.items():
        if name in dataset.attrs:
            found: Found = kind.found(dataset, json.loads(dataset.attrs[name]))
            return found
    return None
