"""Meshes with a zone of small elements: rails and blocks."""

from __future__ import annotations

import math

import numpy as np
import pytest
from skfem import ElementQuadS2
from skfem.quadrature import get_quadrature

from solver import ModelError
from solver.mesh.check import check_mesh
from solver.mesh.elements import ELEMENTS
from solver.rolling.rail.profiles.rail import rail_60e1
from solver.rolling.rail.profiles.zone import Zone, raceway_mesh, rail_mesh

RAIL = rail_60e1()
QUAD8 = ElementQuadS2()
CORNERS = np.array([[0.0, 1.0, 1.0, 0.0], [0.0, 0.0, 1.0, 1.0]])


def jacobians(mesh, points):
    """Jacobians (2, 2, n_points, n_elements) of the 8-node elements of a mesh."""
    X = mesh.doflocs[:, mesh.dofs.element_dofs[:8]]
    slopes = np.array([QUAD8.lbasis(points, i)[1] for i in range(8)])
    return np.einsum("ane,nkp->akpe", X, slopes)


def determinants(J):
    return J[0, 0] * J[1, 1] - J[0, 1] * J[1, 0]


def angles(mesh):
    """Angles (4, n_elements) between the curved sides at the corners [deg]."""
    J = jacobians(mesh, CORNERS)
    found = np.degrees(np.arctan2(determinants(J), (J[:, 0] * J[:, 1]).sum(axis=0)))
    return np.where([[False], [True], [False], [True]], 180 - found, found)


def area(mesh):
    points, weights = get_quadrature(QUAD8, 5)
    return (determinants(jacobians(mesh, points)).T @ weights).sum()


def folded(mesh):
    points = np.hstack([CORNERS, get_quadrature(QUAD8, 5)[0]])
    return (determinants(jacobians(mesh, points)) <= 0).any()


def middles(mesh, name):
    """Midsides (2, n) of the facets of a boundary, in their order."""
    return mesh.doflocs[:, mesh.dofs.facet_dofs[0, mesh.boundaries[name]]]


def ends(mesh, name):
    return mesh.p[:, mesh.facets[:, mesh.boundaries[name]]]


@pytest.mark.parametrize("size", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("at", [-20.0, -12.0, -4.0, 0.0, 9.0, 17.0, 25.0])
def test_elements_of_a_rail_have_good_angles(at, size):
    mesh = rail_mesh(RAIL, Zone(at=at, half_width=10.0, depth=14.0, size=size))
    assert not folded(mesh)
    assert 30 < angles(mesh).min()
    assert angles(mesh).max() < 150


@pytest.mark.parametrize("slope", [-1 / 40, 1 / 40, 1 / 20])
@pytest.mark.parametrize(("half_width", "depth"), [(10.0, 14.0), (6.0, 8.0), (12.0, 12.0)])
@pytest.mark.parametrize("at", [-20.0, -4.0, 22.0])
def test_so_have_those_of_a_canted_one_with_other_zones(at, half_width, depth, slope):
    zone = Zone(at=at, half_width=half_width, depth=depth, size=1.0)
    mesh = rail_mesh(RAIL.canted(slope), zone)
    assert not folded(mesh)
    assert 30 < angles(mesh).min()
    assert angles(mesh).max() < 150


def test_a_worn_rail_is_meshed_as_a_new_one():
    z = 35.9 * np.sin(np.linspace(-1.5, 1.5, 120))
    y = -3.0 - 4e-4 * z**2 - 7.0 * (z / 36) ** 8
    section = RAIL.worn(np.stack([z, y])).canted(1 / 40)
    mesh = rail_mesh(section, Zone(at=-4.0, half_width=10.0, depth=14.0, size=1.0))
    assert not folded(mesh)
    assert 30 < angles(mesh).min()
    assert angles(mesh).max() < 150
    assert area(mesh) == pytest.approx(section.outline.area, rel=2e-3)
    z, y = mesh.p
    assert -0.05 < y.max() <= 1e-9  # the highest point lies between two nodes


def test_a_rail_of_elements_of_1_mm_is_small_and_sound():
    mesh = rail_mesh(RAIL, Zone(at=-4.0, half_width=10.0, depth=14.0, size=1.0))
    assert mesh.doflocs.shape[1] - mesh.nelements < 3000  # nodes of 8-node elements
    assert area(mesh) == pytest.approx(RAIL.outline.area, rel=2e-3)
    check_mesh(mesh, "rail", ELEMENTS["quad8"])
    assert set(mesh.boundaries) == {"running", "foot"}


@pytest.mark.parametrize("at", [-20.0, -4.0, 25.0])
def test_the_zone_follows_the_running_surface_in_equal_steps(at):
    zone = Zone(at=at, half_width=10.0, depth=14.0, size=1.0)
    mesh = rail_mesh(RAIL, zone)
    X = middles(mesh, "running")
    assert X.shape[1] == zone.columns == 20
    assert (np.diff(X[0]) > 0).all()
    nodes = np.concatenate([ends(mesh, "running").reshape(2, -1), X], axis=1)
    s = np.array([RAIL.place(z) for z in nodes[0]])
    assert nodes == pytest.approx(RAIL.outline.at(s), abs=1e-9)
    steps = np.sort(np.unique(np.round(s, 9)))
    assert np.diff(steps) == pytest.approx(np.full(40, 0.5))
    assert (steps[0] + steps[-1]) / 2 == pytest.approx(RAIL.place(at), abs=1e-9)


def test_the_zone_has_elements_of_the_size_asked_for():
    mesh = rail_mesh(RAIL, Zone(at=-4.0, half_width=10.0, depth=14.0, size=1.0))
    z, y = mesh.p[:, mesh.t].mean(axis=1)
    inside = (abs(z + 4) < 10 + 0.02 * y) & (y > -14.2)
    assert inside.sum() == 14 * 20
    size = determinants(jacobians(mesh, np.full((2, 1), 0.5)))[0, inside]
    # columns converge, by 0.6 of the curvature, which is at most 1/80 there
    assert 1 - 0.6 * 14 / 80 - 0.01 < size.min()
    assert size.max() < 1.001


def test_the_foot_is_the_whole_base():
    mesh = rail_mesh(RAIL, Zone(at=3.0, half_width=10.0, depth=14.0, size=1.0))
    z, y = ends(mesh, "foot")
    left, right = RAIL.outline.at(np.array(RAIL.places["soles"])).T
    assert (z.min(), z.max()) == pytest.approx((left[0], right[0]))
    assert y == pytest.approx(np.full(y.shape, -172.0), abs=0.6)  # the corners are round
    assert (np.diff(middles(mesh, "foot")[0]) > 0).all()


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"at": 50.0}, "at = 50"),
        ({"at": 30.0, "half_width": 40.0}, "half_width = 40"),
        ({"half_width": 64.0}, "half_width = 64"),  # one element beside the zone
        ({"depth": 60.0}, "depth = 60"),
    ],
)
def test_zones_outside_the_head_are_refused(given, said):
    zone = Zone(**({"at": 0.0, "half_width": 5.0, "depth": 5.0, "size": 1.0} | given))
    with pytest.raises(ModelError, match=said):
        rail_mesh(RAIL, zone)


@pytest.mark.parametrize("given", [{"half_width": 0.0}, {"depth": math.inf}, {"size": 6.0}])
def test_bad_zones_are_refused(given):
    (name,) = given
    with pytest.raises(ModelError, match=name):
        Zone(**({"at": 0.0, "half_width": 5.0, "depth": 5.0, "size": 1.0} | given))


# -- blocks --------------------------------------------------------------------------------------


@pytest.mark.parametrize("groove", [None, (6.6, 4.0), (30.0, 12.0)])
def test_a_block_has_its_zone_on_flat_and_grooved_surfaces(groove):
    zone = Zone(at=0.0, half_width=2.0, depth=3.0, size=0.25)
    mesh = raceway_mesh(120.0, 60.0, zone, groove)
    assert not folded(mesh)
    assert 30 < angles(mesh).min()
    assert angles(mesh).max() < 150
    check_mesh(mesh, "block", ELEMENTS["quad8"])
    z, y = middles(mesh, "running")
    assert len(z) == 16
    assert (np.diff(z) > 0).all()
    radius, edge = groove or (math.inf, 60.0)
    height = radius - np.sqrt(radius**2 - z**2) if groove else np.zeros(16)
    assert y == pytest.approx(height, abs=1e-12)
    # the surface between the shoulders: a segment of the circle is missing
    top = radius - math.sqrt(radius**2 - edge**2) if groove else 0.0
    half = math.asin(edge / radius)
    missing = radius**2 * (half - math.sin(half) * math.cos(half)) if groove else 0.0
    assert area(mesh) == pytest.approx(120 * (60 + top) - missing, rel=1e-5)
    foot = ends(mesh, "foot")
    assert foot[1] == pytest.approx(np.full(foot[1].shape, -60.0))
    assert (foot[0].min(), foot[0].max()) == pytest.approx((-60.0, 60.0))


@pytest.mark.parametrize("made", ["rail", "raceway"])
def test_the_uppermost_rows_are_divided_into_two(made: str) -> None:
    zone = Zone(at=0.0, half_width=5.0, depth=6.0, size=1.0, split=2)
    mesh = rail_mesh(RAIL, zone) if made == "rail" else raceway_mesh(120.0, 60.0, zone)
    assert zone.rows == 8
    inside = mesh.p[:, mesh.t[:, : zone.rows * zone.columns]]
    thick = np.ptp(inside[1], axis=0)  # of nearly flat rows
    assert np.unique(np.round(2 * thick)).tolist() == [1.0, 2.0]
    assert (np.round(2 * thick) == 1.0).sum() == 4 * zone.columns
    assert inside[1][:, thick < 0.75].min() > -2.1
    with pytest.raises(ModelError, match="split"):
        Zone(at=0.0, half_width=5.0, depth=6.0, size=1.0, split=7)
