"""Tracks of finite length tend to the endless one as 1 / length.

Both have increments of one element: points of the endless track are one element apart. A Hertz
pressure passes without friction. What is left is the ends, and half-planes of 400 half-widths in
the place of 1 600. `test_rolling_endless.py` runs the same code.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from solver import System, Walker
from solver.loading.program import Control, Tolerances
from solver.rolling.plane.rolling import rolling
from solver.rolling.scenes.rolling import RollingParameters
from solver.rolling.scenes.rolling_endless import load_on
from solver.rolling.scenes.rolling_model import model
from tests.verification.interleaved import InterleavedTrack

pytestmark = pytest.mark.long

SIDE = 4.0
FREE = {
    "load": "hertz", "friction": 0.0, "element_size": SIDE, "growth": 1.5,
    "hardening": "chaboche", "back_stresses": ((60_000.0, 600.0), (4000.0, 20.0)),
}  # fmt: skip
"""A law that the endless track asks from column to column, as increments do at their points."""
LENGTHS = (64.0, 128.0, 256.0)
YIELD = RollingParameters().yield_stress
ENOUGH = Control(tolerances=Tolerances(residual=1e-4))
"""With a residual of 1e-8, stress of a track of 100 mm is the same to 0.002 MPa."""
AVERAGED = 1 / 20
"""Half the part of a track around its middle, over which stress is averaged / length."""
SAME = 0.05
"""Difference in depth of the rows of both meshes, up to which they are the same [mm]."""


def endless():
    """Depth of the rows and residual sigma_x there, mean of both chains of points."""
    p = RollingParameters(**FREE)
    track = InterleavedTrack(p.mesh_width, SIDE, p.growth, p.material().elasticity)
    (one,) = rolling(track, p.material(), load_on(track, p, p), [1], parts=1)
    stress = one.after.stress(p.material().elasticity)[:, 0]
    return one.after.depth[::2], stress.reshape(-1, 2).mean(axis=1)


def with_ends(length, depth):
    """Residual sigma_x under mid-track at these depths."""
    steps = {"advance_step": SIDE, "press_steps": 2, "unload_steps": 1}
    p = RollingParameters(**FREE, **steps, track=length)
    system = System(model(p))
    (outcome,) = Walker(system, ENOUGH).walk([p.schedule.program])
    assert outcome.error is None
    stress = system.state("half_space", outcome.last).stress[0]
    x, y = system.full("half_space").points.reshape(2, -1)
    middle = abs(x) < AVERAGED * length
    return np.array([stress[middle & (abs(y + row) < SAME)].mean() for row in depth])


@cache
def beyond_endless():
    """Depths below 1 mm, and sigma_x that tracks of `LENGTHS` have above the endless one."""
    depth, stress = endless()
    rows = depth > 1.0
    return depth[rows], np.array([with_ends(each, depth[rows]) for each in LENGTHS]) - stress[rows]


def test_extrapolated_in_1_over_length_they_are_the_endless_track():
    _, beyond = beyond_endless()
    extrapolated = 2 * beyond[2] - beyond[1]
    assert abs(extrapolated).max() < 0.02 * YIELD


def test_what_the_ends_add_halves_with_twice_the_length():
    """Where material yields; below, the ends of short tracks are too near for that."""
    depth, beyond = beyond_endless()
    yields = depth < 2 * RollingParameters(**FREE).half_width
    means = beyond[:, yields].mean(axis=1)
    assert means[0] / means[1] == pytest.approx(2.0, abs=0.3)
    assert means[1] / means[2] == pytest.approx(2.0, abs=0.3)
    assert (beyond > 0).all(), "the ends make tension"
