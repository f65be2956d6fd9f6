"""Built-in shapes: whole meshes of the right area, fine where they are asked to be."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter

from solver.errors import ModelError
from solver.mesh.check import check_mesh
from solver.mesh.elements import element_type
from studies.scenes import shape_tables
from studies.scenes.shapes import mesh_of

SHAPE: TypeAdapter[Any] = TypeAdapter(shape_tables.Shape)
NEAR = {"size": 0.05, "radius": 0.2}


def mesh(cells: str = "quad", **table: Any) -> Any:
    return mesh_of(SHAPE.validate_json(json.dumps(table), strict=True), cells)


def area(found: Any) -> float:
    from skfem import Basis, Functional

    basis = Basis(found, found.elem(), intorder=6)
    return float(Functional(lambda w: 1.0 + 0 * w.x[0]).assemble(basis))


SHAPES: list[tuple[dict[str, Any], float, set[str], tuple[float, float]]] = [
    ({"kind": "rectangle", "x": [0, 4], "y": [0, 2], "size": 0.5}, 8.0,
     {"left", "right", "bottom", "top"}, (1.0, 2.0)),
    ({"kind": "half_plane", "extent": 10, "size": 2}, 200.0,
     {"left", "right", "bottom", "top"}, (0.0, 0.0)),
    ({"kind": "half_plane", "extent": 10, "size": 2, "symmetric": True}, 100.0,
     {"left", "right", "bottom", "top"}, (0.0, 0.0)),
    ({"kind": "pad", "width": 4, "height": 3, "radius": 10, "size": 0.5},
     4 * 3 - (100 * np.arcsin(0.2) * -1 + 2 * np.sqrt(96) * -1 + 40),
     {"left", "right", "bottom", "top"}, (0.0, 0.0)),
    ({"kind": "ring", "radii": [1, 3], "size": 0.3}, 8 * np.pi, {"inner", "outer"}, (1.0, 0.0)),
    ({"kind": "sector", "radii": [1, 3], "angles": [-90, 90], "size": 0.3}, 4 * np.pi,
     {"inner", "outer", "start", "end"}, (0.0, -1.0)),
    ({"kind": "fillet", "wide": 6, "narrow": 3, "radius": 0.5, "lengths": [4, 5], "size": 0.5},
     24 + 15 + 0.25 * (1 - np.pi / 4), {"left", "right", "bottom", "top", "surface", "fillet"},
     (3.146, 0.146)),
]  # fmt: skip


@pytest.mark.parametrize(("table", "size", "names", "fine"), SHAPES)
def test_a_shape_is_whole_and_fine_where_it_is_asked_to_be(
    table: dict[str, Any], size: float, names: set[str], fine: tuple[float, float]
) -> None:
    found = mesh(**table, near=[{"at": list(fine), **NEAR}])
    check_mesh(found, table["kind"], element_type("quad8"))
    assert area(found) == pytest.approx(size, rel=1e-5)
    assert set(found.boundaries) == names
    sides = np.linalg.norm(found.p[:, found.facets[0]] - found.p[:, found.facets[1]], axis=0)
    middles = found.p[:, found.facets].mean(axis=1)
    near = np.linalg.norm(middles - np.array(fine)[:, None], axis=0) < 0.15
    assert sides[near].max() <= 1.05 * NEAR["size"], "no side is longer than asked for"
    coarse = mesh(**table)
    assert coarse.nelements < found.nelements


def test_the_outline_is_in_the_boundaries() -> None:
    for table, _, _, _ in SHAPES:
        found = mesh(**table)
        named = np.unique(np.concatenate([np.asarray(b) for b in found.boundaries.values()]))
        assert set(named) == set(found.boundary_facets()), table["kind"]


def test_a_disc_has_a_rim_and_its_quarters() -> None:
    found = mesh(kind="disc", radius=2, centre=[1, 3], size=0.2)
    check_mesh(found, "disc", element_type("quad8"))
    assert area(found) == pytest.approx(4 * np.pi, rel=1e-5)
    quarters = [np.asarray(found.boundaries[each]) for each in ("east", "north", "west", "south")]
    assert len({len(each) for each in quarters}) == 1
    assert set(np.concatenate(quarters)) == set(np.asarray(found.boundaries["rim"]))
    north = found.p[:, found.facets[:, quarters[1]]].mean(axis=1)
    assert (north[1] > 3 + np.sqrt(2) * 0.9).all()


@pytest.mark.parametrize("above", [True, False])
def test_a_round_touches_its_place(above: bool) -> None:
    found = mesh(kind="round", radius=10, size=0.1, fine=0.5, at=[1, 2], above=above)
    check_mesh(found, "round", element_type("quad8"))
    surface = found.p[:, np.unique(found.facets[:, np.asarray(found.boundaries["surface"])])]
    centre = np.array([[1.0], [12.0 if above else -8.0]])
    assert np.linalg.norm(surface - centre, axis=0) == pytest.approx(10.0)
    assert np.abs(surface - np.array([[1.0], [2.0]])).sum(axis=0).min() < 1e-9


def test_triangles_are_of_straight_shapes_alone() -> None:
    assert mesh("tri", **SHAPES[0][0]).t.shape[0] == 3
    with pytest.raises(ModelError, match="meshed with quadrilaterals"):
        mesh("tri", **SHAPES[4][0])


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"kind": "rectangle", "x": [1, 1], "y": [0, 1], "size": 0.1}, "x"),
        ({"kind": "rectangle", "x": [0, 1], "y": [0, 1], "size": 1e-5}, "size"),
        ({"kind": "ring", "radii": [1, 2], "angles": [0, 400], "size": 0.1}, "angles"),
        ({"kind": "ring", "radii": [2, 1], "size": 0.1}, "radii"),
        ({"kind": "pad", "width": 4, "height": 3, "radius": 1, "size": 0.5}, "radius"),
        ({"kind": "pad", "width": 4, "height": 0.01, "radius": 3, "size": 0.5}, "height"),
        ({"kind": "fillet", "wide": 3, "narrow": 3, "radius": 1, "lengths": [1, 2], "size": 0.5},
         "radius"),
        ({"kind": "round", "radius": 1, "size": 0.5, "fine": 0.1}, "fine"),
    ],
)  # fmt: skip
def test_a_shape_that_cannot_be_is_refused_by_its_entry(
    changes: dict[str, Any], field: str
) -> None:
    with pytest.raises(ModelError) as caught:
        mesh(**changes)
    assert caught.value.field == field
