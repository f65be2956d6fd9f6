"""Data sets of rolling whose profiles, and their errors, are known."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from studies.definition.vocabulary import OK
from studies.storage.seal import seal

DEPTH = np.concatenate([np.linspace(0.0, 25.0, 126), np.linspace(25.5, 50.0, 30)])
PEAK = 3.0
"""Depth of the local maximum of all profiles; their minimum is at `LOWEST` [mm]."""
LOWEST = 8.0
COMPONENTS = ["xx", "yy", "zz", "xy"]


def profile(surface: float, below: float, peak: float, lowest: float) -> np.ndarray:
    """A smooth line through (0, surface), (1, below), (3, peak), (8, lowest), decaying deeper."""
    knots = [0.0, 1.0, PEAK, LOWEST, 16.0, 50.0]
    ends = [surface, below, peak, lowest, 0.0, 0.0]
    at = np.searchsorted(knots, DEPTH, side="right").clip(1, 5)
    left, right = np.array(knots)[at - 1], np.array(knots)[at]
    half = (1 - np.cos(np.pi * (DEPTH - left) / (right - left))) / 2
    return np.array(ends)[at - 1] * (1 - half) + np.array(ends)[at] * half


def data_set(
    cases: Mapping[str, int],
    sizes: Sequence[float] = (1.0,),
    steps: Sequence[float] = (1.0,),
    fixed: Mapping[str, Any] | None = None,
    frictions: Sequence[float] = (0.3,),
) -> xr.Dataset:
    """A study of rolling whose error is -10 MPa a mm of element and +4 MPa a mm of increment.

    Parameters
    ----------
    cases : label -> passes; surface stress is -100, lowest -200, the peak +50 MPa, all of them
        10 % larger after pass two, without error; strain falls from 0.04 to a peak of 0.02
    """
    most = max(cases.values())
    shape = (1, len(frictions), len(cases), len(sizes), len(steps))
    stress = np.full((*shape, most, 3, 4, DEPTH.size), np.nan)
    strain = np.full((*shape, most, 3, DEPTH.size), np.nan)
    for at in np.ndindex(*shape):
        _, f, c, h, s = at
        error = -10.0 * sizes[h] + 4.0 * steps[s] + 100.0 * (frictions[f] - 0.3)
        for n in range(list(cases.values())[c]):
            line = (1.0 + 0.1 * n) * profile(-100.0, -60.0, 50.0, -200.0) + error
            stress[at][n] = line
            stress[at][n, [0, 2]] += 1000.0  # the stations beside mid-track
            strain[at][n] = (1.0 + n) * profile(0.04, 0.015, 0.02, 0.01)
    sweep = ("load_ratio", "friction", "case", "element_size", "advance_step")
    dataset = xr.Dataset(
        {
            "status": (sweep, np.full(shape, OK, dtype=object)),
            "message": (sweep, np.full(shape, "", dtype=object)),
            "residual_profile": ((*sweep, "pass", "station", "component", "depth"), stress),
            "profile_plastic_strain": ((*sweep, "pass", "station", "depth"), strain),
        },
        coords={
            "load_ratio": [2.7],
            "friction": list(frictions),
            "case": list(cases),
            "passes": ("case", list(cases.values())),
            "element_size": list(sizes),
            "advance_step": list(steps),
            "station": [-10.0, 0.0, 10.0],
            "component": COMPONENTS,
            "depth": DEPTH,
            "pass": np.arange(1, most + 1),
        },
        attrs={"scene": "rolling", "title": "table", "parameters": json.dumps(fixed or {})},
    )
    return dataset.squeeze([n for n in ("element_size", "advance_step") if n in (fixed or {})])


def written(dataset: xr.Dataset, path: Path) -> Path:
    fixed = json.loads(dataset.attrs["parameters"])
    dataset.drop_vars([name for name in fixed if name in dataset.coords]).to_netcdf(path)
    seal(path, f"dataset {path.stem}")
    return path
