"""Rolling of a pair that does not yield: Hertz, Carter, and dissimilar materials.

Shear is the traction on the half-space along +x, the way the wheel goes; a braked wheel drags the
half-space along (positive), its creepage is positive: it turns less than it advances.

Half-planes stand for the bodies in all of these theories: the contact has to be small against
the wheel. Where that shows, the wheel is pressed lightly.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from math import pi, sqrt

import numpy as np
import pytest

from solver import SCENES, Status
from solver.rolling.scenes.rolling import RollingParameters
from tests.verification.closed_forms import HertzLine, carter_creepage

YIELD, MODULUS, PEAK = 1e6, 2e5, 1360.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Rolled:
    """The end of the track: pressure and shear at x / a, creepage, longitudinal force."""

    parameters: RollingParameters
    x: np.ndarray
    pressure: np.ndarray
    shear: np.ndarray
    creepage: float
    force: float

    def mean_difference(self, values, exact):
        """Return the mean |values - exact| over the contact."""
        return np.abs(values - exact)[np.abs(self.x) < 1].mean()


_STEADY = 6.4
"""Half-widths after which nothing is left of the shear with which dissimilar bodies are pressed."""


@cache
def rolled(steps, *, per_half_width=5, widths=3.2, stiffness=1.0, **fields):
    """Roll over ``widths`` half-widths a in increments of a / ``steps``.

    A given ratio ``stiffness`` of the wheel's modulus to the half-space's leaves E*, so a and p0.
    """
    fields = {
        "yield_stress": YIELD,
        "load_ratio": PEAK / YIELD,
        "youngs_modulus": MODULUS * (1 + 1 / stiffness) / 2,
        "wheel_stiffness": stiffness,
        "growth": 1.6,
        "press_steps": 2,
        "unload_steps": 1,
    } | fields
    a = RollingParameters(**fields).half_width
    parameters = RollingParameters(
        # vertices on multiples of it: the mesh is the same under the wheel at mid-track and end
        element_size=a / per_half_width * (1 + 1e-9),
        advance_step=a / steps,
        track=a * widths,
        **fields,
    )
    (record,) = SCENES["rolling"].path(parameters, [1], lambda share: None)
    assert record.status is Status.OK, record.message
    assert record.scalars["max_plastic_strain"] == 0.0
    at = list(record.coordinates["stage"]).index("loaded")
    pressure, shear = (
        np.nan_to_num(record.fields[f"contact_{name}"][1][at]) for name in ("pressure", "shear")
    )
    assert (np.abs(shear) <= parameters.friction * pressure * (1 + 1e-6) + 1e-6).all()
    return Rolled(
        parameters=parameters,
        x=record.coordinates["s"] / a,
        pressure=pressure,
        shear=shear,
        creepage=record.scalars["creepage"],
        force=record.scalars["longitudinal_force"],
    )


# -- Hertz -------------------------------------------------------------------------------------


def pressed(traction):
    """A pressure needs no long track, and a locked wheel slides at once."""
    return rolled(16, per_half_width=8, widths=0.75, traction=traction)


@pytest.mark.parametrize("traction", [0.0, 1.0])
def test_pressure_is_hertz_rolling_freely_and_sliding(traction):
    run = pressed(traction)
    p = run.parameters
    hertz = HertzLine(force=p.force, radius=p.radius, modulus=p.contact_modulus)
    assert run.pressure.max() == pytest.approx(PEAK, rel=0.01)
    # half-width from the zero of a line fitted to p^2 over x^2, elements of a/8
    inside = (np.abs(run.x) < 0.8) & (np.abs(run.x) > 0.3)
    slope, height = np.polyfit(run.x[inside] ** 2, run.pressure[inside] ** 2, 1)
    assert np.sqrt(-height / slope) == pytest.approx(1.0, rel=0.015)
    exact = hertz.pressure(run.x * hertz.half_width)
    assert run.mean_difference(run.pressure, exact) < 0.025 * PEAK


def test_free_rolling_of_equal_bodies_carries_no_shear():
    run = pressed(0.0)
    assert np.abs(run.shear).max() < 0.005 * PEAK
    assert abs(run.force) < 1e-4 * run.parameters.force


def test_locked_wheel_drags_the_half_space_along_with_all_friction_everywhere():
    run = pressed(1.0)
    # but at the leading edge, where what has come down unforeseen carries no shear at first
    down = run.x < 0.85
    assert run.shear[down] == pytest.approx(0.3 * run.pressure[down], rel=1e-6)
    assert (run.shear >= -1e-6 * PEAK).all()
    assert run.force == pytest.approx(0.3 * run.parameters.force, rel=0.01)


# -- Carter ------------------------------------------------------------------------------------


def carter_shear(x, share):
    """Return shear / (mu p0) at force ``share`` mu P; it sticks over 2 b from the leading edge on.

    F.W. Carter, Proc. R. Soc. A 112 (1926) 151; K.L. Johnson, Contact Mechanics (1985), 8.3.
    """
    b = sqrt(1 - share)
    stick = np.maximum(0.0, 1 - ((x - (1 - b)) / b) ** 2)
    return np.sqrt(np.maximum(0.0, 1 - x**2)) - b * np.sqrt(stick)


def creepage_of(p, share):
    """Return Carter's creepage for the parameters of a run."""
    return carter_creepage(p.friction, p.half_width, p.radius, share)


DRIVEN = [0.25, 0.75, -0.5]


@pytest.mark.parametrize("traction", DRIVEN)
def test_moment_makes_the_longitudinal_force_it_is_meant_to(traction):
    run = rolled(4, traction=traction)
    expected = traction * run.parameters.friction * run.parameters.force
    # the lever arm is R less the approach of the bodies, 0.1 % of R
    assert run.force == pytest.approx(expected, rel=5e-3)


@pytest.mark.parametrize("traction", DRIVEN)
def test_shear_of_equal_rollers_is_carters(traction):
    run = rolled(4, traction=traction)
    limit = run.parameters.friction * PEAK
    exact = np.sign(traction) * limit * carter_shear(run.x, abs(traction))
    assert run.mean_difference(run.shear, exact) < 0.045 * limit


@pytest.mark.parametrize("traction", DRIVEN)
def test_stick_zone_of_equal_rollers_is_carters_and_at_the_leading_edge(traction):
    run = rolled(4, traction=traction)
    sticks = np.abs(run.shear) < 0.97 * run.parameters.friction * run.pressure
    inside = np.abs(run.x) < 0.95
    trailing_end = run.x[inside & sticks].min()
    assert sticks[inside & (run.x > trailing_end)].all()
    # elements of a/5, shear linear in between
    assert trailing_end == pytest.approx(1 - 2 * sqrt(1 - abs(traction)), abs=0.25)


@pytest.mark.parametrize("traction", DRIVEN)
def test_creepage_of_equal_rollers_is_carters_beyond_free_rolling(traction):
    free, driven = (rolled(4, traction=t) for t in (0.0, traction))
    exact = np.sign(traction) * creepage_of(free.parameters, abs(traction))
    assert driven.creepage - free.creepage == pytest.approx(exact, rel=0.02)


@pytest.mark.long
def test_given_creepage_makes_carters_force():
    free = rolled(4)
    wanted = float(free.creepage + creepage_of(free.parameters, 0.5))
    # force grows as the track that was rolled, over about 6 a, until creepage takes no more of it
    run = rolled(2, widths=20, control="creepage", given_creepage=wanted)
    assert run.creepage == pytest.approx(wanted, rel=1e-9)
    p = run.parameters
    force = np.trapezoid(run.shear, run.x * p.half_width)
    assert force == pytest.approx(0.5 * p.friction * p.force, rel=0.03)


# -- dissimilar materials ----------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class Stuck:
    """Free rolling of dissimilar cylinders without slip, normal and shear traction coupled.

    On half-planes, with (Hf)(x) the principal value of the integral of f(s) / pi (x - s),
    steady rolling asks of pressure p and shear q of the track, in contact,

        H p + beta q = E* x / 2R,   H q - beta p = E* creepage / 2.

    Its solution that is zero at both edges is

        p + i q = p0 sqrt(1 - x^2/a^2) exp(-i theta ln((a + x) / (a - x)))
        theta = ln((1 + beta) / (1 - beta)) / 2 pi,   creepage = -2 theta a / R,

    with no resultant of q. To first order in beta the creepage is -2 beta a / (pi R) and
    q = -(beta p0 / pi) sqrt(1 - x^2/a^2) ln((a + x) / (a - x)), the no-slip limit of R.H. Bentall
    and K.L. Johnson, Int. J. Mech. Sci. 9 (1967) 389; K.L. Johnson, Contact Mechanics (1985), 8.2.
    A positive ``beta`` means that the wheel is the one that pressure shortens more.
    """

    beta: float

    @classmethod
    def of(cls, parameters):
        """Return the solution with Dundurs' beta of wheel and track in plane strain."""
        nu, k = parameters.poisson_ratio, parameters.wheel_stiffness
        return cls(beta=(1 - 2 * nu) / (2 * (1 - nu)) * (1 - k) / (1 + k))

    @property
    def theta(self):
        """Exponent of the oscillation."""
        return np.log((1 + self.beta) / (1 - self.beta)) / (2 * pi)

    def tractions(self, x):
        """Return (p + i q) 2 R / (E* a) at x / a."""
        angle = self.theta * np.log((1 + x) / (1 - x))
        return np.sqrt((1 - x**2) / (1 - self.beta**2)) * np.exp(-1j * angle)

    def shear(self, x):
        """Return q / p0, zero outside; the force changes a and p0 by theta^2 only."""
        inside = np.abs(x) < 1
        return np.where(inside, self.tractions(np.where(inside, x, 0.0)).imag, 0.0)

    def creepage(self, parameters):
        """Return the creepage, positive where a wheel turns less than it advances."""
        return -2 * self.theta * parameters.half_width / parameters.radius


def test_no_slip_solution_satisfies_its_integral_equations():
    stuck, n = Stuck(beta=0.4), 4000
    s, x = (np.cos(pi * (np.arange(n) + shift) / n) for shift in (0.5, 1.0))
    x = x[np.abs(x) < 0.9]
    weight = np.sqrt(1 - s**2) * pi / n
    F = stuck.tractions(s)
    H = (F * weight / (x[:, None] - s)).sum(axis=1) / pi
    here = stuck.tractions(x)
    # in units of E* a / 2R; trapezoids in the angle, poor at the edges only
    assert H.real + stuck.beta * here.imag == pytest.approx(x, abs=1e-3)
    assert H.imag - stuck.beta * here.real + 2 * stuck.theta == pytest.approx(0 * x, abs=1e-3)
    assert abs((F.imag * weight).sum()) < 1e-10


def creepage_ratio(stiffness, lightly):
    """Return the free creepage of a part of the usual load / that of Bentall and Johnson."""
    load = lightly * PEAK / YIELD
    run = rolled(10, stiffness=stiffness, friction=0.9, load_ratio=load, widths=_STEADY)
    return run.creepage / Stuck.of(run.parameters).creepage(run.parameters)


@pytest.mark.parametrize("stiffness", [pytest.param(1 / 3, marks=pytest.mark.long), 9.0])
def test_free_creepage_of_dissimilar_rollers_is_bentall_and_johnsons(stiffness):
    # a / R is 0.6 %: what is left is about 1.5 a / R, and half a per cent of mesh
    assert creepage_ratio(stiffness, 1 / 4) == pytest.approx(1.0, rel=0.025)


def test_free_creepage_tends_to_that_of_half_planes_with_the_load():
    assert creepage_ratio(9.0, 1 / 2) < creepage_ratio(9.0, 1 / 4) < 1


@pytest.mark.parametrize(("stiffness", "widths"), [(1 / 3, 3.2), (3.0, _STEADY)])
def test_shear_of_dissimilar_rollers_has_no_resultant_and_the_sign_of_minus_beta(stiffness, widths):
    """The stiffer wheel holds the track back from shortening: outward shear on the track.

    The wheel that pressure shortens more turns more: negative creepage of a soft wheel.
    """
    run = rolled(7, stiffness=stiffness, widths=widths)
    assert np.sign(run.creepage) == np.sign(stiffness - 1)
    assert abs(run.force) < 1e-4 * run.parameters.force
    exact = PEAK * Stuck.of(run.parameters).shear(run.x)
    for side in (-1, 1):
        flank = (side * run.x > 0.4) & (side * run.x < 0.9)
        assert run.shear[flank].mean() == pytest.approx(exact[flank].mean(), rel=0.15)
        assert (np.sign(run.shear[flank]) == side * np.sign(stiffness - 1)).all()


def test_shear_of_dissimilar_rollers_does_not_depend_on_ample_friction():
    each = ({}, {"friction": 0.9})  # 0.3 by default, a run that another test shares
    some, ample = (rolled(7, stiffness=3.0, widths=_STEADY, **own) for own in each)
    inside = np.abs(some.x) < 0.9
    assert ample.shear[inside] == pytest.approx(some.shear[inside], abs=0.002 * PEAK)
    assert ample.creepage == pytest.approx(some.creepage, rel=0.01)


def test_little_friction_of_dissimilar_rollers_raises_creepage_and_slips_three_ways():
    """Without friction slip is as creepage + 2 beta p / E*: the middle against the edges.

    No resultant asks for half the force in each, so for the middle |x| < 0.404 a, and the
    creepage is -beta a / R sqrt(1 - 0.404^2), 1.44 times that without slip. The little friction
    and elements of a/8 take some of it.
    """
    run = rolled(8, per_half_width=8, widths=2.5, stiffness=3.0, friction=0.002)
    p = run.parameters
    limit = -Stuck.of(p).beta * p.half_width / p.radius * sqrt(1 - 0.404**2)
    assert run.creepage == pytest.approx(limit, rel=0.06)
    for sign, low, high in ((1, -0.9, -0.75), (-1, -0.2, 0.0), (1, 0.5, 0.6)):
        zone = (run.x > low) & (run.x < high)
        assert run.shear[zone] == pytest.approx(sign * 0.002 * run.pressure[zone], rel=0.05)


def test_incompressible_bodies_carry_no_shear_whatever_their_moduli():
    run = rolled(5, stiffness=3.0, widths=1.2, poisson_ratio=0.4999)
    # noise of elements that are nearly incompressible, as much with equal moduli
    compressible = PEAK * Stuck.of(replace(run.parameters, poisson_ratio=0.3)).shear(run.x)
    assert np.abs(run.shear).sum() < 0.2 * np.abs(compressible).sum()
