"""Which surfaces face each other, how far bodies may overlap, and where contact must not go."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver import (
    Amplitude,
    Body,
    ContactPair,
    Material,
    Model,
    ModelError,
    Moved,
    NotConverged,
    PathControl,
    RigidBody,
    Stage,
    System,
    solve,
)
from solver.fem.discretisation import Discretisation
from solver.fem.surface import extract
from solver.mesh import grid, mapped
from solver.model.rigid import arc
from solver.rolling.scenes.rolling import ROLLING
from tests.verification.bodies import block

pytestmark = pytest.mark.solves

STEEL = Material(youngs_modulus=2e5, poisson_ratio=0.3)
WALL = {"left": "x", "bottom": "xy"}


def named(body_mesh, **boundaries):
    """The mesh with the named parts of its outline, each a test of facet centres."""
    outside = body_mesh.boundary_facets()
    middle = body_mesh.p[:, body_mesh.facets[:, outside]].mean(axis=1)
    return body_mesh.with_boundaries(
        {n: outside[inside(middle)] for n, inside in boundaries.items()}
    )


def pressed(upper, lower, slave="bottom", master="top", **pair):
    contact = ContactPair(slave=(upper.name, slave), master=(lower.name, master), **pair)
    return Model(bodies=(upper, lower), contacts=(contact,))


def jaw():
    """A plate 4 mm thick between y = -4 and 0, its outline but for the left side one boundary."""
    mesh = grid(np.linspace(0.0, 12.0, 13), np.linspace(-4.0, 0.0, 5))
    mesh = named(mesh, outline=lambda x: x[0] > 1e-9, left=lambda x: x[0] < 1e-9)
    return Body(name="jaw", mesh=mesh, material=STEEL, supports={"left": "xy"})


@pytest.mark.parametrize("sliding", ["small", "finite"])
def test_an_edge_behind_the_slave_is_no_partner(sliding):
    """A block below the plate turns its bottom away from it: the plate's top is behind."""
    x, y = np.linspace(2.0, 8.0, 7), np.linspace(-12.0, -6.0, 7)
    low = block("low", x, y, supports={"top": "xy"}, pressure={"left": 1.0})
    with pytest.raises(ModelError, match="do not face each other"):
        System(pressed(low, jaw(), master="outline", sliding=sliding))


def roller(**motions):
    """A rigid roller of radius 2 mm, 3 mm beside the jaw's end and 1 mm above its top."""
    around = arc((17.0, 3.0), 2.0, (-np.pi + 0.3, -0.3), 24)
    body = RigidBody(name="roller", surfaces={"face": around}, centre=(17.0, 3.0), **motions)
    pair = ContactPair(slave=("jaw", "seat"), master=("roller", "face"))
    mesh = named(jaw().mesh, seat=lambda x: (x[1] > -1e-9) & (x[0] < 10.0))
    plate = replace(jaw(), mesh=mesh.with_boundaries({"left": lambda x: x[0] < 1e-9}))
    return Model(bodies=(plate,), rigid=(body,), contacts=(pair,))


STAGES = (Stage(name="across", target=1.0, steps=2), Stage(name="down", target=2.0, steps=4))
FIRST, THEN = Amplitude([0, 1], [0, 1]), Amplitude([1, 2], [0, 1])


def test_surfaces_that_come_to_face_each_other_later_are_a_pair():
    model = roller(x=Moved(value=-12.0, amplitude=FIRST), y=Moved(value=-1.1, amplitude=THEN))
    solution = solve(model, stages=STAGES)
    across, down = (solution.stages[name].state.contacts[0] for name in ("across", "down"))
    assert np.isfinite(across.gap).any() and not across.normal.any()
    assert down.normal.sum() > 10.0


@pytest.mark.parametrize("away", [12.0, 0.0])
def test_surfaces_that_never_face_each_other_are_not_ok(away):
    """Whether the body that is to come goes away, or only down beside the other."""
    model = roller(x=Moved(value=away, amplitude=FIRST), y=Moved(value=-1.1, amplitude=THEN))
    with pytest.raises(NotConverged, match=r"jaw\.seat and roller\.face never faced each other"):
        solve(model, stages=STAGES)


@pytest.mark.parametrize("sliding", ["small", "finite"])
def test_of_two_faces_of_an_outline_the_one_that_looks_back_is_met(sliding):
    """The plate's underside is nearer to no point of the block than its top is opposed to it."""
    top = block("top", np.linspace(2.0, 8.0, 7), np.linspace(0.0, 6.0, 7), supports={"left": "x"},
                pressure={"top": 1.0})  # fmt: skip
    solution = solve(pressed(top, jaw(), master="outline", sliding=sliding))
    assert solution.loaded.state.contacts[0].normal.sum() == pytest.approx(6.0, rel=1e-9)
    assert solution.audit().passed


@pytest.mark.parametrize("overlap", [0.5, 1.0, 2.0])
def test_a_large_overlap_is_refused_with_its_size(overlap):
    upper = block("upper", np.linspace(0.0, 6.0, 7), np.linspace(-overlap, 6 - overlap, 13),
                  supports={"top": "xy"})  # fmt: skip
    lower = block("lower", np.linspace(-3.0, 9.0, 13), np.linspace(-6.0, 0.0, 13), supports=WALL)
    with pytest.raises(ModelError, match=f"overlaps 'lower' by {overlap:.4g} mm") as refused:
        System(pressed(upper, lower))
    assert refused.value.field == "contacts"


# -- the end of a surface ------------------------------------------------------------------------


def plates(**boundary):
    """A pad of 6 mm on a plate of 12 mm; ``boundary`` cuts the surface of either."""
    pad = grid(np.linspace(0.0, 6.0, 13), np.linspace(0.0, 3.0, 7))
    plate = grid(np.linspace(0.0, 12.0, 25), np.linspace(-6.0, 0.0, 7))
    if "pad" in boundary:
        foot = named(pad, foot=lambda x: (x[1] < 1e-9) & (x[0] < boundary["pad"]))
        pad = pad.with_boundaries(dict(foot.boundaries))
    if "plate" in boundary:
        seat = named(plate, seat=lambda x: (x[1] > -1e-9) & (x[0] < boundary["plate"]))
        plate = plate.with_boundaries(dict(seat.boundaries))
    upper = Body(name="pad", mesh=pad, material=STEEL, supports={"left": "x"},
                 pressure={"top": 10.0})  # fmt: skip
    lower = Body(name="plate", mesh=plate, material=STEEL, supports=WALL)
    return pressed(
        upper, lower, "foot" if "pad" in boundary else "bottom",
        "seat" if "plate" in boundary else "top",
    )  # fmt: skip


@pytest.mark.parametrize("cut", [{"pad": 4.0}, {"plate": 4.0}], ids=["slave", "master"])
def test_contact_at_the_end_of_a_surface_that_goes_on_is_never_ok(cut):
    (body,) = cut
    with pytest.raises(NotConverged, match=f"end of the surface of body '{body}'"):
        solve(plates(**cut))


@pytest.mark.parametrize("cut", [{}, {"plate": 8.0}], ids=["corner", "beyond contact"])
def test_contact_may_come_to_a_corner(cut):
    assert solve(plates(**cut)).audit().passed


def test_a_surface_may_end_where_its_partner_does():
    """The wide body's boundary is cut where the narrow body has its corner."""
    wide = grid(np.linspace(0.0, 12.0, 25), np.linspace(0.0, 3.0, 7))
    foot = named(wide, foot=lambda x: (x[1] < 1e-9) & (x[0] < 6.0))
    wide = wide.with_boundaries(dict(foot.boundaries))
    upper = Body(name="wide", mesh=wide, material=STEEL, supports={"left": "x"},
                 pressure={"top": 10.0})  # fmt: skip
    lower = block("narrow", np.linspace(0.0, 6.0, 13), np.linspace(-6.0, 0.0, 7), supports=WALL)
    control = PathControl(load_step=0.5)
    solution = solve(pressed(upper, lower, slave="foot"), control=control)
    assert solution.loaded.state.contacts[0].normal[-1] > 0


@pytest.mark.parametrize("load_ratio", [0.5, 2.7, 6.0, 8.0, 10.0])
def test_a_sinking_wheel_has_room_for_its_contact(load_ratio):
    """Measured reach ahead of the axle: 2.9 half-widths at a load ratio of 6, 4.3 at 10."""
    margin = ROLLING.parameters(load_ratio=load_ratio, element_size=0.3)
    assert margin.margin / margin.half_width >= max(2.5, 0.6 * load_ratio)


@pytest.mark.parametrize("split", ["slave", "master"])
def test_a_surface_may_go_on_as_that_of_another_pair(split):
    """One side of two boundaries with different friction, both against the same body."""

    def halves(mesh, y):
        left = {"near": lambda x: (np.abs(x[1] - y) < 1e-9) & (x[0] < 3.0)}
        right = {"far": lambda x: (np.abs(x[1] - y) < 1e-9) & (x[0] > 3.0) & (x[0] < 6.0)}
        return mesh.with_boundaries(dict(named(mesh, **left, **right).boundaries))

    pad = grid(np.linspace(0.0, 6.0, 13), np.linspace(0.0, 3.0, 7))
    plate = grid(np.linspace(0.0, 6.0, 13), np.linspace(-6.0, 0.0, 7))
    pad, plate = (halves(pad, 0.0), plate) if split == "slave" else (pad, halves(plate, 0.0))
    upper = Body(name="pad", mesh=pad, material=STEEL, supports={"left": "x"},
                 pressure={"top": 10.0})  # fmt: skip
    lower = Body(name="plate", mesh=plate, material=STEEL, supports=WALL)
    pairs = tuple(
        ContactPair(
            slave=("pad", part if split == "slave" else "bottom"),
            master=("plate", "top" if split == "slave" else part),
            friction=friction,
        )
        for part, friction in (("near", 0.1), ("far", 0.3))
    )
    solution = solve(Model(bodies=(upper, lower), contacts=pairs))
    total = sum(c.normal.sum() for c in solution.loaded.state.contacts)
    assert total == pytest.approx(60.0, rel=1e-9)


def test_arcs_divided_differently_do_not_overlap():
    """Curved edges fit each other far better than their chords do."""

    def ring(name, radii, edges, **fields):
        def to_ring(p):
            return p[0] * np.stack([np.cos(p[1]), np.sin(p[1])])

        mesh = mapped(grid(np.array(radii), np.linspace(0.0, np.pi, edges + 1)), to_ring)
        return Body(name=name, mesh=mesh, material=STEEL, **fields)

    inner = ring("inner", (0.8, 1.0), 3, supports={"left": "xy"})
    outer = ring("outer", (1.0, 1.2), 4, pressure={"right": 1.0}, supports={"top": "xy"})
    System(pressed(outer, inner, slave="left", master="right"))


@pytest.mark.parametrize("edges", [6, 8, 12])
def test_a_coarse_curve_goes_on_as_a_fine_one_does(edges):
    """Tangents at an end tell a curve from a corner, chords of 45 degrees do not."""

    def around(p):
        return p[1] * np.stack([np.sin(p[0]), -np.cos(p[0])])

    ring = mapped(grid(np.linspace(-2.3, 2.3, edges + 1), np.linspace(0.5, 1.0, 3)), around)
    part = named(ring, piece=lambda x: (np.hypot(*x) > 0.9) & (np.abs(x[0]) < 0.8) & (x[1] < 0))
    body = Body(name="ring", mesh=part, material=STEEL)
    assert extract(Discretisation(body), "piece").goes_on == (True, True)


def test_pairs_that_touch_and_carry_nothing_pass_the_audit():
    """Two blocks side by side, pressed along the face they share."""
    y = np.linspace(0.0, 4.0, 5)
    material = Material(youngs_modulus=2e5, poisson_ratio=0.0)
    left, right = (
        block(name, x, y, material=material, supports={"bottom": "xy"}, pressure={"top": 50.0})
        for name, x in (("left", np.linspace(-4, 0, 5)), ("right", np.linspace(0, 4, 4)))
    )
    check = solve(pressed(left, right, slave="right", master="left", friction=0.3)).audit()
    assert check.passed, check.violations
