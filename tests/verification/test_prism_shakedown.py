"""Shakedown of a frictionless circle that rolls over a body without hardening.

A.R.S. Ponter, A.D. Hearle, K.L. Johnson, J. Mech. Phys. Solids 33 (1985) 339-362: it shakes down up
to a largest pressure of 4.675 k, k the yield stress in shear. That is an upper bound, from the
shear that alternates on planes through the axle's direction; residual stress cannot change it.
`test_raceway.py` has a ball far below it and far above.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from solver.linear.solvers import one_thread
from solver.rolling.load import RollingLoad
from solver.rolling.passing import passing
from solver.rolling.rail.patch_contact import EllipticPatch
from solver.rolling.rail.track import PrismTrack
from tests.verification.prism_blocks import PERFECT, RE, block

pytestmark = pytest.mark.long

RADIUS, PASSES = 7.0, 6


@cache
def track() -> PrismTrack:
    """Elements and stations of a fifth of the radius."""
    return block(10.0 / 7, spacing=64.0 / 46, levels=2)


def growth(ratio: float) -> NDArray[np.float64]:
    """Return the largest growth of plastic strain (PASSES,) in each pass, over the yield strain."""
    force = 2 * np.pi * RADIUS**2 * ratio * RE / np.sqrt(3) / 3
    load = EllipticPatch(grid=track().grid, load=RollingLoad(force=force), a=RADIUS, b=RADIUS)
    state, guess, each = track().virgin(PERFECT), None, []
    with one_thread():
        for _ in range(PASSES):
            found = passing(track(), PERFECT, load, state, guess)
            each.append((found.after.accumulated - state.accumulated).max())
            state, guess = found.after, found.strain
    return np.array(each) * PERFECT.youngs_modulus / RE


def test_it_shakes_down_3_percent_below_the_limit() -> None:
    """5.8, 0.40, 0.06, 0.02, 0.01, 0.003 of the yield strain."""
    added = growth(0.97 * 4.675)
    assert added[0] > 3.0
    assert (added[1:] < 0.7 * added[:-1]).all()
    assert added[-1] < 0.005


def test_it_yields_in_every_pass_3_percent_above() -> None:
    """8.0, 0.6, 0.5, 0.3, 0.25, 0.22 of the yield strain, and 0.2 in the eighth pass."""
    added = growth(1.03 * 4.675)
    assert added[-1] > 0.15
    assert added[-1] > 0.8 * added[-2]
