"""Outlines of bodies: closed curves on the border of a mesh, the body on the left."""

from __future__ import annotations

import numpy as np
import pytest
from skfem import MeshTri

from solver.mesh import grid
from solver.results.maps import closed_curves


def area(curve: np.ndarray) -> float:
    x, y = curve
    return float((x[:-1] * y[1:] - x[1:] * y[:-1]).sum() / 2)


def test_a_hole_has_a_curve_of_its_own_the_other_way_round() -> None:
    x = np.array([0.0, 1.0, 2.0, 3.0])
    mesh = grid(x, x)
    middles = mesh.p[:, mesh.t].mean(axis=1)
    open_ = mesh.restrict(np.flatnonzero(np.abs(middles - 1.5).max(axis=0) > 0.1))
    curves = list(closed_curves(open_.p, open_.t.T))
    assert sorted(map(area, curves)) == pytest.approx([-1.0, 9.0])
    assert [each.shape for each in curves] == [(2, 5), (2, 5)]  # no points on straight sides
    assert all((each[:, 0] == each[:, -1]).all() for each in curves)


def test_triangles_and_cells_of_either_orientation_have_the_same_outline() -> None:
    mesh = MeshTri().refined(2)
    turned = mesh.t.T.copy()
    turned[::2] = turned[::2, ::-1]
    for cells in (mesh.t.T, turned):
        (curve,) = closed_curves(mesh.p, cells)
        assert curve.shape == (2, 5) and area(curve) == pytest.approx(1.0)


def test_a_curved_side_goes_through_its_middle_node() -> None:
    corners = np.array([[0.0, 2.0, 2.0, 0.0], [0.0, 0.0, 2.0, 2.0]])
    middles = (corners + np.roll(corners, -1, axis=1)) / 2
    middles[0, 1] = 2.5
    (curve,) = closed_curves(np.hstack([corners, middles]), np.arange(8)[None])
    assert curve.shape == (2, 6) and [2.5, 1.0] in curve.T.tolist()
    assert area(curve) == pytest.approx(4.5)
