"""Links against closed forms: bending by moments, ties, springs, rigid boundaries, a bolt."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from solver import (
    Amplitude,
    Body,
    ContactPair,
    Displacement,
    LimitLoad,
    Link,
    Model,
    ModelError,
    Moved,
    Pressure,
    Pushed,
    RigidBody,
    Solution,
    Stage,
    System,
    Traction,
    solve,
)
from solver.audit import links
from solver.contact.parting import parted
from solver.mesh import grid, mapped, merged, ring, within
from solver.model.rigid import line
from studies.scenes.scene import read_scene
from tests.verification.bodies import E, bent, block, cells, sector, steel

Array = NDArray[np.float64]

SCENES = Path(__file__).parents[2] / "data/scenes"
YIELD, HEIGHT = 300.0, 10.0


def points(solution: Solution, name: str, stage: str) -> tuple[Array, Array]:
    """Return positions (2, n) and Mandel stress (4, n) of the integration points."""
    response = solution.system.state(name, solution.stages[stage])
    return solution.system.positions(name), response.stress


# -- bending -------------------------------------------------------------------------------------


@pytest.mark.parametrize("ratio", [0.8, 1.2, 1.4])
def test_a_beam_bent_by_moments_has_the_curvature_and_stress_of_its_closed_form(
    ratio: float,
) -> None:
    """A core of the height h sqrt(3 - 2 ratio) stays elastic (R. Hill, Plasticity, 1950, p. 81)."""
    scene = read_scene(SCENES / "bending.toml")
    parameters = scene.parameters(ratio=ratio, parts=24)
    (lap,) = scene.program(parameters).laps
    found = solve(scene.model(parameters), stages=lap.stages)
    core = np.sqrt(3 - 2 * ratio) if ratio > 1 else 1 / ratio
    curvature = YIELD / (E * HEIGHT / 2 * core)
    assert found.motion("end", "bent").rotation / 5.0 == pytest.approx(curvature, rel=5e-3)
    assert found.reaction("end", "bent")[2] == pytest.approx(ratio * YIELD * HEIGHT**2 / 6)
    left = curvature - ratio * YIELD / (E * HEIGHT / 2)
    close = pytest.approx(left, abs=5e-3 * curvature)
    assert found.motion("end", "released").rotation / 5.0 == close
    (_, y), bent_ = points(found, "beam", "bent")
    exact = -YIELD * np.clip(2 * y / (HEIGHT * core), -1, 1)
    assert np.abs(bent_[0] - exact).max() < 5e-3 * YIELD
    _, released = points(found, "beam", "released")
    assert np.abs(released[0] - exact - ratio * YIELD * 2 * y / HEIGHT).max() < 5e-3 * YIELD
    for stage in ("bent", "released"):
        assert found.audit(stage).passed


def test_a_strip_bends_until_its_measured_stress_is_in_balance() -> None:
    """It keeps the stress of the table without its mean and its moment, exact to rounding."""
    scene = read_scene(SCENES / "peened.toml")
    (lap,) = scene.program(scene.parameters()).laps
    found = solve(scene.model(scene.parameters()), stages=lap.stages)
    depth, given = np.loadtxt(SCENES / "peened.csv", delimiter=",", skiprows=1).T
    fine = np.linspace(-1, 1, 20001)
    stress = np.interp(fine, depth, given)
    mean, bend = (np.trapezoid(stress * by, fine) for by in (0.5, 1.5 * fine))
    (_, y), left = points(found, "strip", "free")
    assert np.abs(left[0] - (np.interp(y, depth, given) - mean - bend * y)).max() < 1e-4
    assert np.abs(left[[1, 3]]).max() < 1e-6
    assert found.motion("end", "free").rotation == pytest.approx(5.0 * bend / E, rel=1e-6)
    assert found.audit("free").passed


def test_a_beam_bears_no_moment_above_the_plastic_one() -> None:
    scene = read_scene(SCENES / "bending.toml")
    model = scene.model(scene.parameters(parts=8))
    end, wall = model.rigid
    turned = Pushed(value=1.7 * YIELD * HEIGHT**2 / 6)
    end = replace(end, x=Pushed(), rotation=turned)
    with pytest.raises(LimitLoad) as found:
        solve(replace(model, rigid=(end, wall)), stages=[Stage(name="bent", target=1.0, steps=10)])
    assert 1.7 * found.value.reached == pytest.approx(1.5, rel=0.02)


@pytest.mark.parametrize("centre", [(0.0, 0.0), (1 / 3, 2.0)])
def test_a_moment_that_is_distributed_bends_like_a_linear_traction(
    centre: tuple[float, float],
) -> None:
    """Wherever the centre of the wall is: along its boundary a rotation may be a translation."""
    beam = block("beam", np.linspace(0, 20, 9), np.linspace(-5, 5, 5), kinematics="plane_stress",
                 supports={"left": "x"})  # fmt: skip
    moment = RigidBody(name="end", centre=(20.0, 0.0), x=Pushed(), y=Pushed(),
                       rotation=Pushed(value=5000.0))  # fmt: skip
    wall = RigidBody(name="wall", centre=centre)
    model = Model(
        bodies=(beam,),
        rigid=(moment, wall),
        links=(
            Link(slave=("beam", "right"), rigid="end", distributed=True),
            Link(slave=("beam", "left"), rigid="wall", components="y", distributed=True),
        ),
    )
    found = solve(model)
    _, y = found.nodes("beam")
    stress = found.stress("beam", "loaded")
    exact = 5000.0 * 12 / HEIGHT**3
    assert np.allclose(stress[0], -exact * y, atol=1e-8 * exact)
    assert np.allclose(stress[[1, 3]], 0.0, atol=1e-8 * exact)
    assert found.motion("end").rotation == pytest.approx(exact / E * 20.0, rel=1e-9)
    assert found.audit().passed


def test_a_force_that_is_distributed_around_an_axis_leaves_radial_motion_free() -> None:
    """It is a constant traction: of radial motions and rotations of a ring there is no mean."""
    cylinder = block("bar", np.linspace(0, 5, 6), np.linspace(0, 5, 4), kinematics="axisymmetric",
                     supports={"bottom": "y"})  # fmt: skip
    pull = RigidBody(name="cap", centre=(0.0, 5.0), y=Pushed(value=100.0 * np.pi * 5.0**2))
    link = Link(slave=("bar", "top"), rigid="cap", distributed=True)
    found = solve(Model(bodies=(cylinder,), rigid=(pull,), links=(link,)))
    exact = np.array([0.0, 100.0, 0.0, 0.0])[:, None]
    assert np.allclose(found.stress("bar", "loaded"), exact, atol=1e-8 * 100.0)
    assert len(found.system.links) == 1
    assert found.audit().passed
    with pytest.raises(ModelError, match=r"links\[0\].components = 'x': must include y"):
        System(Model(bodies=(cylinder,), rigid=(pull,), links=(replace(link, components="x"),)))


# -- along normals and tangents --------------------------------------------------------------------


def lame(pressure: float, foundation: float) -> float:
    """Return how far the outside of a ring of the radii 5 and 10 moves on springs all around [mm].

    Plane strain: u = (1 + nu)/E ((1 - 2 nu) A r + C / r), radial stress A - C / r^2.
    """
    a, b, nu = 5.0, 10.0, 0.3

    def outside(p: float, q: float) -> float:
        A, C = (p * a**2 - q * b**2) / (b**2 - a**2), (p - q) * a**2 * b**2 / (b**2 - a**2)
        return (1 + nu) / E * ((1 - 2 * nu) * A * b + C / b)

    alone, eased = outside(pressure, 0.0), -outside(0.0, 1.0)
    return alone / (1 + foundation * eased)


@pytest.mark.parametrize("element", ["quad8", "tri6"])
def test_springs_along_the_normal_carry_a_ring_as_its_closed_form_says(element: str) -> None:
    ring = sector(np.linspace(5.0, 10.0, 7), 12, element, material=steel(),
                  loads=(Pressure(boundary="left", value=100.0),))  # fmt: skip
    wall = RigidBody(name="wall")
    sprung = Link(slave=("ring", "right"), components="normal", stiffness=2e4)
    for link, rigid, exact in (
        (sprung, (), lame(100.0, 2e4)),
        (replace(sprung, rigid="wall"), (wall,), lame(100.0, 2e4)),
        (Link(slave=("ring", "right"), rigid="wall", components="normal"), (wall,), 0.0),
        (Link(slave=("ring", "right"), components="normal"), (), lame(100.0, 0.0)),
        (replace(sprung, components="tangential"), (), lame(100.0, 0.0)),
    ):
        found = solve(Model(bodies=(ring,), rigid=rigid, links=(link,)))
        x, u = found.nodes("ring"), found.displacement("ring", "loaded")
        edge = found.system.full("ring").boundary_nodes("right")
        radial = (x * u).sum(axis=0)[edge] / 10.0
        assert radial == pytest.approx(exact, rel=2e-3, abs=2e-3 * lame(100.0, 0.0))
        audit = found.audit()
        assert audit.passed and audit.figures["audit_links"] < 1e-6, audit.violations


def test_a_link_that_holds_another_component_than_it_says_fails_its_audit() -> None:
    ring = sector(np.linspace(5.0, 10.0, 3), 4, material=steel(),
                  loads=(Pressure(boundary="left", value=100.0),))  # fmt: skip
    sprung = Link(slave=("ring", "right"), components="normal", stiffness=2e4)
    found = solve(Model(bodies=(ring,), links=(sprung,)))
    for other in (replace(sprung, components="tangential"), replace(sprung, stiffness=2.2e4)):
        object.__setattr__(found.system.model, "links", (other,))
        assert found.audit().figures["audit_links"] > 1e-2


@pytest.mark.parametrize("components", ["normal", "xy"])
def test_springs_around_a_hole_are_audited_node_by_node(components: str) -> None:
    """Their forces have no resultant."""
    angles = np.linspace(0.0, 2 * np.pi, 13)
    ring = merged(mapped(grid(np.array([5.0, 10.0]), angles),
                         lambda p: p[0] * np.stack([np.cos(p[1]), np.sin(p[1])])))  # fmt: skip
    body = Body(name="ring", mesh=ring, material=steel(),
                loads=(Pressure(boundary="left", value=100.0),))  # fmt: skip
    sprung = Link(slave=("ring", "right"), components=components, stiffness=2e4)
    held = Link(slave=("ring", "right"), components="tangential", stiffness=2e4)
    found = solve(Model(bodies=(body,), links=(sprung, held)))
    audit = found.audit()
    assert audit.passed and audit.figures["audit_links"] < 1e-6, audit.violations
    object.__setattr__(found.system.model, "links", (replace(sprung, stiffness=2.2e4), held))
    assert found.audit().figures["audit_links"] > 1e-2


# -- ties ----------------------------------------------------------------------------------------


def slanted(name: str, x: Array, y: Array, element: str, **fields: Any) -> Body:
    """Return a body whose side at y = 1 is inclined."""

    def lifted(p: Array) -> Array:
        return np.stack([p[0], p[1] + 0.3 * (p[0] - 2) * (1 - np.abs(p[1] - 1))])

    mesh = bent(grid(x, y, cells(element)), lifted)
    return Body(name=name, mesh=mesh, element=element, material=steel(YIELD), **fields)


@pytest.mark.parametrize("element", ["quad8", "quad4", "tri6"])
def test_a_constant_stress_passes_a_tie_of_unequal_meshes(element: str) -> None:
    lower = slanted("lower", np.linspace(0, 4, 5), np.linspace(0, 1, 3), element,
                    supports={"bottom": "y", "left": "x"})  # fmt: skip
    upper = slanted("upper", np.linspace(0, 4, 8), np.linspace(1, 2, 4), element,
                    pressure={"top": -200.0})  # fmt: skip
    tie = Link(slave=("upper", "bottom"), master=("lower", "top"))
    found = solve(Model(bodies=(lower, upper), links=(tie,)))
    for name in ("lower", "upper"):
        _, stress = points(found, name, "loaded")
        assert np.abs(stress - [[0], [200.0], [0], [0]])[[0, 1, 3]].max() < 1e-7
    assert found.audit().passed


def test_two_tied_bodies_touch_another_as_one_body_does() -> None:
    """The tie holds the upper half, contact with friction alone holds both."""
    low, high = np.linspace(0, 4, 5), np.linspace(4, 8, 5)
    x = np.linspace(-5, 5, 11)
    ground = block("ground", np.linspace(-20, 20, 21), np.linspace(-20, 0, 9),
                   supports={"bottom": "xy"})  # fmt: skip
    loads = (Pressure(boundary="top", value=50.0),)
    pair = ContactPair(slave=("one", "bottom"), master=("ground", "top"), friction=0.3)
    whole = block("one", x, np.append(low, high[1:]), loads=loads)
    one = solve(Model(bodies=(whole, ground), contacts=(pair,)))
    halves = block("one", x, low), block("two", x, high, loads=loads)
    tie = Link(slave=("one", "top"), master=("two", "bottom"))
    two = solve(Model(bodies=(*halves, ground), contacts=(pair,), links=(tie,)))
    pressure, tied = one.contact().pressure, two.contact().pressure
    assert np.abs(tied - pressure).max() < 0.01 * pressure.max()
    normal = two.loaded.state.contacts[0].normal
    assert normal.sum() == pytest.approx(500.0)
    assert one.audit().passed
    assert two.audit().passed


def test_tied_bodies_that_overlap_another_are_moved_apart_from_it_together() -> None:
    ground = block("ground", np.linspace(-6, 6, 7), np.linspace(-6, 0, 4),
                   supports={"bottom": "xy"})  # fmt: skip
    x = np.linspace(-2, 2, 5)
    lower = block("lower", x, np.linspace(0, 1, 3) - 0.01)
    upper = block("upper", x, np.linspace(1, 2, 3) - 0.01)
    pair = ContactPair(slave=("lower", "bottom"), master=("ground", "top"), friction=0.3)
    tie = Link(slave=("upper", "bottom"), master=("lower", "top"))
    system = System(Model(bodies=(lower, upper, ground), contacts=(pair,), links=(tie,)))
    state = parted(system, system.initial())
    assert not system.overlaps(state)
    for name in ("lower", "upper"):
        assert np.allclose(system.displacement(name, state).reshape(-1, 2), [0.0, 0.01])
    assert np.allclose(system.links.off(state.u, state.links), 0.0)


def test_tied_bodies_stay_where_they_are_when_contact_leaves_them() -> None:
    """Nothing holds them then, and no load acts; the tie keeps them together."""
    there = Amplitude(np.arange(3.0), np.array([1.0, 1.0, 0.0]))
    x = np.linspace(-2, 2, 5)
    ground = block("ground", np.linspace(-6, 6, 13), np.linspace(-6, 0, 7),
                   supports={"bottom": "xy"})  # fmt: skip
    pressed = Amplitude(np.arange(3.0), np.array([0.0, 1.0, 0.0]))
    load = Pressure(boundary="top", value=50.0, amplitude=pressed)
    lower = block("lower", x, np.linspace(0, 1, 3))
    upper = block("upper", np.linspace(-2, 2, 8), np.linspace(1, 2, 4), loads=(load,))
    tie = Link(slave=("upper", "bottom"), master=("lower", "top"))
    pair = ContactPair(slave=("lower", "bottom"), master=("ground", "top"), friction=0.3,
                       presence=there)  # fmt: skip
    stages = (Stage(name="on", target=1.0, steps=2), Stage(name="off", target=2.0, steps=2))
    model = Model(bodies=(lower, upper, ground), contacts=(pair,), links=(tie,))
    found = solve(model, stages=stages)
    for name in ("lower", "upper"):
        assert np.abs(found.stress(name, "off")).max() < 1e-6
        assert np.abs(found.displacement(name, "off")).max() < 0.1
    for stage in ("on", "off"):
        assert found.audit(stage).passed


# -- springs and plane boundaries ----------------------------------------------------------------


def test_a_block_settles_on_its_springs() -> None:
    """Two blocks on a foundation, with springs between them, and no other support across."""
    sides = {"left": "x"}
    lower = block("lower", np.linspace(0, 4, 5), np.linspace(0, 1, 3), supports=sides)
    upper = block("upper", np.linspace(0, 4, 8), np.linspace(1, 2, 4), supports=sides,
                  pressure={"top": 100.0})  # fmt: skip
    model = Model(
        bodies=(lower, upper),
        links=(
            Link(slave=("lower", "bottom"), components="y", stiffness=400.0),
            Link(slave=("upper", "bottom"), master=("lower", "top"), stiffness=2000.0),
        ),
    )
    found = solve(model)
    squeezed = 100.0 * (1 - 0.3**2) / E  # of one block, 1 mm high
    bottom = found.at("lower", [[2.0], [0.0]], "loaded")["displacement"][1, 0]
    top = found.at("upper", [[2.0], [2.0]], "loaded")["displacement"][1, 0]
    assert bottom == pytest.approx(-100.0 / 400.0, rel=1e-9)
    assert top == pytest.approx(bottom - 100.0 / 2000.0 - 2 * squeezed, rel=1e-9)
    audit = found.audit()
    assert audit.passed
    assert audit.figures["audit_energy"] < 1e-9
    springs = found.system.links.energy(found.loaded.state.links)
    assert springs == pytest.approx(4.0 * 100.0**2 / 2 * (1 / 400.0 + 1 / 2000.0), rel=1e-9)


def test_springs_keep_their_energy_when_bodies_are_separated() -> None:
    """What the tool presses springs back; the energy of its contact is given off."""
    body = block("block", np.linspace(0, 4, 3), np.linspace(0, 2, 3), supports={"left": "x"})
    tool = RigidBody(name="tool", surfaces={"face": line((-0.5, 2.0), (4.5, 2.0))},
                     y=Moved(value=-0.01))  # fmt: skip
    model = Model(
        bodies=(body,),
        rigid=(tool,),
        contacts=(ContactPair(slave=("block", "top"), master=("tool", "face")),),
        links=(Link(slave=("block", "bottom"), components="y", stiffness=1000.0),),
    )
    stages = (Stage(name="on", target=1.0), Stage(name="off", target=0.9, apart=True))
    found = solve(model, stages=stages)
    for stage in ("on", "off"):
        assert found.audit(stage).figures["audit_energy"] < 1e-9
    assert found.stages["off"].energy.contact > 0.1 * found.stages["on"].energy.external


@pytest.mark.parametrize("stiffness", [1e-3, 1.0])
def test_a_coarse_ring_on_soft_springs_finds_its_place_between_plates(stiffness: float) -> None:
    """Its gaps change as it turns, which the springs let it do: see `eliminated`."""
    force, size = 0.2, 1 / 6
    low, high = line((1.0, -1.0), (-1.0, -1.0)), line((-1.0, 1.0), (1.0, 1.0))
    plates = (RigidBody(name="low", surfaces={"face": low}),
              RigidBody(name="high", surfaces={"face": high}, y=Pushed(value=-force)))  # fmt: skip
    mesh = ring((0.6, 1.0), size=size).with_boundaries({
        "top": lambda x: (x[1] > 0.3) & (np.hypot(*x) > 0.95),
        "bottom": lambda x: (x[1] < -0.3) & (np.hypot(*x) > 0.95),
    })  # fmt: skip
    found = solve(Model(
        bodies=(Body(name="ring", mesh=mesh, material=steel()),), rigid=plates,
        links=(Link(slave=("ring", "inner"), stiffness=stiffness),),
        contacts=tuple(ContactPair(slave=("ring", side), master=(plate, "face"), friction=0.3)
                       for side, plate in (("top", "high"), ("bottom", "low"))),
    ))  # fmt: skip
    most = size**2 / 2  # a hat reaches so far from the plate: by less the ring goes down
    springs = force - found.reaction("low")[1]
    assert 0 <= springs < most * stiffness * 2 * np.pi * 0.6
    (told,) = {text.split()[0] for text in found.audit("loaded").violations}
    assert told == "audit_contact_resolution"


def test_a_boundary_kept_plane_takes_the_mean_of_its_load() -> None:
    body = block("block", np.linspace(0, 10, 6), np.linspace(0, 5, 4),
                 supports={"bottom": "y", "left": "x"},
                 loads=(Pressure(boundary="top", value=lambda x: 20.0 * x[0]),))  # fmt: skip
    plane = Link(slave=("block", "top"), components="y")
    found = solve(Model(bodies=(body,), links=(plane,)))
    _, y = found.nodes("block")
    sunk = found.displacement("block", "loaded")[1, y == 5.0]
    assert np.ptp(sunk) < 1e-12 * np.abs(sunk).max()
    assert sunk[0] == pytest.approx(-100.0 * 5 * (1 - 0.3**2) / E, rel=1e-9)
    assert found.audit().passed


def test_a_prescribed_rotation_turns_a_free_body_without_stress() -> None:
    body = block("block", np.linspace(0, 10, 4), np.linspace(0, 5, 3), condense=False)
    tool = RigidBody(name="tool", centre=(2.0, 1.0), x=Moved(value=0.1), rotation=Moved(value=1e-3))
    found = solve(Model(bodies=(body,), rigid=(tool,),
                        links=(Link(slave=("block", "left"), rigid="tool"),)))  # fmt: skip
    x, y = found.nodes("block")
    moved = np.stack([0.1 - 1e-3 * (y - 1.0), 1e-3 * (x - 2.0)])
    assert np.allclose(found.displacement("block", "loaded"), moved, atol=1e-10)
    assert np.abs(found.stress("block", "loaded")).max() < 1e-6
    assert found.audit().passed
    assert not found.audit().outside
    far = replace(tool, rotation=Moved(value=0.2))
    model = replace(found.system.model, rigid=(far,))
    *_, told = solve(model).audit().outside
    assert told.startswith("tool rotates its linked boundaries by 0.2 rad")


# -- a bolt --------------------------------------------------------------------------------------


def test_a_bolt_keeps_its_preload_and_the_shortening_of_its_cut() -> None:
    """A bar of 20 mm between two walls, cut in the middle, tightened, then pulled by 0.02 mm."""
    area, force, pull = 4.0, 400.0, 0.02
    steps = Amplitude(np.arange(3.0), np.array([0.0, 0.0, 1.0]))
    tightening = Amplitude(np.arange(2.0), np.array([0.0, 1.0]))
    lower = block("lower", np.linspace(-2, 2, 5), np.linspace(0, 10, 6), kinematics="plane_stress",
                  supports={"bottom": "y"})  # fmt: skip
    upper = block("upper", np.linspace(-2, 2, 4), np.linspace(10, 20, 6), kinematics="plane_stress",
                  loads=(Displacement(boundary="top", y=pull, amplitude=steps),))  # fmt: skip
    bolt = RigidBody(name="bolt", centre=(0.0, 10.0),
                     y=Pushed(value=-force, amplitude=tightening, locked=1.0))  # fmt: skip
    middle = RigidBody(name="middle")
    links = (
        Link(slave=("upper", "bottom"), master=("lower", "top"), rigid="bolt"),
        Link(slave=("lower", "bottom"), rigid="middle", components="x", distributed=True),
    )
    stages = (
        Stage(name="tightened", target=1.0, steps=2),
        Stage(name="pulled", target=2.0, steps=2),
    )
    model = Model(bodies=(lower, upper), rigid=(bolt, middle), links=links)
    found = solve(model, stages=stages)
    cut = -force / area * 20 / E
    for stage, stress in (("tightened", force / area), ("pulled", force / area + E * pull / 20)):
        assert found.motion("bolt", stage).y == pytest.approx(cut, rel=1e-9)
        assert found.reaction("bolt", stage)[1] == pytest.approx(-stress * area, rel=1e-9)
        for name in ("lower", "upper"):
            assert np.allclose(points(found, name, stage)[1][1], stress, rtol=1e-9)
        assert found.audit(stage).passed


def test_the_bolt_of_the_scene_file_shares_a_pull_with_its_gasket() -> None:
    scene = read_scene(SCENES / "bolt.toml")
    (record,) = scene.path(scene.parameters(), [None], lambda share: None)
    nut, crane = (record.fields["reaction_y"][1][k] for k in (4, 5))
    assert record.status.name == "OK"
    assert nut[1] == pytest.approx(-20000.0)
    assert crane[2] == pytest.approx(8000.0)
    assert 20000.0 < -nut[2] < 24000.0


@pytest.mark.parametrize("distributed", [False, True])
def test_a_force_on_a_boundary_that_supports_hold_is_that_of_the_supports(
    distributed: bool,
) -> None:
    held = block("block", np.linspace(0, 4, 3), np.linspace(0, 4, 3),
                 supports={"bottom": "xy", "top": "xy"})  # fmt: skip
    plate = RigidBody(name="plate", centre=(2.0, 4.0), y=Pushed(value=-100.0),
                      x=Pushed(value=5.0), rotation=Pushed(value=3.0))  # fmt: skip
    link = Link(slave=("block", "top"), rigid="plate", distributed=distributed)
    found = solve(Model(bodies=(held,), rigid=(plate,), links=(link,)))
    assert found.motion("plate") == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)
    assert not found.stress("block", "loaded").any()
    assert found.reaction("plate") == pytest.approx((5.0, -100.0, 3.0))
    assert found.audit().passed


# -- the audit, and what is refused --------------------------------------------------------------


@pytest.fixture(scope="module")
def tied() -> Solution:
    """A block on springs with a tied block on it."""
    lower = block("lower", np.linspace(0, 4, 5), np.linspace(0, 1, 3), supports={"left": "x"})
    upper = block("upper", np.linspace(0, 4, 8), np.linspace(1, 2, 4),
                  pressure={"top": 100.0})  # fmt: skip
    links = (Link(slave=("lower", "bottom"), components="y", stiffness=400.0),
             Link(slave=("upper", "bottom"), master=("lower", "top")))  # fmt: skip
    return solve(Model(bodies=(lower, upper), links=links))


@pytest.mark.parametrize("number", [0, 1])
def test_the_audit_finds_forces_and_motions_that_a_link_does_not_have(
    tied: Solution, number: int
) -> None:
    """Forces 1 % too large are out of balance; moved upper bodies are no longer tied."""
    loaded = tied.loaded
    whose = tied.system.links.whose == number
    forces = np.where(whose, 1.01, 1.0) * loaded.state.links
    wrong = replace(loaded, state=replace(loaded.state, links=forces))
    found = replace(tied, stages=tied.stages | {"loaded": wrong}).audit()
    assert any("audit_residual" in text for text in found.violations)
    lower, upper = loaded.state.u
    u = (1.01 * lower, upper) if number == 0 else (lower, upper + 0.01 * np.abs(upper).max())
    wrong = replace(loaded, state=replace(loaded.state, u=u))
    found = replace(tied, stages=tied.stages | {"loaded": wrong}).audit()
    assert any("audit_links" in text for text in found.violations)


def test_a_tie_with_a_slave_of_much_longer_edges_passes() -> None:
    """Its conditions hold in the mean over edges along which the master bends in eight pieces."""
    lower = block("lower", np.linspace(0, 4, 9), np.linspace(0, 1, 3), supports={"bottom": "xy"})
    upper = block("upper", np.array([0.9, 2.9]), np.linspace(1, 2, 4),
                  loads=(Traction(boundary="top", x=50.0, y=-100.0),))  # fmt: skip
    tie = Link(slave=("upper", "bottom"), master=("lower", "top"))
    audit = solve(Model(bodies=(lower, upper), links=(tie,))).audit()
    assert audit.passed, audit.violations
    assert 0 < audit.figures["audit_links"] < 3e-4


def test_places_of_long_boundaries_are_looked_for_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """The distances of all places from all pieces take gigabytes on a thousand edges."""
    x = np.linspace(0.0, 10.0, 401)
    ends = np.array([[x[:-1], 0 * x[1:]], [x[1:], 0 * x[1:]]])
    X = ends.mean(axis=0)
    master = links._Sampled(X, X**2, np.ones(400), ends, ends**2)
    places = np.stack([np.linspace(-1.0, 11.0, 450), np.full(450, 0.1)])
    together = links._facing_few(places, master)
    monkeypatch.setattr(links, "_PAIRS", 10_000)
    tracemalloc.start()
    found = links._facing(places, master)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 2e6
    for one, other in zip(found, together, strict=True):
        np.testing.assert_array_equal(one, other)
    away, moved = found
    inside = (places[0] >= 0) & (places[0] <= 10)
    assert away[inside] == pytest.approx(0.1) and np.isinf(away[~inside]).all()
    np.testing.assert_allclose(moved[0, inside], places[0, inside] ** 2, atol=1e-3)


PLATE = RigidBody(name="plate")
SLAVE = {"slave": ("block", "top")}
WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "body": ({"slave": ("blok", "top")}, r"links\[0\].slave = 'blok': must be one of"),
    "boundary": ({"slave": ("block", "tip")}, r"links\[0\].slave = 'tip': must name a boundary"),
    "rigid slave": ({"slave": ("plate", "top")}, r"links\[0\].slave .* rigid body by rigid"),
    "itself": ({**SLAVE, "master": ("block", "top")}, r"links\[0\].master .* another surface"),
    "contact": ({"slave": ("block", "right")}, r"links\[0\].slave .* link or contact, not both"),
    "rigid": ({**SLAVE, "rigid": "block"}, r"links\[0\].rigid = 'block': must be a rigid body"),
    "components": ({**SLAVE, "components": "z"}, "must be one of x, y, xy, normal, tangential"),
    "normal of a tie": (
        {**SLAVE, "components": "normal", "master": ("other", "left")},
        "components = 'normal': must be x, y or xy with a master",
    ),
    "stiffness": ({**SLAVE, "stiffness": 0.0}, "stiffness = 0.0: must be greater than 0"),
    "distributed": ({**SLAVE, "distributed": True}, "distributed = True: needs a rigid body"),
    "not facing": ({**SLAVE, "master": ("block", "bottom")}, r"links\[0\] .* do not face"),
    "corner": (
        {"slave": ("block", "left"), "rigid": "moved"},
        r"links\[0\] = '\(0, 0\)': must not contradict",
    ),
    "two motions": ({**SLAVE, "rigid": "moved"}, r"links\[.\] = '.*, 4\)': must not contradict"),
    "supports": (
        {"slave": ("block", "bottom"), "rigid": "moved"},
        r"links\[0\] = .* must not contradict supports, prescribed motions or other links",
    ),
}


@pytest.mark.parametrize(("given", "told"), WRONG.values(), ids=WRONG.keys())
def test_a_link_that_holds_nothing_or_too_much_is_refused(given: dict[str, Any], told: str) -> None:
    body = block("block", np.linspace(0, 4, 3), np.linspace(0, 4, 3), supports={"bottom": "xy"})
    other = block("other", np.linspace(4, 6, 3), np.linspace(0, 4, 3), supports={"bottom": "xy"})
    face = {"face": line((0.0, 9.0), (4.0, 9.0))}
    moved = RigidBody(name="moved", surfaces=face, y=Moved(value=0.1))
    with pytest.raises(ModelError, match=told):
        System(Model(
            bodies=(body, other),
            rigid=(PLATE, moved),
            contacts=(ContactPair(slave=("block", "right"), master=("other", "left")),),
            links=(Link(**given), Link(**SLAVE, rigid="plate", components="y")),
        ))  # fmt: skip


def test_a_link_that_moves_as_a_prescribed_displacement_does_is_met() -> None:
    """Both move by the same at every time, by other amplitudes."""
    times, half = np.array([0.0, 1.0]), np.array([0.0, 0.5])
    load = Displacement(boundary="top", y=0.01, amplitude=Amplitude(times, 2 * half))
    body = block("block", np.linspace(0, 4, 3), np.linspace(0, 4, 3), supports={"bottom": "xy"},
                 loads=(load,))  # fmt: skip
    plate = RigidBody(name="plate", y=Moved(value=0.02, amplitude=Amplitude(times, half)))
    model = Model(bodies=(body,), rigid=(plate,),
                  links=(Link(**SLAVE, rigid="plate", components="y"),))  # fmt: skip
    assert len(System(model).links) == 0
    other = replace(plate, y=Moved(value=0.02, amplitude=Amplitude(times, half**2)))
    with pytest.raises(ModelError, match="must not contradict supports, prescribed motions"):
        System(replace(model, rigid=(other,)))


def test_links_that_agree_may_share_a_corner() -> None:
    """Two sides follow one plate, which turns them with what they bound: no stress."""
    body = block("block", np.linspace(0, 4, 3), np.linspace(0, 4, 3))
    plate = RigidBody(name="plate", x=Moved(value=0.1), rotation=Moved(value=1e-3))
    links = (Link(slave=("block", "left"), rigid="plate"), Link(**SLAVE, rigid="plate"))
    found = solve(Model(bodies=(body,), rigid=(plate,), links=links))
    assert len(found.system.links) == 2 * (5 + 5 - 1)
    assert np.abs(found.stress("block", "loaded")).max() < 1e-6
    assert found.audit().passed


@pytest.mark.parametrize("element", ["quad4", "quad8"])
def test_a_boundary_may_be_tied_in_two_pieces(element: str) -> None:
    x, low, high = np.linspace(0, 4, 5), np.linspace(0, 1, 3), np.linspace(1, 2, 3)
    lower = block("lower", x, low, element, supports={"bottom": "xy"})
    mesh = within(grid(x, high), "one", ["bottom"], x=(0, 2), y=(1, 1))
    mesh = within(mesh, "other", ["bottom"], x=(2, 4), y=(1, 1))
    upper = Body(name="upper", mesh=mesh, material=steel(), element=element,
                 loads=(Traction(boundary="top", x=100.0),))  # fmt: skip
    links = [Link(slave=("upper", name), master=("lower", "top")) for name in ("one", "other")]
    found = solve(Model(bodies=(lower, upper), links=tuple(links)))
    whole = solve(
        Model(bodies=(lower, upper), links=(replace(links[0], slave=("upper", "bottom")),))
    )
    moved = [each.displacement("upper", "loaded") for each in (found, whole)]
    # quadratic elements have one more condition where the pieces meet
    assert np.allclose(*moved, rtol=0, atol=0.01 * np.abs(moved[1]).max())
    assert found.audit().passed


@pytest.mark.parametrize("parts", [4, 8, 32])
def test_a_slave_that_goes_on_beyond_its_master_passes_the_audit(parts: int) -> None:
    """The master ends within an element of the slave, whichever of them is finer."""
    plate = block("plate", np.linspace(0, 4, parts + 1), np.linspace(0, 2, 3),
                  supports={"bottom": "xy"})  # fmt: skip
    rib = block("rib", np.linspace(1.1, 2.3, 3), np.linspace(2, 3, 3), pressure={"top": 10.0})
    tie = Link(slave=("plate", "top"), master=("rib", "bottom"))
    found = solve(Model(bodies=(plate, rib), links=(tie,)))
    assert found.audit().passed


@pytest.mark.parametrize("element", ["quad8", "quad4"])
@pytest.mark.parametrize("stiffness", [np.inf, 1e4])
def test_a_tie_of_curved_surfaces_and_unequal_meshes_passes_the_audit(
    element: str, stiffness: float
) -> None:
    inner = replace(sector(np.linspace(10, 15, 4), 4, element, material=steel(),
                           pressure={"left": 100.0}), name="inner")  # fmt: skip
    load = Traction(boundary="right", x=20.0, y=-30.0)
    outer = replace(sector(np.linspace(15, 25, 6), 7, element, material=steel(), loads=(load,)),
                    name="outer")  # fmt: skip
    tie = Link(slave=("outer", "left"), master=("inner", "right"), stiffness=stiffness)
    assert solve(Model(bodies=(inner, outer), links=(tie,))).audit().passed


def test_a_link_at_rest_on_a_support_adds_nothing() -> None:
    body = block("block", np.linspace(0, 4, 3), np.linspace(0, 4, 3), supports={"bottom": "xy"})
    system = System(Model(bodies=(body,), links=(Link(slave=("block", "bottom"), rigid="plate"),),
                          rigid=(PLATE,)))  # fmt: skip
    assert len(system.links) == 0
