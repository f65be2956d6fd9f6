"""Thick tubes and spheres that expand far: closed forms of rigid-plastic bodies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq, minimize_scalar

from solver import Body, Displacement, Material, Model, PathControl, Pressure, Solution, solve
from solver.fem.nodes import vectors
from solver.materials import ArmstrongFrederick, Chaboche, Elasticity, TrescaMaterial, Voce
from solver.mesh import grid

pytestmark = pytest.mark.solves

E, YIELD, OUTER = 2e6, 200.0, 2.0
NEARLY = {"youngs_modulus": E, "poisson_ratio": 0.4999, "yield_stress": YIELD}
ELASTIC = Elasticity(youngs_modulus=E, poisson_ratio=0.4999)
HARD = Material(**NEARLY, hardening="isotropic", hardening_ratio=0.0003)  # type: ignore[arg-type]


def pressure(bore: float, flow: Callable[[float], float], dim: int) -> float:
    """Pressure in a tube (2) or sphere (3) of radii 1 and 2 whose bore has grown [MPa].

    Equilibrium and no change of volume: p is the integral of 2 k / r, with ``k = flow / sqrt(3)``
    in a tube and ``flow`` in a sphere, at the strain ``ln(r / R)`` times 2 / sqrt(3), or 2.
    """
    grown = bore**dim - 1.0
    share = 2 / np.sqrt(3) if dim == 2 else 2.0

    def each(r: float) -> float:
        return share * flow(share * np.log(r / (r**dim - grown) ** (1 / dim))) / r

    return float(quad(each, bore, (OUTER**dim + grown) ** (1 / dim))[0])


def solved(material: Any, dim: int, step: float, **load: Any) -> Solution:
    """A tube, or a quarter of a sphere, of large strain."""
    mesh = grid(np.linspace(1.0, OUTER, 13), np.linspace(0.0, 0.1, 2))
    held = {"bottom": "y", "top": "y"}
    if dim == 3:
        flat = grid(np.linspace(1.0, OUTER, 7), np.linspace(0.0, np.pi / 2, 13))
        r, angle = flat.p
        mesh = replace(flat, doflocs=np.array([r * np.cos(angle), r * np.sin(angle)]))
        held = {"bottom": "y", "top": "x"}
    body = Body(name="b", mesh=mesh, material=material, kinematics="axisymmetric",
                element="quad8", strain="large", supports=held, **load)  # type: ignore[arg-type]  # fmt: skip
    found = solve(Model(bodies=(body,)), load=1.0, control=PathControl(load_step=step))
    audit = found.audit()
    assert not audit.violations
    assert not audit.outside
    return found


LAWS = {
    "tresca": (TrescaMaterial(elasticity=ELASTIC, curve=Voce(yield_stress=YIELD)),
               lambda strain: YIELD * np.sqrt(3) / 2, 2e-3),
    "voce": (Chaboche(elasticity=ELASTIC,
                      curve=Voce(yield_stress=YIELD, saturation=100.0, rate=5.0)),
             lambda strain: YIELD + 100.0 * (1 - np.exp(-5.0 * strain)), 1e-3),
    "armstrong": (Chaboche(elasticity=ELASTIC, curve=Voce(yield_stress=YIELD),
                           back_stresses=(ArmstrongFrederick(modulus=600.0, recall=4.0),)),
                  lambda strain: YIELD + 150.0 * (1 - np.exp(-4.0 * strain)), 1e-3),
}  # fmt: skip


@pytest.mark.parametrize("law", LAWS)
def test_a_tube_whose_bore_is_doubled_has_the_pressure_of_its_law(law: str) -> None:
    material, flow, within = LAWS[law]
    found = solved(material, 2, 0.05, loads=(Displacement(boundary="left", x=1.0),))
    part = found.system.full("b")
    force = vectors(found.loaded.forces[0], 2)[0, part.boundary_nodes("left")].sum()
    assert force / (2 * np.pi * 2.0 * 0.1) == pytest.approx(pressure(2.0, flow, 2), rel=within)


@pytest.mark.parametrize("dim", [2, 3], ids=["tube", "sphere"])
def test_a_pressure_that_follows_expands_a_thick_body_near_to_its_limit(dim: int) -> None:
    """At 98 % of the largest pressure the bore is that of the closed form."""

    def flow(strain: float) -> float:
        return YIELD + 0.0003 * E * strain

    most = minimize_scalar(lambda a: -pressure(a, flow, dim), bounds=(1.0, 4.0), method="bounded")
    push = 0.98 * -most.fun
    expected = brentq(lambda a: pressure(a, flow, dim) - push, 1.0, most.x)
    found = solved(HARD, dim, 0.1, loads=(Pressure(boundary="left", value=push),))
    nodes = found.nodes("b")
    inner = np.abs((np.hypot(*nodes) if dim == 3 else nodes[0]) - 1.0) < 1e-9
    moved = (nodes + found.displacement("b", "loaded"))[:, inner]
    bore = (np.hypot(*moved) if dim == 3 else moved[0]).mean()
    assert expected > 1.1
    assert pressure(bore, flow, dim) == pytest.approx(push, rel=1e-3)
