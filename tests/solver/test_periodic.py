"""Bodies that repeat themselves along x."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver import Body, ContactPair, Material, Model, ModelError, solve
from solver.fem.discretisation import Discretisation
from solver.fem.surface import extract
from solver.mesh import grid
from solver.model.amplitude import Amplitude
from solver.model.motion import TravellingPressure

STEEL = Material(youngs_modulus=2e5, poisson_ratio=0.3)


def strip(element="quad8", **fields):
    """Two and a half high, four long, on unequal columns, held at the bottom."""
    known = {
        "name": "strip",
        "mesh": grid(np.array([0.0, 0.7, 1.9, 3.1, 4.0]), np.array([-2.5, -1.0, -0.3, 0.0])),
        "material": STEEL,
        "element": element,
        "supports": {"bottom": "xy"},
        "pressure": {"top": 100.0},
        "periodic": ("left", "right"),
        "condense": False,
    }
    return Body(**(known | fields))


@pytest.mark.solves
@pytest.mark.parametrize("element", ["quad4", "quad8", "quad9"])
def test_uniform_pressure_strains_a_periodic_strip_in_one_direction(element):
    solution = solve(Model(bodies=(strip(element),)))
    exact = 100.0 * 2.5 * (1 - 0.3 - 2 * 0.3**2) / (2e5 * (1 - 0.3))
    _, y = solution.nodes("strip")
    u = solution.displacement("strip", "loaded")
    assert u[1][y == 0] == pytest.approx(-exact, rel=1e-9)
    assert np.abs(u[0]).max() < 1e-9 * exact
    stress = solution.stress("strip", "loaded")
    assert stress[1] == pytest.approx(-100.0, rel=1e-9)
    assert stress[0] == pytest.approx(-100.0 * 0.3 / 0.7, rel=1e-9)


@pytest.mark.solves
def test_both_sides_of_the_seam_move_alike():
    part = Discretisation(strip())
    u = solve(Model(bodies=(strip(pressure={"top": 1.0}),))).displacement("strip", "loaded")
    for near in part.boundary_nodes("left"):
        far = np.abs(part.X.T - part.X[:, near] - [4.0, 0.0]).sum(axis=1).argmin()
        assert (u[:, far] == u[:, near]).all()


def test_contact_surface_goes_on_for_half_a_period_at_either_end():
    chain = extract(Discretisation(strip()), "top")
    x = chain.X[0, chain.vertices]
    assert np.abs(np.diff(np.sort(x))).max() < 1.3
    assert x.min() < -1.9
    assert x.max() > 5.8
    assert (chain.X[1] == 0).all()


@pytest.mark.parametrize(
    ("fields", "field"),
    [
        ({"periodic": ("left",)}, "periodic"),
        ({"periodic": "left"}, "periodic"),
        ({"periodic": ("left", "nowhere")}, "periodic"),
        ({"periodic": ("right", "left")}, "periodic"),
        ({"periodic": ("left", "top"), "pressure": {}}, "periodic"),
        ({"kinematics": "axisymmetric"}, "periodic"),
        ({"supports": {"bottom": "xy", "left": "x"}}, "supports.left"),
        ({"pressure": {"right": 1.0}}, "pressure.right"),
    ],
)
def test_what_cannot_repeat_itself_is_refused(fields, field):
    with pytest.raises(ModelError) as caught:
        _ = Discretisation(strip(**fields))
    assert caught.value.field == field


def test_a_travelling_pressure_wider_than_the_period_is_refused():
    none = Amplitude(np.zeros(1), np.zeros(1))
    load = TravellingPressure(
        boundary="top", half_width=2.5, peak=1.0, amplitude=none, position=none,
        shear_ratio=none,
    )  # fmt: skip
    with pytest.raises(ModelError, match="travelling"):
        _ = Discretisation(strip(pressure={}, travelling=load))


def test_a_contact_surface_across_the_period_is_refused():
    mesh = strip().mesh
    patch = mesh.with_boundaries({"patch": lambda x: (x[1] == 0) & (x[0] > 0.7) & (x[0] < 3.1)})
    with pytest.raises(ModelError, match="whole period"):
        extract(Discretisation(strip(mesh=patch)), "patch")


@pytest.mark.solves
@pytest.mark.parametrize("solver", ["auto", "superlu"])
def test_a_surface_that_supports_hold_bears_contact(solver):
    """A rigid die: all unknowns of its contact surface are held."""
    die = Body(
        name="die",
        mesh=grid(np.linspace(0.0, 4.0, 5), np.linspace(-1.0, 0.0, 3)),
        material=STEEL,
        supports={"top": "xy", "bottom": "xy"},
        condense=False,
    )
    block = Body(
        name="block",
        mesh=grid(np.linspace(0.5, 3.5, 4), np.linspace(0.0, 1.0, 3)),
        material=STEEL,
        pressure={"top": 50.0},
        supports={"left": "x"},
    )
    pair = ContactPair(slave=("block", "bottom"), master=("die", "top"))
    solution = solve(Model(bodies=(replace(die), block), contacts=(pair,)), linear_solver=solver)
    pressure = solution.contact().pressure
    assert pressure == pytest.approx(50.0, rel=1e-6)
