"""All criteria of the package, so that their words are known."""

from __future__ import annotations

from solver.fatigue import (
    brown_miller,
    crossland,
    dang_van,
    fatemi_socie,
    findley,
    matake,
    smith_watson_topper,
)
from solver.fatigue.criterion import CRITERIA

__all__ = ["CRITERIA", "PACKAGE"]
PACKAGE = (
    crossland, dang_van, findley, matake, fatemi_socie, smith_watson_topper, brown_miller,
)  # fmt: skip
"""Their modules."""
