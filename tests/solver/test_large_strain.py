"""The estimate of what small-strain theory leaves out, against closed forms of large strain."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from solver import (
    Body,
    ContactPair,
    Displacement,
    Link,
    Material,
    Model,
    Moved,
    PathControl,
    Pushed,
    RigidBody,
    Solution,
    Traction,
    solve,
)
from solver.audit.large_strain import _STIFF
from solver.audit.theory import LARGE
from solver.mesh import grid

pytestmark = pytest.mark.solves

E = 2e5
ELASTIC = Material(youngs_modulus=E, poisson_ratio=0.3)
STRAIGHT = Material(youngs_modulus=E, poisson_ratio=0.0)
YIELDS = Material(youngs_modulus=E, poisson_ratio=0.3, yield_stress=300.0,
                  hardening="isotropic", hardening_ratio=0.02)  # fmt: skip


def block(x: tuple[float, float], height: float, cells: tuple[int, int], **fields: Any) -> Body:
    mesh = grid(*(np.linspace(*at, n + 1) for at, n in zip((x, (0.0, height)), cells, strict=True)))
    return Body(**{"name": "bar", "mesh": mesh, "material": ELASTIC,
                   "kinematics": "plane_stress", **fields})  # fmt: skip


def solved(*bodies: Body, step: float = 1.0, **fields: Any) -> Solution:
    control = PathControl(load_step=step)
    return solve(Model(bodies=bodies, **fields), load=1.0, control=control)


def estimate(*bodies: Body, **options: Any) -> float:
    return solved(*bodies, **options).audit().figures["audit_large_strain"]


@pytest.mark.parametrize("kinematics", ["plane_stress", "plane_strain", "axisymmetric"])
@pytest.mark.parametrize("strain", [-0.05, 0.01, 0.05, 0.1, 0.3])
def test_a_bar_of_given_strain_errs_in_its_force(strain: float, kinematics: Any) -> None:
    """The force is E e, that of logarithmic strain and true stress E ln(1 + e) / (1 + e)."""
    bar = block((0.0, 1.0), 4.0, (2, 4), kinematics=kinematics,
                supports={"left": "x", "bottom": "y"},
                loads=(Displacement(boundary="top", y=4.0 * strain),))  # fmt: skip
    error = abs(strain * (1 + strain) / math.log1p(strain) - 1)
    assert estimate(bar) == pytest.approx(error, rel=0.15)


@pytest.mark.parametrize("force", [0.01, 0.05, 0.1])
def test_a_bar_of_given_force_errs_in_its_stress(force: float) -> None:
    """The true stress is E ln(r), where E ln(r) / r is the force."""
    bar = block((0.0, 4.0), 1.0, (4, 2), supports={"left": "x", "bottom": "y"},
                loads=(Traction(boundary="right", x=force * E),))  # fmt: skip
    stretch = brentq(lambda r: math.log(r) / r - force, 1.0, math.e)
    assert estimate(bar) == pytest.approx(math.log(stretch) / force - 1, rel=0.16)


def test_a_bar_that_flows_errs_in_its_force_as_its_area_shrinks() -> None:
    """And as logarithmic strain is less, in the stiffness that is left to points that flow."""
    perfect = Material(youngs_modulus=E, poisson_ratio=0.3, yield_stress=200.0)
    bar = block((0.0, 4.0), 1.0, (4, 2), material=perfect, supports={"left": "x", "bottom": "y"},
                loads=(Displacement(boundary="right", x=4.0 * 0.04),))  # fmt: skip
    left = _STIFF * E * (0.04 - math.log1p(0.04)) / 200.0
    assert estimate(bar, step=0.25) == pytest.approx(0.04 + left, rel=1e-5)


def elastica(ratio: float) -> float:
    """Return the deflection over the length of a cantilever, of P L^2 / (E I) by shooting."""

    def shot(bending: float) -> Any:
        ends = {"t_eval": [1.0], "rtol": 1e-10, "atol": 1e-12}
        begin = [0.0, bending, 0.0]
        return solve_ivp(lambda s, y: [y[1], -ratio * math.cos(y[0]), math.sin(y[0])],
                         (0.0, 1.0), begin, **ends).y[:, -1]  # fmt: skip

    return float(shot(brentq(lambda k: shot(k)[1], 0.0, 1.5 * ratio))[2])


def cantilever(ratio: float, height: float = 1.0, **fields: Any) -> Body:
    force = ratio * E * height**3 / 12 / 100.0**2
    return block((0.0, 100.0), height, (50, 2), supports={"left": "xy"},
                 loads=(Traction(boundary="right", y=-force / height),),
                 **{"material": STRAIGHT, **fields})  # fmt: skip


@pytest.mark.parametrize("ratio", [0.1, 0.5, 1.0, 3.0])
def test_a_cantilever_errs_in_its_deflection(ratio: float) -> None:
    """Its strain is 1.5 % at most; the elastica gives 60.3 mm for the ratio 3, a third 100 mm."""
    run = solved(cantilever(ratio))
    tip = -run.displacement("bar", "loaded")[1].min() / 100.0
    audit = run.audit()
    assert audit.figures["audit_large_strain"] == pytest.approx(tip / elastica(ratio) - 1, rel=0.06)
    assert bool(audit.outside) == (ratio >= 1.0)


def test_a_cantilever_of_two_halves_errs_as_the_whole() -> None:
    whole = cantilever(1.0)
    first = block((0.0, 50.0), 1.0, (25, 2), name="first", material=STRAIGHT,
                  supports={"left": "xy"})  # fmt: skip
    second = block((50.0, 100.0), 1.0, (25, 2), name="second", material=STRAIGHT, loads=whole.loads)
    tie = Link(slave=("second", "left"), master=("first", "right"))
    assert estimate(first, second, links=(tie,)) == pytest.approx(estimate(whole), rel=0.05)


def test_a_strip_held_at_both_ends_lacks_its_membrane_stress() -> None:
    """Deflected by w: membrane strain 2.438 (w / L)^2, rms of bending strain 4.131 w h / L^2."""
    deflection = 0.3
    load = deflection * 384.0 * E / 12 / 100.0**4
    strip = block((0.0, 100.0), 1.0, (50, 2), material=STRAIGHT,
                  supports={"left": "xy", "right": "xy"},
                  loads=(Traction(boundary="top", y=-load),))  # fmt: skip
    expected = 2.438 * deflection / 4.131
    assert estimate(strip) == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("condense", [True, False])
def test_a_soft_pad_on_a_soft_base_is_outside_theory(condense: bool) -> None:
    """Pressed by 15 % of its modulus; bodies reduced to their surfaces have the same estimate."""
    fields = {"material": Material(youngs_modulus=10.0, poisson_ratio=0.45),
              "kinematics": "plane_strain", "condense": condense}  # fmt: skip
    base = block((0.0, 10.0), 5.0, (10, 5), name="base", supports={"bottom": "xy"}, **fields)
    pad = block((3.0, 7.0), 3.0, (8, 4), name="pad", supports={"top": "x"},
                loads=(Traction(boundary="top", y=-1.5),), **fields)  # fmt: skip
    pad = replace(pad, mesh=pad.mesh.translated((0.0, 5.0)))
    touching = ContactPair(slave=("pad", "bottom"), master=("base", "top"), friction=0.3)
    model = Model(bodies=(base, pad), contacts=(touching,))
    audit = solve(model, load=1.0, control=PathControl(load_step=0.5)).audit()
    assert audit.figures["audit_large_strain"] == pytest.approx(0.116, rel=0.01)
    assert "would change the stress of pad by 12%" in audit.outside[0]


def test_a_plastic_hinge_may_turn_without_stress() -> None:
    """Turned by 0.1 rad, which stretches linear displacements by 0.5 %, three yield strains."""
    beam = block((0.0, 100.0), 10.0, (40, 6), material=YIELDS, supports={"left": "xy"},
                 loads=(Traction(boundary="right", y=-10.0),))  # fmt: skip
    run = solved(beam, step=0.2)
    assert run.displacement("bar", "loaded")[1].min() < -10.0
    assert run.audit().figures["audit_large_strain"] < 0.03


def test_bodies_may_move_as_a_whole() -> None:
    """Held by a support that moves by 500 mm, and stretched by 1 %."""
    loads = (Displacement(boundary="left", x=500.0, y=0.0), Traction(boundary="right", x=0.01 * E))
    bar = block((0.0, 4.0), 1.0, (4, 2), material=STRAIGHT, loads=loads)
    assert estimate(bar) == pytest.approx(0.01, rel=1e-3)
    assert LARGE > 0.01


def grip(angle: float, at: float = 0.0, name: str = "grip", x: Moved | Pushed | None = None) -> Any:
    return RigidBody(name=name, centre=(at, 0.5), x=x or Moved(), y=Moved(),
                     rotation=Moved(value=angle))  # fmt: skip


@pytest.mark.parametrize("angle", [0.007, 0.1])
@pytest.mark.parametrize(
    "others", [{}, {"stiffness": 1e5}, {"distributed": True}, {"master": ("base", "right")}]
)
def test_a_body_turned_by_links_lacks_nothing(others: dict[str, Any], angle: float) -> None:
    """The stretch of its linear displacements, 0.5 %, is no strain."""
    bar = block((0.0, 4.0), 1.0, (8, 2))
    base = block((-1.0, 0.0), 1.0, (2, 2), name="base", supports={"left": "xy"})
    held = Link(slave=("bar", "left"), rigid="grip", **others)
    assert estimate(bar, base, links=(held,), rigid=(grip(angle),)) < 1e-8


def test_a_turned_bar_bends_under_a_force_that_does_not_turn() -> None:
    """Axial force P, moment P w x at x from the free end: energies 1 to w^2 L^2 A / (3 I)."""
    angle = 0.03
    bar = block((0.0, 4.0), 1.0, (8, 2), loads=(Traction(boundary="right", x=1e-3 * E),))
    held = Link(slave=("bar", "left"), rigid="grip")
    found = estimate(bar, links=(held,), rigid=(grip(angle),), step=0.25)
    assert found == pytest.approx(math.sqrt(angle**2 * 4.0**2 * 12 / 3), rel=0.03)


@pytest.mark.parametrize("free", [True, False])
def test_a_beam_bent_by_its_grips_lacks_the_shortening_of_its_chord(free: bool) -> None:
    """Turned by -a and a: arc over chord 1 + a^2 / 6, rms of bending strain a h / (sqrt(3) L)."""
    turn = 0.03
    beam = block((0.0, 10.0), 1.0, (40, 4), material=STRAIGHT)
    ends = grip(-turn), grip(turn, 10.0, "end", Pushed() if free else None)
    links = tuple(Link(slave=("bar", side), rigid=name)
                  for side, name in (("left", "grip"), ("right", "end")))  # fmt: skip
    found = estimate(beam, links=links, rigid=ends)
    if free:
        assert found < turn / 5, "of the size of its strain, 0.3 %"
    else:
        assert found == pytest.approx(turn * 10.0 * math.sqrt(3) / 6, rel=0.015)
