"""Hertz line contact: an elastic cylinder, held by contact alone, on an elastic half-plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from solver import Body, ContactPair, Model, Solution, solve
from solver.mesh import graded, grid, mapped
from tests.verification.bodies import NU, E, steel
from tests.verification.closed_forms import HertzLine, plane_strain_modulus

HALF_WIDTH = 1.0
"""What the contact half-width shall be [mm]: the unit of all lengths."""
RADIUS = 100.0
SIZE = 100.0
"""Width and height of both bodies; their influence falls as (a / size)^2, here 1e-4."""
MODULUS = plane_strain_modulus(E, NU) / 2
FORCE = np.pi * HALF_WIDTH**2 * MODULUS / (4 * RADIUS)
EXACT = HertzLine(force=FORCE, radius=RADIUS, modulus=MODULUS)


@dataclass(frozen=True)
class Contact:
    """Slave vertices from the centre outwards, and their pressure."""

    x: np.ndarray
    pressure: np.ndarray
    solution: Solution

    @property
    def half_width(self):
        """Zero of a line fitted to p^2 over x^2 near the edge, exact for Hertz."""
        near = (self.pressure > 0.2 * self.peak) & (self.pressure < 0.8 * self.peak)
        slope, offset = np.polyfit(self.x[near] ** 2, self.pressure[near] ** 2, 1)
        return np.sqrt(-offset / slope)

    @property
    def peak(self):
        """Pressure at the centre."""
        return self.pressure[0]


def press(per_half_width, element="quad8", slave="cylinder", sliding="small", load=1.0):
    h = HALF_WIDTH / per_half_width
    fine = np.arange(0.0, 1.5 * HALF_WIDTH + h / 2, h)
    coarse = graded(SIZE - fine[-1], h, 1.3, 10.0)[1:]
    x = np.concatenate([fine, fine[-1] + coarse])
    depth = np.concatenate([fine[: per_half_width // 2], fine[per_half_width // 2] +
                            graded(SIZE - fine[per_half_width // 2], h, 1.3, 10.0)])  # fmt: skip
    # vertices of the two surfaces must not meet
    other = np.interp(np.linspace(0, 1, round(1.3 * len(x))), np.linspace(0, 1, len(x)), x)

    def bulge(p):
        profile = np.minimum(p[0] ** 2 / (2 * RADIUS), 12.5)
        return np.stack([p[0], profile + p[1] * (SIZE - profile) / SIZE])

    cylinder = Body(
        name="cylinder",
        mesh=mapped(grid(x if slave == "cylinder" else other, depth), bulge),
        material=steel(),
        element=element,
        supports={"left": "x"},
        pressure={"top": FORCE / 2 / SIZE},
    )
    plane = Body(
        name="plane",
        mesh=grid(other if slave == "cylinder" else x, -depth[::-1]),
        material=steel(),
        element=element,
        supports={"left": "x", "bottom": "y"},
    )
    sides = {"cylinder": ("cylinder", "bottom"), "plane": ("plane", "top")}
    master = sides["plane" if slave == "cylinder" else "cylinder"]
    pair = ContactPair(slave=sides[slave], master=master, sliding=sliding)
    solution = solve(Model(bodies=(cylinder, plane), contacts=(pair,)), load=load)
    acting = solution.contact()
    position, pressure = acting.X, acting.pressure
    order = np.argsort(position[0])
    return Contact(position[0, order], pressure[order], solution)


@pytest.fixture(scope="module")
def meshes():
    return {n: press(n) for n in (5, 10, 20)}


def test_half_width_and_peak_pressure_match_hertz(meshes):
    """Within 0.5 % at a/20; measured 0.07 % and 0.001 %."""
    contact = meshes[20]
    assert contact.half_width == pytest.approx(EXACT.half_width, rel=2e-3)
    assert contact.peak == pytest.approx(EXACT.peak_pressure, rel=1e-3)


def test_pressure_converges_at_first_order_and_half_width_faster(meshes):
    """The root at the edge limits the pressure's mean square to first order (measured 1.0)."""

    def error(contact):
        inside = contact.x < 1.2 * HALF_WIDTH
        miss = contact.pressure[inside] - EXACT.pressure(contact.x[inside])
        return np.sqrt(np.mean(miss**2)) / EXACT.peak_pressure

    coarse, middle, fine = (error(meshes[n]) for n in (5, 10, 20))
    assert np.log2(coarse / middle) > 0.9
    assert np.log2(middle / fine) > 0.9
    widths = [abs(meshes[n].half_width / EXACT.half_width - 1) for n in (5, 10, 20)]
    assert np.log2(widths[0] / widths[2]) / 2 > 1.5


def test_pressure_does_not_oscillate(meshes):
    """Hertz's pressure is concave: not one second difference is positive up to 0.9 a."""
    for contact in meshes.values():
        inside = contact.pressure[contact.x < 0.9 * HALF_WIDTH]
        assert (np.diff(inside, 2) < 0).all()


def test_contact_forces_carry_the_load(meshes):
    """The cylinder floats: its vertical balance is an exact equation, not a spring's."""
    for contact in meshes.values():
        solution = contact.solution
        (interface,) = solution.system.interfaces
        state = solution.loaded.state
        on_plane = state.contacts[0].normal @ interface.pairing(state.u).normal[1]
        assert on_plane[1::2].sum() == pytest.approx(-FORCE / 2, rel=1e-8)
        assert not solution.unloaded.state.contacts[0].normal.any()


@pytest.mark.parametrize("element", ["quad9", "quad4"])
def test_other_elements_give_the_same_contact(element):
    contact = press(20, element)
    assert contact.half_width == pytest.approx(EXACT.half_width, rel=2e-3)
    assert contact.peak == pytest.approx(EXACT.peak_pressure, rel=2e-3)


def test_it_does_not_matter_which_body_is_the_slave_nor_how_surfaces_are_paired(meshes):
    for other in (press(20, slave="plane"), press(20, sliding="finite")):
        assert other.half_width == pytest.approx(meshes[20].half_width, rel=2e-3)
        assert other.peak == pytest.approx(meshes[20].peak, rel=1e-3)


def test_contact_grows_with_the_root_of_the_load(meshes):
    """A quarter of the load, half the width and half the pressure: 10 elements then, 0.5 %."""
    quarter = press(20, load=0.25)
    assert quarter.half_width == pytest.approx(EXACT.half_width / 2, rel=5e-3)
    assert quarter.peak == pytest.approx(EXACT.peak_pressure / 2, rel=2e-3)
    assert (quarter.pressure[quarter.x > 0.6 * HALF_WIDTH] == 0).all()


def test_outer_dimensions_do_not_matter(monkeypatch):
    """Bodies twice as large move the half-width by (a / size)^2, 1e-4, at most."""
    small = press(10)
    monkeypatch.setitem(press.__globals__, "SIZE", 2 * SIZE)
    assert press(10).half_width == pytest.approx(small.half_width, rel=1e-3)
