"""Kinds of load of one's own: forces per volume and on boundaries, integrated and audited."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import solver.fem.discretisation
import solver.fem.loads
from solver import Body, ContactPair, LimitLoad, Material, Model, ModelError, System, solve
from solver.fem.discretisation import Discretisation
from solver.fem.substructure import Substructure
from solver.loading.program import Control, Stage
from solver.loading.stepper import Stepper
from solver.mesh import grid
from solver.mesh.elements import element_type, known_elements
from solver.mesh.grids import mapped, merged
from solver.model.amplitude import Amplitude
from solver.model.loads import Array, BodyForce, BoundaryLoad, Load, Pressure, TravellingPressure
from solver.results.acting import acting_on

pytestmark = pytest.mark.solves

E, NU = 2e5, 0.3
A, B = 20.0, 60.0
STEEL = Material(youngs_modulus=E, poisson_ratio=NU)
YIELDING = replace(STEEL, yield_stress=400.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Turning(Load):
    """Centrifugal force: ``level`` [N/mm4] times x and, where it acts in the plane, times y."""

    level: float
    plane: float = 1.0

    def body_force(self, x: Array) -> Array:
        return self.level * x * [[1.0], [self.plane]]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Weight(Load):
    """A weight per volume along -y [N/mm3]."""

    weight: Any

    def body_force(self, x: Array) -> Array:
        return np.array(self.weight) * [[0.0], [-1.0]]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Water(BoundaryLoad):
    """A pressure that grows with the depth below y = 0, ``weight`` [N/mm3]."""

    weight: float

    def push(self, x: Array, along: Array) -> Array:
        return -self.weight * x[1] * np.stack([-along[1], along[0]])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Bell(BoundaryLoad):
    """A pressure like a bell around a place, which moves to x = 3 at time 1 and on."""

    peak: float

    def push_at(self, time: float, x: Array, along: Array) -> Array:
        level = self.factor(time) * self.peak * np.exp(-((x[0] - 3.0 * time) ** 2))
        return level * np.stack([-along[1], along[0]])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Crossing(Bell):
    """The same, largest halfway and zero at time 1."""

    def push_at(self, time: float, x: Array, along: Array) -> Array:
        return np.sin(np.pi * time) / (time or 1.0) * Bell.push_at(self, time, x, along)


def block(element: str = "quad8", load: Load | None = None, **own: Any) -> Body:
    cells = element_type(element).cells
    mesh = grid(np.linspace(0.0, 4.0, 5), np.linspace(-6.0, 0.0, 7), cells=cells)
    own = {"supports": {"left": "x", "bottom": "y"}, "loads": (load,) if load else ()} | own
    return Body(name="block", mesh=mesh, material=STEEL, element=element, **own)


def ring(load: Load, across: int = 10, around: int = 32) -> Body:
    """Return a whole ring, held on the lines x = 0 and y = 0, which stay straight."""
    flat = grid(np.linspace(A, B, across + 1), np.linspace(0.0, 2 * np.pi, around + 1))
    mesh = merged(mapped(flat, lambda X: X[0] * np.stack([np.cos(X[1]), np.sin(X[1])])))
    lines = {"up": lambda x: abs(x[0]) < 1e-9, "across": lambda x: abs(x[1]) < 1e-9}
    return Body(
        name="ring", mesh=mesh.with_boundaries(lines, boundaries_only=False), material=STEEL,
        kinematics="plane_stress", supports={"up": "x", "across": "y"}, loads=(load,),
    )  # fmt: skip


@pytest.mark.parametrize("kinematics", ["plane_strain", "plane_stress", "axisymmetric"])
@pytest.mark.parametrize("element", known_elements(2))
def test_nodal_forces_of_a_force_per_volume_have_its_resultant(
    element: str, kinematics: Any
) -> None:
    body = block(element, Turning(level=3.0), kinematics=kinematics, thickness=2.0)
    force = Discretisation(body).external(2.0).reshape(-1, 2).sum(axis=0)
    depth = 2 * np.pi * np.array([4.0**3 / 3, 4.0**2 / 2]) if kinematics == "axisymmetric" else (
        2.0 * np.array([4.0**2 / 2, 4.0]))  # fmt: skip
    assert force == pytest.approx(2 * 3.0 * depth * [6.0, -18.0], rel=1e-12)


def test_a_turning_ring_has_the_stress_of_its_closed_form() -> None:
    """Hoop stress at both edges (Timoshenko and Goodier, Theory of Elasticity, article 32)."""
    level = 0.01
    found = solve(Model(bodies=(ring(Turning(level=level)),)))
    x, y = found.nodes("ring")
    stress = found.stress("ring", "loaded")[1]
    for radius, other in ((A, B), (B, A)):
        hoop = (3 + NU) / 4 * level * (other**2 + (1 - NU) / (3 + NU) * radius**2)
        at = np.isclose(x, radius) & (abs(y) < 1e-9)
        assert stress[at] == pytest.approx(hoop, rel=0.01)
    assert found.audit().passed


def test_a_block_under_its_weight_bears_what_is_above() -> None:
    walls = {"left": "x", "right": "x", "bottom": "y"}
    found = solve(Model(bodies=(block(load=Weight(weight=0.5), supports=walls),)))
    stress, y = found.stress("block", "loaded"), found.nodes("block")[1]
    assert stress[1] == pytest.approx(0.5 * y, abs=1e-9)
    assert found.audit().passed
    constrained = E * (1 - NU) / ((1 + NU) * (1 - 2 * NU))
    assert found.loaded.energy.external == pytest.approx(0.5**2 * 4 * 6**3 / (6 * constrained))


def test_a_pressure_that_varies_is_integrated_and_audited() -> None:
    water = Water(boundary="right", weight=2.0)
    found = solve(Model(bodies=(block(load=water),)))
    force = found.system.full("block").external(1.0).reshape(-1, 2)
    assert force.sum(axis=0) == pytest.approx([-2.0 * 6**2 / 2, 0.0])
    assert force[:, 0] @ found.nodes("block")[1] == pytest.approx(2.0 * 6**3 / 3)
    assert found.audit().passed


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Layer(Load):
    """A weight per volume of 2 N/mm3 on one side of a line only: the line crosses elements."""

    slope: float

    def body_force(self, x: Array) -> Array:
        return 2.0 * (x[1] + 3.3 < self.slope * (x[0] - 2.0)) * np.array([[0.0], [-1.0]])


@pytest.mark.parametrize("element", ["quad8", "tri6"])
@pytest.mark.parametrize("slope", [0.0, 0.4])
def test_a_force_per_volume_may_jump_within_elements(element: str, slope: float) -> None:
    """The line passes the middle of the block at a depth of 3.3 of 6, whatever its slope."""
    found = solve(Model(bodies=(block(element, Layer(slope=slope)),)))
    force = found.system.full("block").external(1.0).reshape(-1, 2)
    assert force.sum(axis=0) == pytest.approx([0.0, -2.0 * 4 * 2.7], abs=1e-5)
    turn = force[:, 1] @ (found.nodes("block")[0] - 2.0)
    assert turn == pytest.approx(-2.0 * slope * 4.0**3 / 12, abs=1e-5)
    assert found.audit().passed, found.audit().violations


def test_a_force_per_volume_between_all_points_of_the_solver_is_found_by_the_audit() -> None:
    """On a strip of an eighth of an element."""
    strip = BodyForce(x=lambda x: 1.0 * ((1.36 < x[0]) & (x[0] < 1.48)))
    found = solve(Model(bodies=(block(load=strip),)))
    assert not found.stress("block", "loaded").any()  # it is lost
    audit = found.audit()
    assert any("audit_reactions" in each for each in audit.violations), audit.violations


def test_a_condensed_body_has_its_force_per_volume() -> None:
    upper = block(load=Weight(weight=20.0), supports={"left": "x"})
    lower = replace(block(), name="lower", mesh=block().mesh.translated((0.0, -6.0)))
    pair = ContactPair(slave=("block", "bottom"), master=("lower", "top"))
    whole, reduced = (
        solve(Model(bodies=(replace(upper, condense=own), lower), contacts=(pair,)))
        for own in (False, True)
    )
    assert reduced.audit().passed
    assert isinstance(reduced.system.parts[0], Substructure)
    for name in ("block", "lower"):
        assert reduced.stress(name, "loaded") == pytest.approx(
            whole.stress(name, "loaded"), abs=1e-9
        )


def standing(peak: float) -> Pressure:
    """Return the bell as it stands at time 1."""
    return Pressure(boundary="top", value=lambda x: peak * np.exp(-((x[0] - 3.0) ** 2)))


def test_a_load_that_moves_acts_on_an_elastic_body_in_contact() -> None:
    """Two blocks overlap before loading. At time 1 all is as under a pressure at this place."""
    lower = replace(block(), name="lower", mesh=block().mesh.translated((0.0, -6.0 + 1e-4)))
    pair = ContactPair(slave=("block", "bottom"), master=("lower", "top"), friction=0.3)
    moved, stood = (
        solve(Model(bodies=(block(load=load, supports={"left": "x"}), lower), contacts=(pair,)))
        for load in (Bell(boundary="top", peak=100.0), standing(100.0))
    )
    assert moved.audit().passed, moved.audit().violations
    for name in ("block", "lower"):  # friction remembers the way, little of it
        found, expected = (each.stress(name, "loaded") for each in (moved, stood))
        assert found == pytest.approx(expected, abs=0.02 * np.abs(expected).max())
    assert moved.stress("lower", "unloaded") == pytest.approx(0.0, abs=1e-9)


def test_a_fit_keeps_its_stress_when_a_load_moves_again() -> None:
    lower = replace(block(), name="lower", mesh=block().mesh.translated((0.0, -6.0 + 1e-3)))
    pair = ContactPair(slave=("block", "bottom"), master=("lower", "top"), friction=0.3)
    load = hertz(1.0, 1.5, 2.5, shear_ratio=Amplitude.constant(1.0))
    upper = block(load=load, supports={"left": "x", "top": "y"})
    stepper = Stepper(System(Model(bodies=(upper, lower), contacts=(pair,))), Control())
    point = stepper.begin(stepper.system.initial(), 0.0)
    pressed = point.now.state.contacts[0].normal.max()
    assert pressed > 0.0
    point = stepper.reach(point, 1.0)
    again = stepper.again(point, 1.0)
    shear, stress = (
        [each.now.state.contacts[0].tangential for each in (point, again)],
        [each.now.responses[0].stress for each in (point, again)],
    )
    assert np.abs(shear[0]).max() > 1e-3 * pressed
    assert shear[1] == pytest.approx(shear[0], rel=1e-12)
    assert stress[1] == pytest.approx(stress[0], rel=1e-12)
    assert again.now.energy.stored == pytest.approx(point.now.energy.stored, rel=1e-12)


def test_what_a_load_that_moves_does_on_its_way_remains() -> None:
    """The load is large halfway, and gone at the end: one increment would not show the strain."""
    body = replace(block(load=Crossing(boundary="top", peak=750.0)), material=YIELDING)
    found = solve(Model(bodies=(body,)))
    assert found.plastic_strain("block").max() > 1e-4
    assert found.audit().passed, found.audit().violations


def test_a_moving_force_shifted_in_the_solver_alone_is_found(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    body = block(load=Bell(boundary="top", peak=100.0))
    own = solver.fem.discretisation.moving_forces
    assert solve(Model(bodies=(body,))).audit().passed
    late = "solver.fem.discretisation.moving_forces"
    monkeypatch.setattr(late, lambda part, loads, time: own(part, loads, time + 0.02))
    broken = solve(Model(bodies=(body,))).audit()
    assert any("audit_reactions" in each for each in broken.violations), broken.violations


def hertz(half_width: float, *way: float, **own: Any) -> TravellingPressure:
    """Return a pressure that is at these x at times 0, 1, ..."""
    position = Amplitude(np.arange(len(way)), np.array(way))
    own = {"boundary": "top", "peak": 100.0} | own
    return TravellingPressure(half_width=half_width, position=position, **own)


@pytest.mark.parametrize(
    ("load", "field"),
    [
        (hertz(1.0, 4.0), "position"),
        (hertz(1.0, 2.0, 3.5), "position"),
        (hertz(0.4, 2.2), "half_width"),
    ],
    ids=["beyond", "on its way", "between points"],
)
def test_a_moving_pressure_that_the_boundary_cannot_take_whole_is_refused(
    load: TravellingPressure, field: str
) -> None:
    """The top has four edges of 1 mm, from 0 to 4."""
    with pytest.raises(
        ModelError, match=rf"^travelling_pressure\.top\.{field} = .*must"
    ) as refused:
        solve(Model(bodies=(block(load=load),)))
    assert refused.value.field.endswith(field)


def test_a_moving_pressure_may_be_beyond_the_boundary_while_it_does_not_act() -> None:
    off = Amplitude(np.array([0.0, 0.5, 1.0]), np.array([0.0, 1.0, 0.0]))
    system = System(Model(bodies=(block(load=hertz(1.0, -2.0, 6.0, amplitude=off)),)))
    at = [system.parts[0].external(time).sum() for time in (0.0, 0.5, 1.0)]
    assert at == pytest.approx([0.0, -50.0 * np.pi, 0.0], rel=0.02)


def test_a_load_that_travels_over_a_weak_beam_ends_at_its_limit_load() -> None:
    """A cantilever holds the load close to its support, and fails as it moves on."""
    mesh = grid(np.linspace(0.0, 8.0, 17), np.linspace(-1.0, 0.0, 3))
    on = Amplitude(np.array([0.0, 1.0]), np.array([0.0, 1.0]))
    load = hertz(0.5, 0.5, 0.5, 7.5, peak=51.0, amplitude=on)
    beam = Body(name="beam", mesh=mesh, material=YIELDING, supports={"left": "xy"}, loads=(load,))
    stages = [Stage(name="on", target=1.0), Stage(name="across", target=2.0, steps=5)]
    with pytest.raises(LimitLoad) as ended:
        solve(Model(bodies=(beam,)), stages=stages)
    assert 1.2 < ended.value.reached < 1.6


def test_a_shear_above_the_yield_stress_is_named_before_loading() -> None:
    """Without an amplitude the factor is the time, and the shear ratio 1 at its end."""
    ratio = Amplitude(np.array([0.0, 2.0]), np.array([0.0, 2.0]))
    load = hertz(1.0, 2.0, shear_ratio=ratio, peak=300.0)
    body = replace(block(load=load), material=YIELDING)
    with pytest.raises(LimitLoad, match=r"shear, 300 MPa, is above the shear yield stress"):
        solve(Model(bodies=(body,)))


def test_two_pressures_on_one_body_are_reported_as_their_sum() -> None:
    loads = hertz(1.0, 1.0), hertz(0.5, 3.0, peak=50.0, shear_ratio=Amplitude.constant(0.4))
    system = System(Model(bodies=(block(loads=loads),)))
    at = SimpleNamespace(state=replace(system.initial(), time=1.0))
    acting = acting_on(system, symmetric=False)(at)
    pressure, shear, gap = acting.along(np.array([1.0, 2.5, 3.0]))
    assert pressure == pytest.approx([100.0, 0.0, 50.0])
    assert shear == pytest.approx([0.0, 0.0, 20.0])
    assert np.isnan(gap).all()
    assert np.isnan([acting.half_width, acting.peak]).all()
    assert acting.force == pytest.approx(0.25 * np.pi * 20.0)


def test_a_load_that_moves_is_refused_on_a_body_of_large_strain() -> None:
    with pytest.raises(ModelError, match=r"bell = .*strain must be"):
        block("quad4", Bell(boundary="top", peak=1.0), strain="large")


BODIES = {
    "weight": block(load=Weight(weight=0.5)),
    "turning shaft": block(load=Turning(level=3.0, plane=0.0), kinematics="axisymmetric"),
    "turning ring": ring(Turning(level=0.01), 5, 16),
}


@pytest.mark.parametrize("body", BODIES.values(), ids=BODIES)
def test_a_force_per_volume_doubled_in_the_solver_alone_is_found(
    body: Body, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also one without a resultant: it has first moments."""
    assert solve(Model(bodies=(body,))).audit().passed
    own = solver.fem.loads._body_forces

    def doubled(part: Any, load: Load) -> Array | None:
        force = own(part, load)
        return None if force is None else 2 * force

    monkeypatch.setattr(solver.fem.loads, "_body_forces", doubled)
    broken = solve(Model(bodies=(body,))).audit()
    assert any("audit_reactions" in each for each in broken.violations), broken.violations


@pytest.mark.parametrize(
    ("weight", "allowed"), [([1.0, 2.0, 3.0], "of the shape"), (np.nan, "finite at all points")]
)
def test_a_force_that_is_none_is_refused(weight: Any, allowed: str) -> None:
    with pytest.raises(ModelError, match=rf"weight\.body_force = .*{allowed}"):
        System(Model(bodies=(block(load=Weight(weight=weight)),)))
