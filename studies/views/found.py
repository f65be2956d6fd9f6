"""What a study that chooses its runs has found, as a table and as marks over what it sets."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import xarray as xr

from studies.kinds import KINDS

Mark = Mapping[str, tuple[Any, Any, Any]]
"""A place by parameter: value, and lower and upper end of what is known of it, or None."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """What was found.

    Attributes
    ----------
    about : what was asked for, and how the work ended, a sentence each
    warning : what makes it doubtful; empty if nothing does
    headings, units, rows : a table; its texts for each column
    words : number of the first columns that are words
    marks : a place for each answer that has one
    """

    about: Sequence[str]
    headings: Sequence[str]
    units: Sequence[str]
    rows: Sequence[Sequence[str]]
    words: int
    marks: Sequence[Mark] = ()
    warning: str = ""


def found_of(dataset: xr.Dataset) -> Found | None:
    """Return what the study of a data set has found; None if it chose no runs."""
    for name, kind in KINDS.items():
        if name in dataset.attrs:
            found: Found = kind.found(dataset, json.loads(dataset.attrs[name]))
            return found
    return None
