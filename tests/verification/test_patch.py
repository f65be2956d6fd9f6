"""Patch tests: a uniform stress passes contact between meshes that do not match."""

from __future__ import annotations

import numpy as np
import pytest

from solver import ContactPair, Model, solve
from solver.mesh import grid, mapped
from solver.mesh.elements import known_elements
from solver.tensors import to_tensor
from tests.verification.bodies import NU, E, block, cells, steel

P = 100.0
ROUNDING = 1e-10
"""Of the pressure: condition number of the stiffness (1e4) times machine precision, and room."""

SLAVE = np.linspace(0.0, 10.0, 11)
MASTER = np.append(np.arange(14) * 0.7, 10.0)  # edges of 0.7, the last 0.9


def two_blocks(
    element="quad8", state="plane_strain", sliding="small", friction=0.0, finer=False, condense=True
):
    x_slave, x_master = (MASTER, SLAVE) if finer else (SLAVE, MASTER)
    upper = block(
        "upper",
        x_slave,
        np.linspace(0.0, 4.0, 4),
        element,
        kinematics=state,
        supports={"left": "x"},
        pressure={"top": P},
        condense=condense,
    )
    lower = block(
        "lower",
        x_master,
        np.linspace(-5.0, 0.0, 5),
        element,
        kinematics=state,
        supports={"left": "x", "bottom": "y"},
        condense=condense,
    )
    pair = ContactPair(
        slave=("upper", "bottom"), master=("lower", "top"), friction=friction, sliding=sliding
    )
    return Model(bodies=(upper, lower), contacts=(pair,))


def stress_error(solution, exact):
    """Largest deviation from a uniform stress (4,) in both bodies over the pressure."""
    return max(
        np.abs(
            to_tensor(solution.system.state(name, solution.loaded).stress)
            - np.asarray(exact)[:, None]
        ).max()
        / P
        for name in ("upper", "lower")
    )


@pytest.mark.parametrize("element", known_elements(2))
@pytest.mark.parametrize("state", ["plane_strain", "plane_stress", "axisymmetric"])
@pytest.mark.parametrize("finer", [False, True], ids=["coarse_slave", "fine_slave"])
@pytest.mark.parametrize("condense", [False, True], ids=["meshed", "condensed"])
def test_uniform_pressure_passes_non_matching_meshes(element, state, finer, condense):
    solution = solve(two_blocks(element, state, finer=finer, condense=condense))
    acting = solution.contact()
    pressure, shear = acting.pressure, acting.shear
    assert pressure == pytest.approx(np.full_like(pressure, P), rel=ROUNDING)
    assert not shear.any()
    lateral = -NU * P if state == "plane_strain" else 0.0
    assert stress_error(solution, [0.0, -P, lateral, 0.0]) < ROUNDING


@pytest.mark.parametrize("element", known_elements(2))
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_uniform_pressure_passes_when_the_surfaces_are_paired_anew(element, friction):
    solution = solve(two_blocks(element, sliding="finite", friction=friction))
    acting = solution.contact()
    pressure, shear = acting.pressure_deformed, acting.shear
    # the load is P on the area before loading, which plane strain stretches
    stretch = 1 + NU * (1 + NU) * P / E
    assert pressure == pytest.approx(np.full_like(pressure, P / stretch), rel=ROUNDING)
    assert np.abs(shear).max() < ROUNDING * P
    assert stress_error(solution, [0.0, -P, -NU * P, 0.0]) < ROUNDING


SLOPE = 0.3


def on_a_slope(element, friction, pressure):
    """A square of side 10 cut along a line of slope 0.3; rollers left and below."""

    def model_part(name, x, below, fields):
        mesh = grid(x, np.linspace(0.0, 1.0, 5), cells(element))

        def shear(p):
            cut = 4.0 + SLOPE * p[0]
            low, high = (np.zeros_like(cut), cut) if below else (cut, np.full_like(cut, 10.0))
            return np.stack([p[0], low + p[1] * (high - low)])

        if cells(element) == "quad":
            mesh = mapped(mesh, shear)
        else:
            mesh = type(mesh)(shear(mesh.p), mesh.t).with_boundaries(mesh.boundaries)
        body = block(name, np.array([0.0, 1.0]), np.array([0.0, 1.0]), element)
        return type(body)(name=name, mesh=mesh, element=element, material=steel(), **fields)

    upper = model_part("upper", SLAVE, False, {"supports": {"left": "x"}, "pressure": pressure})
    side = {k: v for k, v in pressure.items() if k == "right"}
    lower = model_part(
        "lower", MASTER, True, {"supports": {"left": "x", "bottom": "y"}, "pressure": side}
    )
    pair = ContactPair(slave=("upper", "bottom"), master=("lower", "top"), friction=friction)
    return Model(bodies=(upper, lower), contacts=(pair,))


@pytest.mark.parametrize("element", known_elements(2))
def test_equal_pressure_from_all_sides_passes_an_inclined_contact_without_friction(element):
    solution = solve(on_a_slope(element, 0.0, {"top": P, "right": P}))
    pressure = solution.contact().pressure
    assert pressure == pytest.approx(np.full_like(pressure, P), rel=ROUNDING)
    assert stress_error(solution, [-P, -P, -2 * NU * P, 0.0]) < ROUNDING


@pytest.mark.parametrize("element", known_elements(2))
def test_uniaxial_stress_passes_an_inclined_contact_that_sticks(element):
    """Stick needs friction above the slope: shear / pressure = tan(angle) = 0.3."""
    solution = solve(on_a_slope(element, 0.31, {"top": P}))
    acting = solution.contact()
    pressure, shear = acting.pressure, acting.shear
    cosine2 = 1 / (1 + SLOPE**2)
    assert pressure == pytest.approx(np.full_like(pressure, P * cosine2), rel=ROUNDING)
    assert np.abs(shear) == pytest.approx(np.full_like(shear, P * SLOPE * cosine2), rel=ROUNDING)
    assert stress_error(solution, [0.0, -P, -NU * P, 0.0]) < ROUNDING


def test_an_inclined_contact_below_the_slope_of_friction_does_not_stay_uniform():
    """The oracle above can fail: with friction 0.1 the same contact slips."""
    solution = solve(on_a_slope("quad8", 0.1, {"top": P}))
    acting = solution.contact()
    pressure, shear = acting.pressure, acting.shear
    assert np.abs(shear).max() <= 0.1 * pressure.max() * (1 + 1e-6)
    assert stress_error(solution, [0.0, -P, -NU * P, 0.0]) > 0.01
