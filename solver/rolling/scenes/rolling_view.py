"""Positions of the results of rolling."""

from __future__ import annotations

import math

import numpy as np

from solver.mesh.lines import cells
from solver.results.view import View
from solver.rolling.scenes.rolling_grids import recorded_step
from solver.rolling.scenes.rolling_parameters import RollingParameters
from solver.typing import Array

_EXTENT = 4.0
"""Ratio of the largest x of results on an endless track to the Hertz half-width."""


def view(parameters: RollingParameters) -> View:
    """Return the positions of results, which depend on dimensions and not on the mesh."""
    if parameters.endless:
        return _around_the_load(parameters.widest.half_width)
    half, a = parameters.length / 2, parameters.half_width
    edge = math.ceil(half + max(2 * a, parameters.spread))
    places = round(edge / recorded_step(a))
    return View(
        x=np.linspace(-edge, edge, places + 1),
        y=-_pixels(a),
        depth=_depths(a),
        station=np.array([-10.0, 0.0, 10.0]) * min(1.0, parameters.length / 50.0),
        s=np.linspace(-edge, edge, 2 * places + 1),
        profile_body="half_space",
        surfaces={"half_space": "top"},
        stages=("loaded", "mid_track", "unloaded"),
        loaded="mid_track",
        following=("loaded",),
    )


def _around_the_load(a: float) -> View:
    """Return the positions of results on an endless track for the half-width a [mm]."""
    return View(
        x=a * np.linspace(-_EXTENT, _EXTENT, 161),
        y=-_pixels(a),
        depth=_depths(a),
        station=np.array([0.0]),
        s=a * np.linspace(-_EXTENT, _EXTENT, 641),
        profile_body="half_space",
        surfaces={"half_space": "top"},
        stages=("loaded", "unloaded"),
    )


def _pixels(a: float) -> Array:
    """Return the depths of the map for the half-width a [mm]."""
    return cells(5 * a, smallest=a / 64, ratio=1.05, largest=a / 16)


def _depths(a: float) -> Array:
    """Return the depths of profiles for the half-width a [mm]."""
    return np.concatenate([np.linspace(0.0, 3 * a, 121), np.linspace(3.1 * a, 6 * a, 30)])
