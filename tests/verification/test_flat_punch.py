"""Flat punches on an elastic half-plane: the singularity at the corner."""

from __future__ import annotations

import numpy as np
import pytest

from solver import solve
from solver.scenes.punch import PunchParameters
from solver.scenes.punch_setup import model
from tests.verification.closed_forms import (
    corner_power,
    dundurs_lee_power,
    flat_punch_pressure,
    log_slope,
)
from tests.verification.flat_punches import press

SMALLEST = 1e-5
FRICTIONS = (0.0, 0.1, 0.2, 0.4)


@pytest.fixture(scope="module")
def punches():
    return {friction: press(SMALLEST, friction) for friction in FRICTIONS}


def power(punch, values):
    """p of values ~ r^(p-1), ten elements to 0.3 % of the half-width from the corner."""
    near = (punch.r > 10 * SMALLEST) & (punch.r < 3e-3)
    return 1 + log_slope(punch.r[near], np.abs(values[near]))


def test_frictionless_corner_has_the_power_of_dundurs_and_lee(punches):
    """0.774 within 0.01; measured 0.7742."""
    assert power(punches[0.0], punches[0.0].pressure) == pytest.approx(
        dundurs_lee_power(), abs=2e-3
    )


@pytest.mark.parametrize("friction", FRICTIONS[1:])
def test_friction_strengthens_the_corner_singularity_as_the_eigenproblem_says(punches, friction):
    """Measured 0.7253, 0.6803, 0.5989 against 0.7249, 0.6799, 0.5983."""
    punch = punches[friction]
    assert punch.sliding[(punch.r > 0) & (punch.r < 3e-3)].all()
    assert power(punch, punch.pressure) == pytest.approx(corner_power(friction), abs=3e-3)
    assert power(punch, punch.shear) == pytest.approx(corner_power(friction), abs=3e-3)


def test_slip_zone_at_the_edge_shrinks_as_friction_grows(punches):
    zones = [punches[f].r[punches[f].sliding].max() for f in FRICTIONS[1:]]
    assert (np.diff(zones) < 0).all()


def test_friction_drags_the_half_plane_outwards(punches):
    """The punch spreads, the half-plane's surface is drawn in: the punch's shear points inwards."""
    for friction in FRICTIONS[1:]:
        punch = punches[friction]
        near = (punch.r > 10 * SMALLEST) & (punch.r < 3e-3)
        assert punch.shear[near] == pytest.approx(-friction * punch.pressure[near], rel=1e-6)


def test_pressure_carries_the_load_and_does_not_oscillate(punches):
    for punch in punches.values():
        smooth = np.log(punch.pressure[punch.r > 3 * SMALLEST])
        assert (np.diff(smooth) < 1e-3).all()  # falls away from the corner, never rises
        solution = punch.solution
        normal = solution.loaded.state.contacts[0].normal
        assert normal.sum() == pytest.approx(200.0, rel=1e-8)


@pytest.fixture(scope="module")
def rigid():
    """Young's modulus 1e4 times the half-plane's, of a hundred half-widths, on three meshes."""
    meshes = ((1e-2, 1.4), (3e-3, 1.25), (1e-3, 1.2))
    return [press(h, stiffness=1e4, size=100.0, growth=growth) for h, growth in meshes]


def rigid_error(punch, least):
    inside = (punch.r > least) & (punch.r <= 1.0)
    exact = flat_punch_pressure(1.0 - punch.r[inside], 1.0)
    return np.abs(punch.pressure[inside] / exact - 1).max()


def test_a_rigid_punch_has_the_closed_pressure_and_the_square_root_singularity(rigid):
    """Measured 0.34 % and a slope of -0.495: means under hats on a grid that grows by 1.2."""
    fine = rigid[-1]
    assert rigid_error(fine, 0.03) < 5e-3
    near = (fine.r > 1e-2) & (fine.r < 3e-2)
    assert log_slope(fine.r[near], fine.pressure[near]) == pytest.approx(-0.5, abs=0.01)


def test_the_error_under_a_rigid_punch_falls_with_refinement(rigid):
    coarse, middle, fine = (rigid_error(punch, 0.05) for punch in rigid)
    assert coarse > middle > fine


def test_the_punch_scene_at_its_finest_mesh_has_the_corner_power():
    """Elements of 1e-5 half-widths whose coordinates are one: rounding must not spoil them."""
    parameters = PunchParameters(yield_stress=1e6, state="plane_strain", smallest_element=SMALLEST)
    acting = solve(model(parameters), load=1e-3).contact()
    x, pressure = acting.X, acting.pressure
    r = 1 - x[0] / parameters.half_width
    near = (r > 10 * SMALLEST) & (r < 3e-3)
    assert 1 + log_slope(r[near], pressure[near]) == pytest.approx(dundurs_lee_power(), abs=2e-3)
