"""Elastic stress under a given pressure on a prism: against Boussinesq, and its first yield.

`test_prism_elastic.py` has stress under an ellipse on larger elements, in less time.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from solver.rolling.load import RollingLoad
from solver.rolling.rail.patch_contact import EllipticPatch
from solver.rolling.rail.track import PrismField, PrismTrack
from solver.tensors import to_tensor, von_mises
from tests.verification.closed_forms import HertzEllipse
from tests.verification.prism_blocks import PERFECT, A, B, block

pytestmark = pytest.mark.long

Array = NDArray[np.float64]


def body() -> PrismTrack:
    """Elements and stations of 1 mm, in a block of 600 by 300 mm."""
    return block(1.0, far=300.0, growth=1.8, levels=2)


def stress(track: PrismTrack, ellipse: HertzEllipse) -> Array:
    """Return Mandel stress (n_points, window, 6) under an ellipse, over its largest pressure."""
    load = EllipticPatch(
        grid=track.grid, load=RollingLoad(force=ellipse.force), a=ellipse.a, b=ellipse.b
    )
    nothing = np.zeros((track.grid.stations, len(track.grid.z), 3))
    field = PrismField(track, traction=load.solve(nothing).traction)
    return track.strain(field) @ PERFECT.stiffness(6) / ellipse.peak_pressure


def test_stress_half_an_element_down_is_that_of_the_half_space() -> None:
    """Over the largest pressure p0, from the middle to beyond the edge; elements of b/6.

    Half an element down the middle errs by 0.7 % of p0. Under the edge, where the pressure falls
    with the root of the distance, the error is 1.2 % at 0.8 of an element, 0.8 % at 1.2, 0.3 % at
    1.8; with elements of b/12.5 it is 0.9 % at 0.8. The section makes it there, not the load:
    forces that work on all of its quadratic shape functions, and those of all waves that stations
    carry, hardly change it.
    """
    track, ellipse = body(), HertzEllipse(a=A, b=B, peak_pressure=1360.0)
    found = stress(track, ellipse)
    z, y = track.points
    rows = np.flatnonzero((z > 0) & (z < 8.5) & (y > -4.0) & (y < -0.5))
    stations = track.before - np.arange(12)
    some = found[np.ix_(rows, stations)]
    x = track.modes.x[stations] - track.modes.x[track.before]
    place = [each.ravel() for each in np.broadcast_arrays(x, -y[rows, None], z[rows, None])]
    exact = ellipse.stress(*place, PERFECT.poisson_ratio).T / ellipse.peak_pressure
    error = np.abs(to_tensor((some.reshape(-1, 6) - exact).T)).max(axis=0)
    at, deep, across = place
    inside = (at / A) ** 2 + (across / B) ** 2 < 0.7**2
    assert error[inside].max() < 0.01
    assert error.max() < 0.013
    assert error[deep > 1.0].max() < 0.009
    assert error[deep > 1.5].max() < 0.0035


def test_a_circle_yields_first_at_1613_of_the_yield_stress_half_a_radius_down() -> None:
    """K.L. Johnson, Contact Mechanics (1985), p. 155: p0 = 1.613 Y at the depth of 0.48 a."""
    circle = HertzEllipse(a=8.0, b=8.0, peak_pressure=1000.0)
    track = body()
    equivalent = von_mises(np.moveaxis(stress(track, circle), 2, 0))
    point, station = np.unravel_index(equivalent.argmax(), equivalent.shape)
    np.testing.assert_allclose(1 / equivalent.max(), 1.613, rtol=0.01)
    z, y = track.points[:, point]
    assert station == track.before
    assert abs(z) < 0.5
    np.testing.assert_allclose(-y, 0.48 * circle.a, atol=0.5)
