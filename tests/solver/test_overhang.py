"""A slave that goes on beyond the end of its master: pressure, its resultant, and its peak."""

from __future__ import annotations

import re

import numpy as np
import pytest

from solver import Body, ContactPair, Material, Model, solve
from solver.mesh import grid
from solver.results.requested import RequestedNumber

pytestmark = pytest.mark.solves

STEEL = Material(youngs_modulus=2e5, poisson_ratio=0.3)
LENGTH, LOAD = 10.0, 100.0


def pressed(width, sliding="small", *, parts=10, exchanged=False, **kind):
    """A block of 10 mm, pressed by 100 MPa on a base that ends under it at the given width."""
    across = np.linspace(0.0, 5.0, parts // 2 + 1)
    block = Body(name="block", mesh=grid(np.linspace(0.0, LENGTH, parts + 1), across),
                 material=STEEL, supports={"left": "x"}, pressure={"top": LOAD},
                 **kind)  # fmt: skip
    base = Body(name="base", mesh=grid(np.linspace(0.0, width, parts - 1), across - 5.0),
                material=STEEL, supports={"bottom": "xy"}, **kind)  # fmt: skip
    sides = ("block", "bottom"), ("base", "top")
    slave, master = sides[::-1] if exchanged else sides
    pair = ContactPair(slave=slave, master=master, sliding=sliding)
    return solve(Model(bodies=(block, base), contacts=(pair,)))


def integral(contact, of="pressure"):
    """The integral that a scene file asks for [N]."""
    number = RequestedNumber(name="force", of=of, take="integral", stage="on", contact="face")
    (found,) = number.values(None, None, {}, {"face": contact}).values()
    return found


@pytest.mark.parametrize("sliding", ["small", "finite"])
@pytest.mark.parametrize("width", [8.0, 8.002, 8.1, 8.5, 8.95])
def test_pressure_has_the_contact_force_as_resultant_and_ends_with_the_master(width, sliding):
    found = pressed(width, sliding)
    force = float(found.stages["loaded"].state.contacts[0].normal.sum())
    assert force == pytest.approx(LOAD * LENGTH, rel=1e-5)  # normals turn with the surface
    contact = found.contact()
    assert integral(contact) == pytest.approx(force, rel=1e-12)
    along = np.trapezoid(contact.pressure, contact.s)
    assert along == pytest.approx(force, rel=1e-12)  # of straight edges: as a line of a data set
    beyond = contact.X[0] > width + 1.0  # of the hats of these vertices nothing is covered
    assert not contact.pressure[beyond].any()


def test_pressure_around_an_axis_has_the_contact_force_as_resultant():
    found = pressed(8.3, kinematics="axisymmetric")
    force = float(found.stages["loaded"].state.contacts[0].normal.sum())
    assert force == pytest.approx(LOAD * np.pi * LENGTH**2, rel=1e-9)
    assert integral(found.contact()) == pytest.approx(force, rel=1e-12)


def test_both_sides_find_the_same_pressure_beside_a_master_that_ends():
    """At the corner pressure has no bound; an edge from it both agree within a few percent."""
    places, found = np.linspace(0.5, 7.5, 15), {}
    for exchanged in (False, True):
        contact = pressed(8.1, parts=20, exchanged=exchanged).contact()
        order = np.argsort(contact.X[0])
        x, pressure = contact.X[0][order], contact.pressure[order]
        found[exchanged] = np.interp(places, x, pressure), pressure.max()
    np.testing.assert_allclose(found[False][0], found[True][0], rtol=0.025)
    # a mean under a hat of which half is covered: less, and growing as the mesh is refined
    coarse = pressed(8.1).contact().pressure.max()
    assert coarse < found[False][1] < found[True][1]


def test_a_peak_where_the_master_ends_is_a_warning_that_names_the_place():
    (warning,) = pressed(8.1).audit().warnings
    assert re.match(r"block.bottom has its largest pressure at \([78], 0\), where", warning)
    assert "beyond the end of base.top" in warning
    assert not pressed(8.1, exchanged=True).audit().warnings
