"""The numbers of runs: their groups, the worst of the audit, and what of them is rounding."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from solver.audit.figures import AUDIT, LIMITS
from studies.numbers import rounding

FIGURES: Mapping[str, str] = {
    "surface_residual_max": "largest residual {component} surface {body}",
    "surface_residual_x": "surface residual x",
    "first_row_residual_x": "first row residual x",
    "free_surface_residual_x": "free surface residual x",
    "lowest_residual_x": "lowest residual x",
    "depth_of_lowest_residual_x": "at depth",
    "surface_residual_z": "surface residual z",
    "first_row_residual_z": "first row residual z",
    "free_surface_residual_z": "free surface residual z",
    "lowest_residual_z": "lowest residual z",
    "depth_of_lowest_residual_z": "at depth",
    "surface_plastic_strain": "surface plastic strain",
    "highest_plastic_strain": "mid-track plastic strain",
    "depth_of_highest_plastic_strain": "at depth",
    "stick_half_width": "stick half-width",
    "singular_power": "singular power",
    "singular_power_error": "its error",
    "singular_intensity": "singular intensity",
    "apparent_power": "apparent power",
    "peak_contact_pressure": "peak contact pressure",
    "wear_depth": "wear depth",
    "slip_length": "slip length",
    "slip_share": "share that slips",
    "crack_arrest_depth": "crack held at depth",
    "K_I": "K I {tip} {stage}",
    "K_II": "K II {tip} {stage}",
    "max_plastic_strain": "largest plastic strain",
    "most_yielded_depth": "yielded to depth",
    "audit_plastic_strain": "away from singular points",
    "shakedown_state": "shakedown state",
    "increments": "increments",
    "cut_increments": "cut",
    "cpu_seconds": "cpu",
}
"""Variables in a table of runs, if the scene has them, and their headings. A variable over bodies
and components has a column for the first component of each body, one over tips of cracks and stages
a column for each."""

PRODUCTS = frozenset({"wear_depth"})
"""Numbers that are products, not differences of others of their unit: however small beside those,
they are no rounding."""

_NO_LENGTH = 1e-15
"""Length up to which it is rounding, also of products [mm]."""


def floor(name: str, unit: str, level: float) -> float:
    """Return the size below which a number is shown as 0, given the largest of its unit."""
    relative = 0.0 if name in PRODUCTS or not unit else rounding(unit, level)
    return max(relative, _NO_LENGTH if unit == "mm" else 0.0)


class Floors:
    """What numbers of a table are shown as 0, beside others of their unit.

    Parameters
    ----------
    numbers : units of the numbers, with their values
    """

    def __init__(self, numbers: Iterable[tuple[str, np.ndarray]]) -> None:
        self._levels: dict[str, float] = {}
        for unit, values in numbers:
            size = float(np.nanmax(np.abs(values), initial=0.0))
            self._levels[unit] = max(self._levels.get(unit, 0.0), size)

    def clean(self, name: str, unit: str, values: Any) -> np.ndarray:
        """Return the values of a number, with 0 for those that are rounding."""
        below = np.abs(values) < floor(name, unit, self._levels.get(unit, 0.0))
        return np.where(below, 0.0, values)


EFFORT = (
    "increments", "cut_increments", "iterations", "median_iterations", "inner_fallbacks",
    "blended_tangents", "cpu_seconds", "degrees_of_freedom",
)  # fmt: skip
"""Numbers that say how hard a run was to solve."""


def group_of(name: str) -> str:
    """Return the group of a number of a run: ``result``, ``effort`` or ``audit``."""
    if name in AUDIT or name.startswith("audit_"):
        return "audit"
    return "effort" if name in EFFORT else "result"


def varies(values: np.ndarray) -> bool:
    """Whether numbers are not all the same, without those that are NaN."""
    known = values[~np.isnan(values)]
    return known.size > 0 and bool((known != known[0]).any())


@dataclass(frozen=True, slots=True)
class Worst:
    """The largest value of a figure of the audit.

    Attributes
    ----------
    name, value, limit : the figure, its value, and the limit above which a run fails
    at : position of the run among all runs
    """

    name: str
    value: float
    limit: float
    at: int

    @property
    def share(self) -> float:
        """Value over limit."""
        return self.value / self.limit


def meter(value: float, limit: float) -> float:
    """Return the length of a meter, 0 to 1: the place between limit / 1e6 and limit in decades."""
    if not limit or not value > 0.0:  # NaN is none
        return 0.0
    return min(max(1.0 + math.log10(value / limit) / 6.0, 0.02), 1.0)


def worst(numbers: Mapping[str, np.ndarray]) -> list[Worst]:
    """Return the largest value of each figure that has a limit, the nearest to its limit first.

    Parameters
    ----------
    numbers : values over all runs by name, NaN where there is none; others than figures are ignored
    """
    found = []
    for name, limit in LIMITS.items():
        values = np.asarray(numbers.get(name, ()), dtype=float).ravel()
        if np.isfinite(values).any():
            at = int(np.nanargmax(values))
            found.append(Worst(name, float(values[at]), limit, at))
    return sorted(found, key=lambda each: -each.share)
