"""A steady state under a rolling wheel is a fixed point of one increment with contact.

The system that goes by increments knows nothing of steady passes: it pairs wheel and track where
they are, takes slip from the motion of both since the last state, and turns the wheel by a finite
angle. Points of the track are one element apart, and so is the increment.
"""

from __future__ import annotations

import pytest

from tests.verification.steady_increment import SteadyIncrement

FREE_TO_30 = {
    "frictionless": {"friction": 0.0},
    "free": {},
    "braking": {"traction": 0.3},
    "driving": {"traction": -0.3},
}
WIDE = 4.0
"""Window / the usual one, where driving leaves a layer at yield: in increments it flows behind the
window as well, on elements that grow, and the state in the window feels that (2 G |change| is 11, 5
and 2 MPa with windows of 1, 2 and 4)."""


@pytest.mark.parametrize("case", FREE_TO_30)
def test_a_pass_up_to_30_percent_is_a_fixed_point_of_one_increment(case):
    one = SteadyIncrement(element_size=2.0, **FREE_TO_30[case])
    found = one.solve(from_touch=False)
    assert one.change(found) < 1.0  # MPa
    assert (found.state.contacts[0].status == one.found.loading.status).all()


def test_so_is_one_at_75_percent_with_hardening():
    one = SteadyIncrement(element_size=2.5, traction=0.75, hardening="kinematic")
    assert one.change(one.solve(from_touch=False)) < 5.0


@pytest.mark.parametrize(("traction", "reach", "most"), [(0.75, 2.0, 5.0), (-0.75, WIDE, 10.0)])
def test_without_hardening_it_nearly_is(traction, reach, most):
    one = SteadyIncrement(element_size=2.5, traction=traction, reach=reach)
    assert one.change(one.solve(from_touch=False)) < most


def test_slip_before_a_vertex_touches_hardly_matters_in_free_rolling():
    """Increments leave it out, a steady pass counts it. With elements of 2 mm it makes 6 MPa."""
    one = SteadyIncrement(element_size=1.25)
    assert one.change(one.solve(from_touch=True)) < 1.5
