"""Coordinates that a mesher rounds count as what they were meant to be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from skfem import Mesh, MeshQuad2

from solver import Body, Material, ModelError
from solver.mesh import grid
from solver.mesh.grids import marked, within, without
from solver.mesh.rounding import with_zeros
from solver.model.tabulated import Tabulated

STEEL = Material(youngs_modulus=2e5, poisson_ratio=0.3)
PLATE = grid(np.linspace(0.0, 10.0, 6), np.linspace(0.0, 4.0, 3))
ROUNDING = [-9e-14, 9e-14, -4.7e-10, -5e-8]
"""Over the size of the mesh: of OpenCASCADE, and of files in single precision."""


def off(mesh: Mesh, rounding: float) -> Mesh:
    """Return the mesh with its places at x = 0 moved by a rounding of its size."""
    p = mesh.doflocs.copy()
    p[0, p[0] == 0.0] = rounding * np.ptp(p, axis=1).max()
    return replace(mesh, doflocs=p)


@pytest.mark.parametrize("rounding", [each for each in ROUNDING if each < 0])
@pytest.mark.parametrize("curved", [False, True])
def test_an_axis_that_a_mesher_rounds_is_the_axis(rounding: float, curved: bool) -> None:
    mesh = off(MeshQuad2.from_mesh(PLATE) if curved else PLATE, rounding)
    body = Body(name="disc", mesh=mesh, material=STEEL, kinematics="axisymmetric")
    assert body.mesh.p[0].min() == 0.0
    np.testing.assert_array_equal(body.mesh.p[0] == 0.0, mesh.p[0] < 0.0)
    moved = body.mesh.translated((0.1, 0.0)).translated((-0.1, 0.0))
    assert Body(name="disc", mesh=moved, material=STEEL, kinematics="axisymmetric")


def test_a_body_beyond_its_axis_is_refused() -> None:
    with pytest.raises(ModelError, match=r"-9.53\d*e-06: an axisymmetric body needs x >= 0"):
        Body(name="disc", mesh=off(PLATE, -(2.0**-20)), material=STEEL, kinematics="axisymmetric")


def test_fine_elements_at_the_axis_stay() -> None:
    """Sides of 1e-7 of the size are far above a thousandth of themselves."""
    x = np.concatenate([[0.0], np.geomspace(1e-6, 10.0, 30)])
    mesh = grid(x, np.linspace(0.0, 4e-6, 5))
    np.testing.assert_array_equal(with_zeros(mesh).p, mesh.p)


@pytest.mark.parametrize("rounding", ROUNDING)
def test_a_box_that_ends_at_rounded_coordinates_has_what_lies_there(rounding: float) -> None:
    mesh = off(PLATE, rounding)
    at = within(mesh, "axis", ["left"], x=(0.0, 1.0)).boundaries["axis"]
    assert len(at) == 2
    assert len(within(mesh, "axis", ["left"], x=(-1.0, 0.0)).boundaries["axis"]) == 2
    middles = mesh.p[0, mesh.t].mean(axis=0).min()
    assert len(marked(mesh, "first", x=(0.0, middles - rounding)).subdomains["first"]) == 2
    assert without(mesh, "notch", (0.0, 2.0), (0.0, 2.0)).nelements == mesh.nelements - 1


def test_a_table_covers_a_body_whose_end_a_mesher_rounds() -> None:
    table = Tabulated.of("x,stress\n0,1\n10,2\n", "stress")
    found = table(np.array([[-4e-7, 10.0 + 4e-7], [0.0, 0.0]]))
    assert found == pytest.approx([1.0, 2.0])
