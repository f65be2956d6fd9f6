"""Which problem a run solved: its parameters, but for those that say how finely."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

import xarray as xr

from studies.definition.parameters import parameters_of, plain, scene_named

REFINING = frozenset(
    {
        "element", "element_size", "smallest_element", "growth",
        "advance_step", "advance_tolerance", "load_step", "press_steps", "unload_steps",
    }
)  # fmt: skip
"""Parameters that change how accurate a result is, not what it is the result of."""

SAME = 1e-6
"""Relative difference below which two numbers are the same."""

Parameters = Mapping[str, Any]


def run_parameters(run: xr.Dataset) -> dict[str, Any]:
    """Return all parameters of a single run: swept, fixed for the study, or the default."""
    fixed = json.loads(run.attrs["parameters"])
    known = parameters_of(scene_named(run.attrs["scene"]))
    given = {name: fixed.get(name, parameter.default) for name, parameter in known.items()}
    swept = {name: plain(run[name].item(), given[name]) for name in known if name in run.coords}
    return given | swept


def other_problem(one: Parameters, other: Parameters, number: int) -> dict[str, tuple[Any, Any]]:
    """Return the parameters in which two runs differ up to a pass, each with both values.

    Refinement makes no other problem. The number of passes does not either, nor does the way of
    later passes: what is compared is the state after pass `number`.
    """
    later = {"passes", "direction"} if number == 1 else {"passes"}
    found = differences(one, other)
    return {name: pair for name, pair in found.items() if name not in REFINING | later}


def differences(one: Parameters, other: Parameters) -> dict[str, tuple[Any, Any]]:
    """Return the parameters in which two runs differ, each with both values."""
    return {name: (one[name], other[name]) for name in one if not _same(one[name], other[name])}


def told(value: Any) -> str:
    """Return a value to the digits that tell two different ones apart."""
    return f"{value:.7g}" if isinstance(value, float) else str(value)


def _same(one: Any, other: Any) -> bool:
    if isinstance(one, float) and isinstance(other, float):
        return math.isclose(one, other, rel_tol=SAME)
    return bool(one == other)
