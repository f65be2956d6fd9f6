"""Two cylinders pressed together, then pushed sideways to and fro, against Cattaneo and Mindlin."""

from __future__ import annotations

import numpy as np
import pytest

from solver import Amplitude, Body, ContactPair, Displacement, Material, Model, Stage, solve
from solver.mesh import graded, grid
from solver.results.acting import of_pair
from solver.results.contact import stick_half_width
from tests.reference.cattaneo import SlidingCylinders
from tests.verification.bodies import NU, E, bent, cells
from tests.verification.closed_forms import plane_strain_modulus

SIZE, FRICTION, PER_HALF_WIDTH = 40.0, 0.3, 40
"""Width and height of both cylinders, half their radii [mm]; the half-width is about 1."""
MODULUS = plane_strain_modulus(E, NU) / 2
LITTLE, MUCH, BACK = "little", "much", "back"


@pytest.fixture(scope="module")
def solution():
    """Return the solution: approach in 2 increments, then a push and a smaller one back.

    Motions of the upper cylinder's flat side are given, for its forces would turn it.
    """
    h, growth = 1.0 / PER_HALF_WIDTH, 1.25
    fine = np.linspace(0.0, 1.2, round(1.2 * PER_HALF_WIDTH) + 1)
    half = np.concatenate([fine, fine[-1] + graded(SIZE / 2 - fine[-1], h, growth, SIZE / 8)[1:]])
    x, y = np.concatenate([-half[:0:-1], half]), graded(SIZE, h, growth, SIZE / 8)

    def bulge(p):
        profile = p[0] ** 2 / (4 * SIZE)  # two such cylinders have the relative radius SIZE
        return np.stack([p[0], profile + p[1] * (SIZE - profile) / SIZE])

    material = Material(youngs_modulus=E, poisson_ratio=NU)
    down = Displacement(boundary="top", y=-0.0708, amplitude=Amplitude([0, 1], [0, 1]))
    aside = Displacement(boundary="top", x=0.04, amplitude=Amplitude([1, 2, 3], [0, 1, 0]))
    upper = Body(name="upper", mesh=bent(grid(x, y, cells("quad4")), bulge), material=material,
                 loads=(down, aside))  # fmt: skip
    lower = Body(name="lower", mesh=bent(grid(x, -y[::-1], cells("quad4")), lambda p: -bulge(-p)),
                 material=material, supports={"bottom": "xy"})  # fmt: skip
    # small sliding would count some of the approach as slip: its normals are those before loading
    pair = ContactPair(slave=("upper", "bottom"), master=("lower", "top"), friction=FRICTION,
                       sliding="finite")  # fmt: skip
    stages = (Stage(name="pressed", target=1.0, steps=2),
              Stage(name=LITTLE, target=1.5, steps=3), Stage(name=MUCH, target=2.0, steps=3),
              Stage(name=BACK, target=3.0, steps=6))  # fmt: skip
    return solve(Model(bodies=(upper, lower), contacts=(pair,)), stages=stages)


def forces(solution, stage):
    """Return normal and tangential force, the latter positive forth [N]."""
    contact = solution.stages[stage].state.contacts[0]
    return contact.normal.sum(), contact.tangential.sum()


def exact(solution, stage):
    force, _ = forces(solution, stage)
    return SlidingCylinders(force=force, radius=SIZE, modulus=MODULUS, friction=FRICTION)


def miss(found, wanted, x):
    """Return the area between two curves / area under the second."""
    return np.trapezoid(np.abs(found - wanted), x) / np.trapezoid(np.abs(wanted), x)


@pytest.mark.parametrize("stage", ["pressed", LITTLE, MUCH, BACK])
def test_the_push_leaves_the_pressure_of_hertz(solution, stage):
    acting = solution.contact(0, stage)
    x, pressure = acting.X[0], acting.pressure
    assert miss(pressure, exact(solution, stage).pressure(x), x) < 0.01
    assert solution.audit(stage).passed, solution.audit(stage).violations


@pytest.mark.parametrize("stage", [LITTLE, MUCH])
def test_what_sticks_is_as_wide_as_by_cattaneo_and_mindlin(solution, stage):
    acting = of_pair(solution.system, solution.stages[stage], symmetric=False)
    found = stick_half_width(acting.points, symmetric=False)
    _, push = forces(solution, stage)
    assert found == pytest.approx(exact(solution, stage).stick_width(push), rel=0.02)


def test_shear_is_that_of_cattaneo_forth_and_of_mindlin_back(solution):
    (_, much), (_, back) = forces(solution, MUCH), forces(solution, BACK)
    for stage in (LITTLE, MUCH, BACK):
        acting = solution.contact(0, stage)
        x, found = acting.X[0], -acting.shear  # on the slave
        curve, (_, push) = exact(solution, stage), forces(solution, stage)
        wanted = curve.shear(x, push) if stage != BACK else curve.reversed_shear(x, back, much)
        assert miss(found, wanted, x) < 0.03, stage
