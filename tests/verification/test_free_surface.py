"""Stress from the conditions of a free surface against closed forms: a bar and a layer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver.fem.discretisation import Discretisation
from solver.fem.fields import recovery
from solver.mesh import grid
from solver.rolling.results.free_surface import FreeSurface
from solver.tensors import to_tensor
from tests.verification.bodies import NU, E, block, cells

BIAXIAL = E / (1 - NU**2)

# -- bending: a linear stress --------------------------------------------------------------------


def bent(element):
    """A bar, its displacements and its stress, bent to a stress of 100 + 40 y along it.

    With eps_x = k (y + y0), eps_y = -m eps_x the displacements are k x (y + y0) and
    -k x^2 / 2 - m k (y^2 / 2 + y0 y); m is nu / (1 - nu) in plane strain.
    """
    k, m, y0 = 40.0 / BIAXIAL, NU / (1 - NU), 2.5
    mesh = grid(np.linspace(0.0, 4.0, 6), np.array([-1.0, -0.6, -0.3, 0.0]), cells(element))
    body = replace(block("bar", np.arange(2.0), np.arange(2.0), element), mesh=mesh)
    part = Discretisation(body)
    x, y = part.X
    u = np.stack([k * x * (y + y0), -k * x**2 / 2 - m * k * (y**2 / 2 + y0 * y)]).T.ravel()
    return part, u, part.respond(u, part.virgin(), 0.0).law.stress


@pytest.mark.parametrize("element", ["quad8", "quad9"])
def test_a_linear_stress_is_exact_and_equals_the_nodal_value(element):
    part, u, stress = bent(element)
    surface = FreeSurface.of(part, "top")
    along, across = surface.stress(u, part.virgin().plastic_strain)
    assert along == pytest.approx(np.full_like(along, 100.0), rel=1e-9)
    assert across == pytest.approx(np.full_like(across, NU * 100.0), rel=1e-9)
    nodal = recovery(part) @ to_tensor(stress).T
    top = nodal[part.boundary_nodes("top")]
    assert top[:, [0, 2]] == pytest.approx(np.tile([100.0, NU * 100.0], (len(top), 1)), rel=1e-9)
    # the first row has the stress of its own depth
    row = surface.first_row(stress)
    assert row[0] == pytest.approx(100.0 - 40.0 * surface.depth)
    assert row[1] == pytest.approx(NU * row[0], abs=1e-9)


def test_columns_are_the_two_by_two_points_nearest_the_surface():
    part, _, _ = bent("quad8")
    surface = FreeSurface.of(part, "top")
    gauss = (1 - 1 / np.sqrt(3)) / 2
    assert surface.depth == pytest.approx(np.full(10, 0.3 * gauss))
    assert surface.x[:2] == pytest.approx([0.8 * gauss, 0.8 * (1 - gauss)])
    assert part.points.reshape(2, -1)[0, surface.points] == pytest.approx(surface.x)
    # at a vertex between equal elements: the average of left and right
    values = np.arange(10.0) ** 2
    assert surface.at(0.8, values) == pytest.approx((values[1] + values[2]) / 2)
    assert surface.at(0.8, np.stack([values, -values]))[1] == -surface.at(0.8, values)


# -- a layer with plastic strain of depth alone --------------------------------------------------


def strained_layer(thickness, n):
    """A wide body whose sides cannot move apart, with a plastic strain of depth alone.

    Nothing but the depth matters, so eps_x = eps_z = 0 and, without load, sigma_y = 0:
    sigma_x = -E / (1 - nu^2) (ep_x + nu ep_z) at every depth.
    """
    body = block(
        "layer", np.linspace(0.0, 2.0, 3), np.linspace(-thickness, 0.0, n + 1),
        supports={"left": "x", "right": "x", "bottom": "y"},
    )  # fmt: skip
    part = Discretisation(body)
    y = part.points.reshape(2, -1)[1]
    plastic = np.stack([2e-3 * np.exp(y), -3e-3 * np.exp(y), 1e-3 * np.exp(y), 0.0 * y])
    stiffness = part.elastic_matrix()[part.active][:, part.active]
    u = np.zeros(part.n)
    stress = part.respond(u, replace(part.virgin(), plastic_strain=plastic), 0.0).law.stress
    force = -part.undeformed.internal_force(stress)[part.active]
    u[part.active] = np.linalg.solve(stiffness.toarray(), force)
    return part, u, plastic


def layer_stress(y):
    return -BIAXIAL * np.outer([2e-3 + NU * 1e-3, 1e-3 + NU * 2e-3], np.exp(y))


def test_plastic_strain_of_depth_alone_leaves_the_stress_of_the_first_row():
    """What is left at the surface is E / (1 - nu^2) times the change of plastic strain to there."""
    error = {}
    for n in (8, 16):
        part, u, plastic = strained_layer(4.0, n)
        surface = FreeSurface.of(part, "top")
        found = surface.stress(u, plastic)
        assert found == pytest.approx(layer_stress(-surface.depth), rel=1e-9)
        error[n] = np.abs(found - layer_stress(np.zeros(1))).max()
    assert np.log2(error[8] / error[16]) == pytest.approx(1.0, abs=0.05)
