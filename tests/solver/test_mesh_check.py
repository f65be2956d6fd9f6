"""Meshes that give wrong answers are refused; good ones are not, however graded, small or far."""

from __future__ import annotations

import numpy as np
import pytest
from skfem import MeshQuad, MeshQuad2, MeshTri, MeshTri2

from solver import Body, Material, ModelError
from solver.fem.discretisation import Discretisation
from solver.mesh import grid, mapped, merged, opened

STEEL = Material(youngs_modulus=2e5, poisson_ratio=0.3)
SQUARE = np.array([[0.0, 1.0, 1.0, 0.0], [0.0, 0.0, 1.0, 1.0]])
ROUND = np.array([[0], [1], [2], [3]])
CELLS = np.arange(3.0)


def body(mesh, **fields):
    element = "tri6" if mesh.t.shape[0] == 3 else "quad8"
    return Body(**({"name": "plate", "mesh": mesh, "material": STEEL, "element": element} | fields))


def refusal(mesh, **fields):
    """What the mesh is told: element or node, and what is allowed."""
    with pytest.raises(ModelError) as caught:
        body(mesh, **fields)
    assert caught.value.field == "mesh"
    what, plate, nothing = str(caught.value.value).partition(' of body "plate"')
    assert plate
    assert not nothing
    return f"{what} {caught.value.allowed}"


def node_at(mesh, x, y):
    return int(np.argmin(np.hypot(mesh.p[0] - x, mesh.p[1] - y)))


def moved(mesh, node, x, y):
    p = mesh.p.copy()
    p[:, node] = x, y
    return type(mesh)(p, mesh.t)


def unmerged(mesh, node, elements):
    """Give these elements a copy of the node."""
    t = mesh.t.copy()
    for element in elements:
        t[t[:, element] == node, element] = mesh.p.shape[1]
    return type(mesh)(np.hstack([mesh.p, mesh.p[:, [node]]]), t)


def joined(*meshes):
    first = np.cumsum([0, *(mesh.p.shape[1] for mesh in meshes)])
    t = np.hstack([mesh.t + n for mesh, n in zip(meshes, first, strict=False)])
    return type(meshes[0])(np.hstack([mesh.p for mesh in meshes]), t)


# -- what must pass ----------------------------------------------------------------------------


def graded_square(cells):
    """Sides of 1e-3 and 1 in both directions."""
    x = np.cumsum([0.0, 1.0, 1e-3, 1e-3, 1.0])
    return grid(x, x, cells)


def turned(mesh, angle):
    c, s = np.cos(angle), np.sin(angle)
    return type(mesh)(np.array([[c, -s], [s, c]]) @ mesh.p, mesh.t)


@pytest.mark.parametrize("cells", ["quad", "tri"])
@pytest.mark.parametrize("angle", [0.0, 0.5])
@pytest.mark.parametrize("offset", [0.0, -1e7])
@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_grading_direction_unit_and_origin_do_not_matter(cells, angle, offset, unit):
    mesh = turned(graded_square(cells), angle)
    assert body(type(mesh)(unit * (mesh.p + offset), mesh.t))


@pytest.mark.parametrize("cells", ["quad", "tri"])
def test_the_finest_and_largest_scene_is_accepted(cells):
    """A corner of 1e-5 a in a half-plane of 1000 a: elements 1 to 25 million."""
    assert body(grid(np.array([0.0, 1e-5, 250.0, 500.0]), np.array([-250.0, -1e-5, 0.0]), cells))


@pytest.mark.parametrize(
    "mesh",
    [
        MeshTri.init_circle(4),
        MeshTri2.init_circle(4),
        MeshTri.init_lshaped().refined(2),
        MeshTri.init_symmetric().refined([0, 2]).refined([1, 5, 7]),
        MeshTri.init_sqsymmetric(),
        MeshQuad.init_tensor(CELLS, CELLS).refined(2),
        MeshQuad2.from_mesh(MeshQuad().refined(2)),
        MeshTri2.from_mesh(MeshTri().refined(2)),
        mapped(grid(np.array([1e-3, 1.0, 2.0]), np.linspace(0, 3, 5)),
               lambda p: p[0] * np.stack([np.cos(p[1]), np.sin(p[1])])),
    ],
    ids=["disc", "curved disc", "L", "adapted", "symmetric", "refined", "quad9", "tri6", "fan"],
)  # fmt: skip
def test_good_meshes_are_accepted(mesh):
    assert body(mesh)


@pytest.mark.parametrize("cells", ["quad", "tri"])
def test_elements_may_be_numbered_either_way_round(cells):
    mesh = grid(CELLS, CELLS, cells)
    t = mesh.t.copy()
    t[:, ::2] = t[::-1, ::2]
    t[:, 1::3] = np.roll(t[:, 1::3], 1, axis=0)
    assert body(type(mesh)(mesh.p, t, sort_t=False))
    assert body(type(mesh)(mesh.p * [[-1.0], [1.0]], mesh.t))


def test_a_block_with_a_hole_is_accepted():
    mesh = MeshQuad.init_tensor(np.arange(4.0), np.arange(4.0))
    assert body(mesh.remove_elements(np.array([4])))


def test_a_narrow_notch_between_large_elements_is_accepted():
    mesh = MeshQuad.init_tensor(np.array([0.0, 1.0, 1.01, 2.0]), np.arange(3.0))
    assert body(mesh.remove_elements(np.array([3])))


def ring():
    def around(p):
        return p[1] * np.stack([np.sin(p[0]), np.cos(p[0])])

    return mapped(grid(np.linspace(-np.pi, np.pi, 13), np.array([1.0, 2.0])), around)


# -- folded ------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", [(0, 1, 3, 2), (0, 2, 1, 3), (0, 2, 3, 1), (1, 0, 2, 3)], ids=str)
@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_bow_ties_are_refused(order, unit):
    said = refusal(MeshQuad(unit * SQUARE, ROUND[list(order)]))
    assert said.startswith("element 0 is folded: its Jacobian goes from -")
    assert "must keep one sign; number its corners around the element" in said


@pytest.mark.parametrize("cells", ["straight", "curved"])
@pytest.mark.parametrize("at", [(0.4, 0.4), (0.45, 0.499), (0.5, 0.5), (-1.0, -1.0)])
def test_concave_quadrilaterals_are_refused(cells, at):
    """Node (1, 1) is drawn to the diagonal through its neighbours or beyond."""
    mesh = MeshQuad(np.where(SQUARE.sum(axis=0) == 2, np.array(at)[:, None], SQUARE), ROUND)
    mesh = MeshQuad2.from_mesh(mesh) if cells == "curved" else mesh
    assert refusal(mesh).startswith("element 0 is folded")


@pytest.mark.parametrize("node", range(9))
def test_any_scrambled_element_is_named(node):
    mesh = grid(np.arange(4.0), np.arange(4.0))
    t = mesh.t.copy()
    t[[1, 2], node] = t[[2, 1], node]
    assert refusal(MeshQuad(mesh.p, t)).startswith(f"element {node} is folded")


@pytest.mark.parametrize("kind", [MeshQuad2, MeshTri2])
@pytest.mark.parametrize("shift", [0.26, 0.3, -0.3, 0.6])
def test_nodes_within_sides_beyond_a_quarter_are_refused(kind, shift):
    """A node within a side folds it a quarter from the middle: d x / d xi = 1 +- 4 shift."""
    mesh = kind()
    p = mesh.p.copy()
    p[0, node_at(mesh, 0.5, 0.0)] += shift
    assert "is folded" in refusal(kind(p, mesh.t))
    p[0, node_at(mesh, 0.5, 0.0)] = 0.5 + np.sign(shift) * 0.2
    assert body(kind(p, mesh.t))


def test_a_side_that_bulges_through_its_element_is_refused():
    mesh = MeshQuad2()
    assert "is folded" in refusal(moved(mesh, node_at(mesh, 0.5, 0.0), 0.5, 0.9))


@pytest.mark.parametrize("offset", [0.0, 1e7])
@pytest.mark.parametrize("angle", [0.0, 0.5])
def test_flat_elements_are_refused(offset, angle):
    triangle = MeshTri(np.array([[0.0, 1.0, 3.0], [0.0, 0.0, 0.0]]), np.array([[0], [1], [2]]))
    square = MeshQuad(np.array([[0.0, 1.0, 3.0, 2.0], [0.0, 0.0, 0.0, 0.0]]), ROUND)
    for mesh in (turned(triangle, angle), turned(square, angle)):
        said = refusal(type(mesh)(mesh.p + offset, mesh.t))
        assert said == "element 0 is flat: its corners must not lie on one line"


def test_an_element_that_has_a_node_twice_is_refused():
    mesh = MeshQuad(SQUARE[:, :3], np.array([[0], [1], [2], [2]]))
    assert refusal(mesh).startswith("element 0 is folded")


@pytest.mark.parametrize("flip", [False, True])
def test_a_triangle_folded_over_its_neighbour_is_refused(flip):
    p = np.array([[0.0, 1.0, 0.0, 0.3], [0.0, 0.0, 1.0, 0.2]])
    t = np.array([[0, 1], [1, 2], [2, 3]])
    t[:, 1] = t[::-1, 1] if flip else t[:, 1]
    said = refusal(MeshTri(p, t, sort_t=not flip))
    assert said.startswith("elements 0 and 1 overlap at the edge they share, between nodes 1 and 2")


def test_a_square_folded_over_its_neighbour_is_refused():
    p = np.array([[0.0, 1.0, 1.0, 0.0, 0.2, 0.2], [0.0, 0.0, 1.0, 1.0, 0.2, 0.8]])
    t = np.array([[0, 1], [1, 4], [2, 5], [3, 2]])
    assert refusal(MeshQuad(p, t)).startswith("elements 0 and 1 overlap")


def test_an_element_given_twice_is_refused():
    mesh = grid(CELLS, CELLS)
    said = refusal(MeshQuad(mesh.p, np.hstack([mesh.t, mesh.t[:, [1]]])))
    assert "1" in said.split(" overlap")[0]
    assert "4" in said.split(" overlap")[0]


def test_an_inner_node_drawn_out_of_its_surroundings_is_refused():
    mesh = grid(CELLS, CELLS, "tri")
    assert "overlap" in refusal(moved(mesh, node_at(mesh, 1, 1), 2.5, 1.0))


# -- cracks ------------------------------------------------------------------------------------


@pytest.mark.parametrize("cells", ["quad", "tri"])
@pytest.mark.parametrize("offset", [0.0, 1e7])
@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_an_unmerged_node_is_refused(cells, offset, unit):
    """At every inner node of a graded mesh, and at a boundary node."""
    mesh = graded_square(cells)
    far = 2.0 + 2e-3
    inner = [n for n in range(25) if 0 < mesh.p[:, n].min() and mesh.p[:, n].max() < far]
    assert len(inner) == 9
    for node in inner:
        beside = np.flatnonzero((mesh.t == node).any(axis=0))
        right = mesh.p[0][mesh.t[:, beside]].mean(axis=0) > mesh.p[0, node]
        cracked = unmerged(mesh, node, beside[right])
        said = refusal(type(mesh)(unit * (cracked.p + offset), cracked.t))
        assert said.startswith(f"nodes {node} and 25 lie on one another")
        assert "merge them; surfaces meant to touch need two bodies" in said


def test_an_unmerged_node_read_from_a_file_of_few_digits_is_refused():
    mesh = turned(unmerged(grid(CELLS, CELLS), 4, [2, 3]), 0.3)
    mesh.p[:, -1] += 1e-5
    assert "lie on one another" in refusal(mesh)


def test_parts_with_unmerged_sides_are_refused():
    left, right = grid(CELLS, CELLS), grid(CELLS + 2.0, CELLS)
    assert "lie on one another" in refusal(joined(left, right))


@pytest.mark.parametrize("n", [2, 3])
@pytest.mark.parametrize(("offset", "unit"), [(0.0, 1.0), (1e7, 1.0), (0.0, 1e-9), (1e7, 1e9)])
def test_hanging_nodes_are_refused(n, offset, unit):
    """A square beside n of its height, merged where their corners meet."""
    squares = MeshQuad.init_tensor(np.array([1.0, 1.5]), np.linspace(0.0, 1.0, n + 1))
    p, t = squares.p, squares.t
    low, high = node_at(squares, 1, 0), node_at(squares, 1, 1)
    p = np.hstack([p, [[0.0, 0.0], [0.0, 1.0]]])
    size = p.shape[1]
    t = np.hstack([t, [[size - 2], [low], [high], [size - 1]]])
    between = [i for i in range(size) if p[0, i] == 1 and 0 < p[1, i] < 1]
    said = refusal(MeshQuad(unit * (p + offset), t))
    assert any(said.startswith(f"node {node} lies on the edge from node ") for node in between)
    assert "divide the element there" in said


@pytest.mark.parametrize("bulge", [-0.2, 0.0, 0.2])
@pytest.mark.parametrize(("lift", "said"), [(0.0, "lies on the edge"), (0.02, "shares no edge")])
def test_hanging_nodes_are_refused_on_curved_edges(bulge, lift, said):
    """Small elements stand on a large one, on the same parabola; lifted, they stand clear."""

    def bent(p):
        return np.stack([p[0], p[1] + bulge * 4 * p[0] * (1 - p[0])])

    large = mapped(MeshQuad(), bent)
    small = mapped(grid(np.linspace(0.1, 0.8, 4), np.array([1.0, 2.0]) + lift), bent)
    t = np.hstack([large.dofs.element_dofs, small.dofs.element_dofs + large.p.shape[1]])
    assert said in refusal(MeshQuad2(np.hstack([large.p, small.p]), t))


@pytest.mark.parametrize("cells", ["quad", "tri"])
def test_only_the_tip_of_a_crack_may_be_folded(cells):
    mesh = opened(grid(np.arange(7.0), np.arange(7.0), cells), "root", (0.0, 3.0), (3.0, 3.0))
    assert body(mesh, cracks=("root",))
    vertex = node_at(mesh, 1, 3)
    side = np.flatnonzero((mesh.facets == [[vertex], [node_at(mesh, 1, 4)]]).all(axis=0))
    mesh.p[:, mesh.dofs.facet_dofs[0, side]] = [[1.0], [3.25]]
    assert "folded" in refusal(mesh, cracks=("root",))


@pytest.mark.parametrize("cells", ["quad", "tri"])
def test_a_crack_at_a_reentrant_corner_leaves_each_element_on_its_side(cells):
    """Above the notch the body goes on below the line of the crack."""
    lines = np.arange(-3.0, 4.0)
    mesh = grid(lines, lines, cells)
    x, y = mesh.p[:, mesh.t].mean(axis=1)
    mesh = mesh.remove_elements(np.flatnonzero((x < 0) & (y < 0)))
    p = np.stack([mesh.p[0], mesh.p[1] + 1.5 * np.minimum(mesh.p[0], 0)])
    mesh = opened(type(mesh)(p, mesh.t), "root", (0.0, 0.0), (2.0, 0.0))
    assert body(mesh, cracks=("root",))
    shared = np.intersect1d(*(mesh.facets[:, mesh.boundaries[f"root_{s}"]]
                              for s in ("left", "right")))  # fmt: skip
    assert mesh.p[:, shared].T.tolist() == [[2.0, 0.0]]
    assert np.bincount(mesh.facets[:, mesh.boundary_facets()].ravel()).max() == 2


def test_nodes_on_a_face_of_a_crack_may_lie_on_the_other_one_alone():
    """A cut of one edge, not declared, starts at a face; it has no nodes at a quarter."""
    mesh = opened(grid(np.arange(7.0), np.arange(7.0)), "root", (0.0, 3.0), (3.0, 3.0))
    cut = opened(mesh, "cut", (1.0, 3.0), (1.0, 4.0))
    plain = MeshQuad(cut.p[:, : cut.nvertices], cut.t).with_boundaries(cut.boundaries)
    assert body(plain, cracks=("root", "cut"))
    assert "lie on one another" in refusal(plain, cracks=("root",))


def test_a_body_that_touches_itself_is_refused():
    """A clip, closed: the tip of one arm lies on the side of the other."""
    mesh = MeshQuad.init_tensor(np.arange(4.0), np.arange(4.0))
    x, y = mesh.p[:, mesh.t].mean(axis=1)
    clip = mesh.remove_elements(np.flatnonzero((x == 1.5) & (y > 1)))
    assert body(clip)
    tip = node_at(clip, 2.0, 3.0)
    said = refusal(moved(clip, tip, 1.0, 2.6))
    assert said.startswith(f"node {tip} lies on the edge from node")
    assert "two bodies and a contact pair" in said


# -- one piece ---------------------------------------------------------------------------------


def test_a_mesh_of_several_parts_is_refused():
    parts = joined(grid(np.arange(4.0), CELLS), grid(CELLS + 9.0, CELLS), grid(CELLS - 9.0, CELLS))
    said = refusal(parts)
    assert said.startswith(
        "element 6 belongs to a part of 4 elements that shares no edge with the other 10; "
        "a body must be one piece"
    )


def test_parts_that_share_only_a_node_are_refused():
    mesh = grid(np.arange(4.0), np.arange(4.0)).remove_elements(np.array([1, 2, 5, 3, 6, 7]))
    assert "shares no edge with the other" in refusal(mesh)


@pytest.mark.parametrize("cells", ["quad", "tri"])
def test_a_hinge_is_refused(cells):
    """Two holes that meet at a corner."""
    mesh = grid(np.arange(5.0), np.arange(5.0), cells)
    x, y = mesh.p[:, mesh.t].mean(axis=1)
    holes = (np.abs(x - 1.5) < 0.5) & (np.abs(y - 1.5) < 0.5)
    holes |= (np.abs(x - 2.5) < 0.5) & (np.abs(y - 2.5) < 0.5)
    mesh = mesh.remove_elements(np.flatnonzero(holes))
    said = refusal(type(mesh)(mesh.p, mesh.t))
    assert said.startswith(f"node {node_at(mesh, 2, 2)} at (2, 2) is a hinge")


# -- nodes -------------------------------------------------------------------------------------


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("state", ["plane_strain", "axisymmetric"])
def test_coordinates_that_are_not_finite_are_refused(value, state):
    mesh = moved(grid(CELLS, CELLS), 3, 1.0, value)
    said = refusal(mesh, kinematics=state)
    assert said == f"node 3 is at (1, {value:g}); coordinates must be finite"


@pytest.mark.parametrize("kind", [MeshQuad, MeshQuad2, MeshTri, MeshTri2])
def test_unused_nodes_are_refused(kind):
    mesh = kind()
    spare = kind(np.hstack([mesh.p, [[7.0], [8.0]]]), mesh.t)
    assert refusal(spare) == f"node {mesh.p.shape[1]} at (7, 8) belongs to no element: leave it out"


def test_nodes_that_are_not_there_are_refused():
    said = refusal(MeshQuad(SQUARE, np.array([[0], [1], [2], [9]])))
    assert said == "element 0 has nodes 0, 1, 2, 9; they must be in 0 to 3"


def test_meshes_in_space_are_refused():
    flat = MeshQuad(np.vstack([SQUARE, np.zeros((1, 4))]), np.arange(4)[:, None], validate=False)
    assert refusal(flat, element="quad8").startswith("node 0 has 3 coordinates")


def test_a_grid_bent_to_a_ring_is_merged_at_its_seam():
    angles = np.linspace(-np.pi, np.pi, 25)

    def around(p):
        return p[1] * np.stack([np.sin(p[0]), -np.cos(p[0])])

    slit = mapped(grid(angles, np.linspace(1.0, 2.0, 4)), around)
    assert "lie on one another" in refusal(slit)
    ring = merged(slit)
    whole = Body(name="ring", mesh=ring, material=STEEL)
    assert set(ring.boundaries["top"]) | set(ring.boundaries["bottom"]) == set(
        ring.boundary_facets()
    )
    assert not len(ring.boundaries["left"])
    assert Discretisation(whole).weights.sum() == pytest.approx(3 * np.pi, rel=1e-4)
