"""Draw shakedown limits of sliding line contact over computed states."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import cache
from math import sqrt
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from solver.results.sliding_limits import johnson_limit, melan_limit

_POINTS = 51
_LINE_CONTACT = "rolling"
"""The scene of a line contact."""


def draw_shakedown_limits(axes: Axes, panel: xr.Dataset, outermost: bool) -> Sequence[Line2D]:
    """Draw the largest p0 / k at which a body without hardening shakes down; return the lines.

    The limits hold for line contact with shear = friction * pressure: no line is drawn for another
    scene, and nothing unless all contacts slide.

    Parameters
    ----------
    axes : axes with friction horizontal and load ratio p0 / Re vertical
    panel : the runs on these axes
    outermost : whether the scale of p0 / k on the right has a label
    """
    friction = panel["friction"]
    slides = (friction == 0.0) | (_parameter(panel, "traction") == 1.0)
    poisson = np.asarray(_parameter(panel, "poisson_ratio"))
    if not bool(slides.all()) or poisson.ndim:
        return []
    right = axes.secondary_yaxis("right", functions=(_over_shear_yield, _over_yield))
    right.tick_params(labelright=outermost)
    if outermost:
        right.set_ylabel("$p_0$ / k")
    if panel.attrs["scene"] != _LINE_CONTACT:
        return []
    limits = _limits(float(friction.max()), float(poisson))
    styles = {"limit without hardening\n(Johnson)": "-", "the same (Melan, von Mises)": "--"}
    return [
        axes.plot(limits[0], _over_yield(limit), style, label=name, color="0.15", linewidth=1.2)[0]
        for limit, (name, style) in zip(limits[1:], styles.items(), strict=True)
    ]


def _over_shear_yield(ratio: Any) -> Any:
    return ratio * sqrt(3.0)


def _over_yield(pressure: Any) -> Any:
    return pressure / sqrt(3.0)


@cache
def _limits(most: float, poisson_ratio: float) -> np.ndarray:
    """Return friction up to `most` and both limits of p0 / k (3, n)."""
    friction = np.linspace(0.0, most, _POINTS)
    both = [(johnson_limit(mu), melan_limit(mu, poisson_ratio)) for mu in friction]
    return np.stack([friction, *np.transpose(both)])


def _parameter(panel: xr.Dataset, name: str) -> Any:
    """Return a parameter of the runs: a coordinate if it is swept, else its single value."""
    return panel[name] if name in panel.coords else json.loads(panel.attrs["parameters"])[name]
