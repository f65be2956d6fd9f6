"""What the numbers of a run tell, and the rules by which tables, pages and pictures show them.

What needs the values of a run, such as the end of the colours of a map, goes with these values
(`studies.views.shown`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from solver.audit.figures import AUDIT, LIMITS
from studies.definition.vocabulary import OK, OUTSIDE_THEORY

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

EFFORT = (
    "increments", "cut_increments", "iterations", "median_iterations", "inner_fallbacks",
    "blended_tangents", "cpu_seconds", "degrees_of_freedom",
)  # fmt: skip
"""Numbers that say how hard a run was to solve."""


def group_of(name: str) -> str:
    """Return what a number of a run tells: ``result``, ``effort`` or ``audit``."""
    if name in AUDIT or name.startswith("audit_"):
        return "audit"
    return "effort" if name in EFFORT else "result"


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
    if not limit or value <= 0.0:
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


MOST_LINES = 12
"""Largest number of lines that can be distinguished in a legend."""

SIGNED, SEQUENTIAL, NUMBERS = "RdBu_r", "YlOrRd", "viridis"
"""Colours of matplotlib: with zero in the middle, from zero on, and of values of the runs."""

_COLOURS: Mapping[str, str] = {
    SIGNED: "053061 2166ac 4393c3 92c5de d1e5f0 f7f7f7 fddbc7 f4a582 d6604d b2182b 67001f",
    SEQUENTIAL: "ffffcc ffeda0 fed976 feb24c fd8d3c fc4e2a e31a1c bd0026 800026",
    NUMBERS: "440154 482878 3e4989 31688e 26828e 1f9e89 35b779 6ece58 b5de2b fde725",
}
"""The same at equal distances: a page does not load matplotlib."""

REASONS: Mapping[str, str] = {
    OK: "no value",
    "limit_load": "no equilibrium",
    OUTSIDE_THEORY: "outside small-strain theory",
    "pending": "not computed yet",
}
"""Why a run has no value, by its status; of other statuses their names."""


def scale(colours: str) -> Sequence[str]:
    """Return colours at equal distances."""
    return [f"#{each}" for each in _COLOURS[colours].split()]


PAGES = {
    "most_lines": MOST_LINES,
    "signed": scale(SIGNED),
    "sequential": scale(SEQUENTIAL),
    "numbers": scale(NUMBERS),
    "reasons": REASONS,
}
"""What pages know of this."""
