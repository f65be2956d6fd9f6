"""Shapes: whole meshes of the right area, fine where they are asked to be."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest
from skfem import Basis, Functional

from solver.errors import ModelError
from solver.mesh import (
    Near,
    ball,
    disc,
    fillet,
    grid,
    half_plane,
    pad,
    rectangle,
    ring,
    within,
)
from solver.mesh.check import check_mesh
from solver.mesh.elements import element_type

SIDES = {"left", "right", "bottom", "top"}
NEAR = 0.05

# how a shape is made, its area, its boundaries, and a place of its own
SHAPES: list[tuple[Callable[..., Any], float, set[str], tuple[float, float]]] = [
    (partial(rectangle, (0, 4), (0, 2), size=0.5), 8.0, SIDES, (1.0, 2.0)),
    (partial(half_plane, 10, size=2), 200.0, SIDES, (0.0, 0.0)),
    (partial(half_plane, 10, size=2, symmetric=True), 100.0, SIDES, (0.0, 0.0)),
    (partial(pad, 4, 3, 10, size=0.5), 4 * 3 - 40 + 2 * np.sqrt(96) + 100 * np.arcsin(0.2),
     SIDES, (0.0, 0.0)),
    (partial(ring, (1, 3), size=0.3), 8 * np.pi, {"inner", "outer"}, (1.0, 0.0)),
    (partial(ring, (1, 3), (-90, 90), size=0.3), 4 * np.pi, {"inner", "outer", "start", "end"},
     (0.0, -1.0)),
    (partial(fillet, 6, 3, 0.5, (4, 5), size=0.5), 24 + 15 + 0.25 * (1 - np.pi / 4),
     {*SIDES, "surface", "fillet"}, (3.146, 0.146)),
]  # fmt: skip


def area(mesh: Any) -> float:
    basis = Basis(mesh, mesh.elem(), intorder=6)
    return float(Functional(lambda w: 1.0 + 0 * w.x[0]).assemble(basis))


@pytest.mark.parametrize(("make", "size", "names", "fine"), SHAPES)
def test_a_shape_is_whole_and_fine_where_it_is_asked_to_be(
    make: Callable[..., Any], size: float, names: set[str], fine: tuple[float, float]
) -> None:
    found = make(near=[Near(at=fine, size=NEAR, radius=0.2)])
    check_mesh(found, "shape", element_type("quad8"))
    assert area(found) == pytest.approx(size, rel=1e-5)
    assert set(found.boundaries) == names
    sides = np.linalg.norm(found.p[:, found.facets[0]] - found.p[:, found.facets[1]], axis=0)
    middles = found.p[:, found.facets].mean(axis=1)
    near = np.linalg.norm(middles - np.array(fine)[:, None], axis=0) < 0.15
    assert sides[near].max() <= 1.05 * NEAR, "no side is longer than asked for"
    assert make().nelements < found.nelements


@pytest.mark.parametrize("make", [
    *(make for make, *_ in SHAPES), partial(disc, 2, size=0.2), partial(ball, 10, size=1, fine=2)
])  # fmt: skip
def test_the_outline_is_in_the_boundaries(make: Callable[..., Any]) -> None:
    found = make()
    named = np.unique(np.concatenate([np.asarray(each) for each in found.boundaries.values()]))
    assert set(named) == set(found.boundary_facets())


def test_a_disc_has_a_rim_and_its_quarters() -> None:
    found = disc(2, (1, 3), size=0.2)
    check_mesh(found, "disc", element_type("quad8"))
    assert area(found) == pytest.approx(4 * np.pi, rel=1e-5)
    quarters = [np.asarray(found.boundaries[each]) for each in ("east", "north", "west", "south")]
    assert len({len(each) for each in quarters}) == 1
    assert set(np.concatenate(quarters)) == set(np.asarray(found.boundaries["rim"]))
    north = found.p[:, found.facets[:, quarters[1]]].mean(axis=1)
    assert (north[1] > 3 + np.sqrt(2) * 0.9).all()


@pytest.mark.parametrize("symmetric", [True, False])
@pytest.mark.parametrize("above", [True, False])
def test_a_ball_touches_its_place(above: bool, symmetric: bool) -> None:
    found = ball(10, (1, 2), size=0.1, fine=0.5, above=above, symmetric=symmetric)
    check_mesh(found, "ball", element_type("quad8"))
    surface = found.p[:, np.unique(found.facets[:, np.asarray(found.boundaries["surface"])])]
    centre = np.array([[1.0], [12.0 if above else -8.0]])
    assert np.linalg.norm(surface - centre, axis=0) == pytest.approx(10.0)
    assert np.abs(surface - np.array([[1.0], [2.0]])).sum(axis=0).min() < 1e-9
    assert (found.p[0].min() > 1 - 1e-9) == symmetric


def test_a_box_names_a_part_of_a_boundary() -> None:
    found = within(rectangle((0, 4), (0, 2), size=0.5), "part", ["top", "right"], x=(1.0, 4.0))
    middles = found.p[:, found.facets[:, np.asarray(found.boundaries["part"])]].mean(axis=1)
    assert sorted(middles[0]) == pytest.approx([1.25, 1.75, 2.25, 2.75, 3.25, 3.75, *[4.0] * 4])


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (partial(rectangle, (1, 1), (0, 1), size=0.1), "x"),
        (partial(rectangle, (0, np.nan), (0, 1), size=0.1), "x"),
        (partial(rectangle, (0, 1), (0, 1), size=1e-5), "size"),
        (partial(rectangle, (0, 1), (0, 1), size=0.0), "size"),
        (partial(rectangle, (0, 1), (0, 1), size=0.1, growth=1.0), "growth"),
        (partial(rectangle, (0, 1000), (0, 1000), size=1.0), "size"),
        (partial(half_plane, -1, size=0.1), "extent"),
        (partial(ring, (1, 2), (0, 400), size=0.1), "angles"),
        (partial(ring, (2, 1), size=0.1), "radii"),
        (partial(ring, (0, 1), size=0.1), "radii"),
        (partial(ring, (1, 2), size=0.1, near=[Near(at=(0, 0), size=0.1)]), "near"),
        (partial(pad, 4, 3, 1, size=0.5), "radius"),
        (partial(pad, 4, 0.01, 3, size=0.5), "height"),
        (partial(fillet, 3, 3, 1, (1, 2), size=0.5), "radius"),
        (partial(fillet, 6, 3, 0.5, (1, 0.4), size=0.5), "radius"),
        (partial(fillet, 6, 3, 0.5, (-1, 2), size=0.5), "lengths"),
        (partial(disc, 0, size=0.5), "radius"),
        (partial(disc, 1, size=1e-4), "size"),
        (partial(ball, 1, size=0.5, fine=0.1), "fine"),
        (partial(ball, 1, size=0.5, fine=5.0), "fine"),
        (partial(Near, at=(0, 0), size=-1), "size"),
        (partial(Near, at=(0, 0), size=1, radius=-1), "radius"),
        (partial(within, grid(np.arange(3), np.arange(3)), "part", ["upper"]),
         "boundaries.part.of"),
        (partial(within, grid(np.arange(3), np.arange(3)), "part", ["top"], x=(9, 10)),
         "boundaries.part"),
    ],
)  # fmt: skip
def test_a_shape_that_cannot_be_is_refused_by_its_argument(
    make: Callable[[], Any], field: str
) -> None:
    with pytest.raises(ModelError) as caught:
        make()
    assert caught.value.field == field


def test_a_fillet_has_no_folded_element_whatever_its_sizes() -> None:
    """One that spans the corner of axis and bottom would be."""
    rng = np.random.default_rng(0)
    for k in range(60):
        wide = rng.uniform(2.0, 10.0)
        narrow = wide * rng.uniform(0.2, 0.8)
        radius = (wide - narrow) * rng.uniform(0.05, 0.95)
        lengths = rng.uniform(1.0, 20.0), radius * 1.05 + rng.uniform(0.0, 10.0)
        near = [Near(at=(narrow, radius), size=radius * 10 ** rng.uniform(-1.3, 0.0))]
        mesh = fillet(
            wide, narrow, radius, lengths, size=rng.uniform(0.2, 2.0), near=near if k % 3 else ()
        )
        check_mesh(mesh, "bar", element_type("quad4"))
