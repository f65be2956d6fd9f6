"""The tables of shapes give the meshing functions of the solver what they need."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter

from solver.errors import ModelError
from solver.mesh import Near, ball, disc, fillet, half_plane, pad, rectangle, ring
from studies.scenes import shape_tables
from studies.scenes.shape_tables import mesh_of

SHAPE: TypeAdapter[Any] = TypeAdapter(shape_tables.Shape)
FINE = {"at": (1.0, 0.5), "size": 0.05, "radius": 0.2}
NEAR = (Near(at=(1.0, 0.5), size=0.05, radius=0.2),)


def mesh(cells: str = "quad", **table: Any) -> Any:
    return mesh_of(SHAPE.validate_json(json.dumps(table), strict=True), cells)


@pytest.mark.parametrize(
    ("table", "make"),
    [
        ({"kind": "rectangle", "x": [0, 4], "y": [0, 2], "size": 0.5, "near": [FINE]},
         partial(rectangle, (0, 4), (0, 2), size=0.5, near=NEAR)),
        ({"kind": "half_plane", "extent": 10, "size": 2, "symmetric": True, "growth": 1.5},
         partial(half_plane, 10, size=2, symmetric=True, growth=1.5)),
        ({"kind": "pad", "width": 4, "height": 3, "radius": 10, "size": 0.5},
         partial(pad, 4, 3, 10, size=0.5)),
        ({"kind": "ring", "radii": [1, 3], "centre": [1, 2], "size": 0.3, "near": [FINE]},
         partial(ring, (1, 3), centre=(1, 2), size=0.3, near=NEAR)),
        ({"kind": "sector", "radii": [1, 3], "angles": [-90, 90], "size": 0.3},
         partial(ring, (1, 3), (-90, 90), size=0.3)),
        ({"kind": "fillet", "wide": 6, "narrow": 3, "radius": 0.5, "lengths": [4, 5], "size": 0.5},
         partial(fillet, 6, 3, 0.5, (4, 5), size=0.5)),
        ({"kind": "disc", "radius": 2, "centre": [1, 3], "size": 0.2},
         partial(disc, 2, (1, 3), size=0.2)),
        ({"kind": "round", "radius": 10, "size": 0.5, "fine": 1, "at": [1, 2], "above": False},
         partial(ball, 10, (1, 2), size=0.5, fine=1, above=False)),
    ],
)  # fmt: skip
def test_a_table_makes_the_mesh_of_its_function(
    table: dict[str, Any], make: Callable[[], Any]
) -> None:
    found, expected = mesh(**table), make()
    assert np.array_equal(found.p, expected.p)
    assert np.array_equal(found.t, expected.t)
    assert set(found.boundaries) == set(expected.boundaries)


def test_triangles_are_of_straight_shapes_alone() -> None:
    assert mesh("tri", kind="rectangle", x=[0, 4], y=[0, 2], size=0.5).t.shape[0] == 3
    assert mesh("tri", kind="half_plane", extent=10, size=2).t.shape[0] == 3
    with pytest.raises(ModelError, match="meshed with quadrilaterals"):
        mesh("tri", kind="ring", radii=[1, 3], size=0.3)


def test_a_shape_that_cannot_be_is_refused_by_its_entry() -> None:
    with pytest.raises(ModelError) as caught:
        mesh(kind="pad", width=4, height=0.01, radius=3, size=0.5)
    assert caught.value.field == "height"
