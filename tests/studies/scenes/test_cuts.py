"""Rectangles cut out of bodies, and the size of such a mesh."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from solver import ModelError, System
from studies.errors import SceneError
from tests.studies.scenes.conftest import blocks, built

GRID: dict[str, Any] = {
    "kind": "grid",
    "x": [{"at": 0, "size": 0.5}, {"at": 2, "parts": 5}, {"at": 4, "size": 0.5}],
    "y": [{"at": -2}, {"at": -1, "size": 0.25}, {"at": 0}],
    "growth": 1.5,
}
CUTS: dict[str, dict[str, list[float]]] = {
    "notch": {"x": [2, 9], "y": [-1, 0]},
    "side": {"x": [-1, 2], "y": [-2, -1]},
}


@pytest.mark.parametrize("element", ["quad4", "quad8", "quad9", "tri3", "tri6"])
@pytest.mark.parametrize("cuts", [(), ("notch",), ("side",)])
def test_the_work_of_a_grid_with_cuts_is_that_of_its_system(
    element: str, cuts: tuple[str, ...]
) -> None:
    tables = blocks()
    tables["bodies"]["lower"] |= {
        "shape": GRID, "element": element, "cuts": {name: CUTS[name] for name in cuts},
    }  # fmt: skip
    tables["bodies"]["upper"]["element"] = element
    scene = built(tables)
    parameters = scene.parameters()
    system = System(scene.model(parameters))
    work = scene.effort(parameters, [getattr(parameters, scene.branch, None)])
    assert work.unknowns == system.n_unknowns
    assert work.elements == sum(body.mesh.nelements for body in system.model.bodies)


def cut(**box: Any) -> dict[str, Any]:
    """Return the small scene; the lower block is a grid out of which a box is cut."""
    tables = blocks()
    tables["bodies"]["lower"] |= {"shape": GRID, "cuts": {"groove": box}}
    return tables


def test_a_cut_opens_a_boundary_and_boundaries_may_be_made_of_it() -> None:
    tables = cut(x=[2, 4], y=[-1, 0])
    tables["bodies"]["lower"]["boundaries"] = {"floor": {"of": ["groove"], "x": [2.1, 4]}}
    scene = built(tables)
    mesh = scene.model(scene.parameters()).bodies[1].mesh
    x, y = mesh.p[:, mesh.facets[:, mesh.boundaries["floor"]]].mean(axis=1)
    assert y == pytest.approx(-1.0) and (x > 2).all()
    middles = mesh.p[:, mesh.t].mean(axis=1)
    assert not ((middles[0] > 2) & (middles[1] > -1)).any()
    assert np.ptp(mesh.p[1, mesh.facets[:, mesh.boundaries["right"]]]) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("box", "told"),
    [
        ({"x": [2.1, 4], "y": [-1, 0]}, "bodies.lower.cuts.groove"),
        ({"x": [7, 9], "y": [-1, 0]}, "bodies.lower.cuts.groove"),
        ({"x": [4, 2], "y": [-1, 0]}, "bodies.lower.cuts.groove"),
        ({"x": [2, 4]}, "bodies.lower.cuts.groove.y"),
    ],
)
def test_a_cut_that_does_not_fit_is_told(box: Any, told: str) -> None:
    with pytest.raises(SceneError) as caught:
        built(cut(**box))
    fields = [mistake.field for mistake in caught.value.mistakes]
    assert fields and all(field.startswith(told) for field in fields), caught.value


def test_too_fine_a_grid_is_refused_before_it_is_made() -> None:
    tables = cut(x=[2, 4], y=[-1, 0])
    tables["parameters"]["fine"] = {"default": 0.5, "range": [1e-9, 1], "unit": "mm"}
    fine = {"at": 4, "size": "$fine", "largest": "$fine"}
    shape = GRID | {"x": [{"at": 0}, {"at": 2, "parts": 5}, fine]}
    tables["bodies"]["lower"]["shape"] = shape
    scene = built(tables)
    with pytest.raises(ModelError, match=r"^bodies\.lower\.shape\.size = .*at most 200000"):
        scene.parameters(fine=2e-5)
