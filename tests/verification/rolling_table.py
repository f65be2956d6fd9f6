"""Rolling cases T1 to T10 as computed on a mesh that tests can afford.

The mesh is coarser and the track shorter than a study's: good for signs, orders and depths. With
elements of 1 mm the stress in the first millimetre differs by up to 150 MPa.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from solver import SCENES
from solver.rolling.scenes.rolling import RollingParameters
from tests.records import kept

TABLE = Path(__file__).parents[2] / "data" / "studies" / "rolling-table.toml"
CASES = tomllib.loads(TABLE.read_text(encoding="utf-8"))["sweep"]["case"]
# How the wheel is set down and driven hardly matters at mid-track.
SET_DOWN = {"press_steps": 2, "unload_steps": 1}
# A shorter track has no steady state at its middle: after 12 mm, acceleration leaves little more
# than half the surface compression that it leaves after 20 mm.
MESH = {"element_size": 1.5, "advance_step": 1.5, "track": 39.0, "growth": 1.3} | SET_DOWN
# The locked wheel takes three times as many iterations, and what it does is coarse enough.
LOCKED = {"element_size": 2.0, "advance_step": 2.0, "track": 12.0, "growth": 1.5} | SET_DOWN
YIELD = RollingParameters().yield_stress
UPPER = 12.0
"""Depth of what is compared as a whole [mm]: one and a half Hertz half-widths."""


@cache
def passes(case):
    """The records of a case after its first pass, its second, ..."""
    parameters = RollingParameters(**CASES[case], **(LOCKED if case == "T4" else MESH))
    wanted = range(1, parameters.passes + 1)
    return list(map(kept, SCENES["rolling"].path(parameters, wanted, lambda share: None)))


def after(case, number=1):
    """The record of a case after a pass."""
    record = passes(case)[number - 1]
    assert record.status.solved, record.message
    return record


@dataclass(frozen=True, slots=True)
class Profile:
    """Values against depth [mm]."""

    depth: np.ndarray
    value: np.ndarray

    @property
    def surface(self):
        return self.value[0]

    @property
    def lowest(self):
        return self.value.min()

    @property
    def highest(self):
        return self.value.max()

    @property
    def depth_of_lowest(self):
        return self.depth[self.value.argmin()]

    @property
    def depth_of_highest(self):
        return self.depth[self.value.argmax()]

    @property
    def upper(self):
        return self.value[self.depth < UPPER]

    def distance(self, other):
        """Root mean square of the difference, in the upper part."""
        return np.sqrt(np.mean((self.upper - other.upper) ** 2))

    @property
    def size(self):
        """Root mean square, in the upper part."""
        return np.sqrt(np.mean(self.upper**2))


def stress(case, component, number=1, station=1):
    """Residual stress below a station (the middle one), after a pass [MPa]."""
    record = after(case, number)
    at = list(record.coordinates["component"]).index(component)
    values = record.fields["residual_profile"][1][number - 1, station, at]
    return Profile(record.coordinates["depth"], values)


def strain(case, number=1):
    """Equivalent plastic strain below mid-track, after a pass."""
    record = after(case, number)
    return Profile(
        record.coordinates["depth"], record.fields["profile_plastic_strain"][1][number - 1, 1]
    )


@dataclass(frozen=True, slots=True)
class Contact:
    """The loaded contact of a first pass at mid-track, along s [mm], ahead of the wheel positive.

    ``place`` runs from 0 at its trailing edge to 1 at its leading edge; ``mises`` is the von Mises
    stress at the surface of the half-space [MPa].
    """

    s: np.ndarray
    place: np.ndarray
    pressure: np.ndarray
    shear: np.ndarray
    mises: np.ndarray

    @property
    def mobilised(self):
        """Share of friction that the shear takes up: 1 where it slips."""
        return np.abs(self.shear) / (RollingParameters().friction * self.pressure)

    @property
    def yielding(self):
        """Share of the contact that is at yield."""
        return (self.mises > 0.95 * YIELD).mean()

    @property
    def half_lengths(self):
        """Distances from the peak of pressure to half of it, behind and ahead [mm]."""
        high = self.s[self.pressure > self.pressure.max() / 2]
        peak = self.s[self.pressure.argmax()]
        return peak - high[0], high[-1] - peak


def mid_track(case):
    record = after(case)
    at = list(record.coordinates["stage"]).index("mid_track")
    pressure, shear, mises = (
        np.nan_to_num(record.fields[name][1][at])
        for name in ("contact_pressure", "contact_shear", "surface_mises")
    )
    closed = pressure > 0.01 * pressure.max()
    s = record.coordinates["s"]
    ends = s[closed][[0, -1]]
    return Contact(
        s[closed], np.interp(s[closed], ends, [0.0, 1.0]), pressure[closed], shear[closed],
        mises[closed],
    )  # fmt: skip
