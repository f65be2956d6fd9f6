"""Which problem a run solved: its parameters without those that refine."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

import xarray as xr

from solver.scenes import Scene
from studies.definition.parameters import completed, parameters_of, plain
from studies.scenes.registry import scene_of

SAME = 1e-6
"""Relative difference below which two numbers are the same."""

Parameters = Mapping[str, Any]


def run_parameters(run: xr.Dataset) -> dict[str, Any]:
    """Return all parameters of a single run: swept, fixed for the study, or the default."""
    fixed = json.loads(run.attrs["parameters"])
    scene = scene_of(run.attrs)
    known = parameters_of(scene)
    given = {name: fixed.get(name, parameter.default) for name, parameter in known.items()}
    swept = {name: plain(run[name].item(), given[name]) for name in known if name in run.coords}
    values = given | swept
    left_out = {name: None for name, value in values.items() if value != value}  # NaN
    return completed(scene, values | left_out)


def other_problem(
    scene: Scene, one: Parameters, other: Parameters, number: int
) -> dict[str, tuple[Any, Any]]:
    """Return the parameters in which two runs of a scene solve different problems, up to a pass.

    Parameters that refine make no other problem. The number of passes does not either, nor does
    the direction of later passes: what is compared is the state after pass `number`.

    Returns
    -------
    dict : name of the parameter -> its value in `one`, its value in `other`
    """
    later = {"passes", "direction"} if number == 1 else {"passes"}
    found = differences(one, other)
    return {name: pair for name, pair in found.items() if name not in scene.refining | later}


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
