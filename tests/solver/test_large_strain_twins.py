"""The estimate of what small-strain theory leaves out, against the same scene with large strain."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from solver import (
    Amplitude,
    Body,
    ContactPair,
    Displacement,
    Link,
    Material,
    Model,
    Moved,
    Pressure,
    RigidBody,
    Solution,
    Stage,
    Traction,
    solve,
)
from solver.audit.plain import PlainBody
from solver.linear.solvers import Singular
from solver.mesh import grid
from solver.model.loads import Load, Removal
from solver.model.rigid import line
from solver.tensors import SQRT2
from solver.typing import Array

pytestmark = pytest.mark.solves

E = 2e5
LOADED = (Stage(name="loaded", target=1.0, steps=12),)
RELEASED = (*LOADED, Stage(name="unloaded", target=0.0, steps=6, turns=True, apart=True))
Made = Callable[[Any], Model]


def steel(stress: float, hardening: Any = "none", ratio: float = 0.0) -> Material:
    return Material(youngs_modulus=E, poisson_ratio=0.3, yield_stress=stress,
                    hardening=hardening, hardening_ratio=ratio)  # fmt: skip


def block(strain: Any, ends: tuple[float, float], cells: tuple[int, int], **fields: Any) -> Body:
    mesh = grid(*(np.linspace(0.0, end, n + 1) for end, n in zip(ends, cells, strict=True)))
    return Body(**{"name": "block", "mesh": mesh, "element": "quad4", "strain": strain,
                   "kinematics": "plane_strain", **fields})  # fmt: skip


def shares(made: Made, stages: tuple[Stage, ...] = LOADED) -> tuple[float, float]:
    """Return the estimate, and the change of stress in the energy norm, over the largest stress."""
    small, large = (solve(made(strain), stages=stages) for strain in ("small", "large"))
    most, true = 0.0, 0.0
    for stage in small.stages:
        T, other = (run.stages[stage].responses[0].stress for run in (small, large))
        most = max(most, energy(small, T))
        true = max(true, *(energy(small, s - T) / most for s in (other, nominal(large, stage))))
    return small.audit().figures["audit_large_strain"], math.sqrt(true)


def energy(run: Solution, stress: Array) -> float:
    part = run.system.full("block")
    return float(part.body.law.elasticity.energy_density(stress) @ part.volumes)


def nominal(run: Solution, stage: str) -> Array:
    """Return T - (T e + e T) / 2 of a state, turned back."""
    state = run.stages[stage].state
    strain = PlainBody(run.system.full("block")).strain(state.u[0]).reshape(4, -1)
    (ax, ay, az, ao), (bx, by, bz, bo) = (
        np.array([*each[:3], each[3] / SQRT2])
        for each in (run.stages[stage].responses[0].stress, strain)
    )
    product = [ax * bx + ao * bo, ay * by + ao * bo, az * bz]
    shear = ((ax + ay) * bo + (bx + by) * ao) / 2
    return run.stages[stage].responses[0].stress - np.array([*product, SQRT2 * shear])


def clamped(material: Material, slender: float, down: float, **fields: Any) -> Made:
    """Half of a strip held at both ends, its middle moved down."""
    moved = Displacement(boundary="right", y=-down)
    return lambda strain: Model(bodies=(
        block(strain, (slender / 2, 1.0), (20, 4), material=material,
              supports={"left": "xy", "right": "x"}, loads=(moved,), **fields),
    ))  # fmt: skip


@pytest.mark.parametrize(
    ("material", "slender", "down", "kinematics"),
    [
        (steel(200.0), 8.0, 0.03, "plane_strain"),
        (steel(400.0, "isotropic", 0.003), 15.0, 0.1, "plane_stress"),
        (steel(400.0, "isotropic", 0.01), 15.0, 0.2, "plane_strain"),
        (steel(200.0, "kinematic", 0.03), 15.0, 0.3, "plane_stress"),
    ],
)
def test_a_clamped_strip_that_yields_lacks_its_membrane_stress(
    material: Material, slender: float, down: float, kinematics: str
) -> None:
    found, true = shares(clamped(material, slender, down, kinematics=kinematics))
    assert true > 0.01
    assert found == pytest.approx(true, rel=0.15)


def test_a_strip_pulled_and_then_bent_lacks_what_its_pull_does_as_it_turns() -> None:
    along = Amplitude(time=[0.0, 1.0, 2.0], value=[0.0, 1.0, 1.0])
    after = Amplitude(time=[0.0, 1.0, 2.0], value=[0.0, 0.0, 1.0])
    loads = (Displacement(boundary="right", x=0.06, amplitude=along),
             Displacement(boundary="right", y=-0.2, amplitude=after))  # fmt: skip

    def made(strain: Any) -> Model:
        bar = block(strain, (10.0, 1.0), (30, 4), material=steel(400.0, "isotropic", 0.003),
                    supports={"left": "xy"}, loads=loads)  # fmt: skip
        return Model(bodies=(bar,))

    found, true = shares(made, (*LOADED, Stage(name="bent", target=2.0, steps=12)))
    assert true > 0.05
    assert found == pytest.approx(true, rel=0.2)


@pytest.mark.parametrize("first", [(), (Stage(name="pulled", target=1.0, steps=12),)])
def test_a_bar_whose_flow_has_stopped_at_the_end_of_a_stage_is_no_false_alarm(
    first: tuple[Stage, ...],
) -> None:
    """By the elastic stiffness at the end it had 24 %, within a stage and in a stage of its own."""
    eased = Amplitude(time=[0.0, 1.0, 2.0], value=[0.0, 1.0, 0.995])
    load = Displacement(boundary="right", x=0.12, amplitude=eased)
    found, true = shares(
        lambda strain: Model(bodies=(
            block(strain, (4.0, 1.0), (4, 2), material=steel(400.0, "isotropic", 0.003),
                  supports={"left": "x", "bottom": "y"}, loads=(load,)),
        )),
        (*first, Stage(name="loaded", target=2.0, steps=4 if first else 20)),
    )  # fmt: skip
    assert found == pytest.approx(true, rel=0.15)


@pytest.mark.parametrize("fails", [True, False])
def test_an_estimate_without_balance_puts_the_run_outside_theory(
    monkeypatch: pytest.MonkeyPatch, fails: bool
) -> None:
    def nothing(*args: Any) -> None:
        if fails:
            raise Singular("no stiffness")

    run = solve(clamped(steel(200.0), 8.0, 0.03)("small"), stages=LOADED)
    monkeypatch.setattr("solver.audit.large_strain.newton_step", nothing)
    audit = run.audit()
    assert math.isnan(audit.figures["audit_large_strain"])
    assert any("the stress of block cannot be estimated" in text for text in audit.outside)


def test_removed_elements_resist_nothing() -> None:
    """Half of a bar removed under load leaves the bar that was half from the beginning."""
    mesh = grid(np.linspace(0.0, 20.0, 41), np.linspace(0.0, 1.0, 5))
    x, y = mesh.p[:, mesh.t].mean(axis=1)
    off = (y > 0.5) & (x < 19.0)
    held = Amplitude(time=[0.0, 1.0, 2.0], value=[0.0, 1.0, 1.0])
    pulled = Traction(boundary="right", x=5.0, amplitude=held)
    cut = Removal(region="off", amplitude=Amplitude(time=[1.0, 2.0], value=[0.0, 1.0]))
    stages = (Stage(name="whole", target=1.0, steps=1), Stage(name="loaded", target=2.0, steps=1))

    def estimate(**fields: Any) -> float:
        bar = block("small", (20.0, 1.0), (40, 4), element="quad8", supports={"left": "xy"},
                    material=Material(youngs_modulus=E, poisson_ratio=0.3), **fields)  # fmt: skip
        audit = solve(Model(bodies=(bar,)), stages=stages).audit()
        return audit.figures["audit_large_strain"]

    region = mesh.with_subdomains({"off": np.flatnonzero(off)})
    whole = estimate(mesh=mesh.restrict(np.flatnonzero(~off)), loads=(pulled,))
    assert whole > 0.1
    assert estimate(mesh=region, loads=(pulled, cut)) == pytest.approx(whole, rel=1e-3)


@pytest.mark.parametrize(("shear", "free"), [(0.02, True), (0.05, False)])
def test_a_sheared_block_turns_its_stress(shear: float, free: bool) -> None:
    """Held along the shear only, or between plates that stick to it, much wider than thick."""
    load = Displacement(boundary="top", x=shear, y=None if free else 0.0)
    size, cells = ((1.0, 1.0), (6, 6)) if free else ((6.0, 1.0), (24, 6))
    found, true = shares(lambda strain: Model(bodies=(
        block(strain, size, cells, material=steel(400.0), supports={"bottom": "xy"},
              loads=(load,)),
    )))  # fmt: skip
    assert true > 0.02
    assert found == pytest.approx(true, rel=0.2)


@pytest.mark.parametrize(("down", "friction", "radius"), [(0.01, 0.2, 2.5), (0.03, 0.2, 1.0)])
def test_a_disc_upset_with_friction_is_no_false_alarm(
    down: float, friction: float, radius: float
) -> None:
    """The force of contact grows with the area; kept as it is, released discs had 21 % for 2 %."""

    def made(strain: Any) -> Model:
        disc = block(strain, (radius, 1.0), (8, 6), kinematics="axisymmetric",
                     material=steel(400.0, "isotropic", 0.003),
                     supports={"bottom": "y", "left": "x"})  # fmt: skip
        plate = RigidBody(name="plate", surfaces={"face": line((0.0, 1.0), (3 * radius, 1.0))},
                          y=Moved(value=-down))  # fmt: skip
        pair = ContactPair(slave=("block", "top"), master=("plate", "face"), friction=friction)
        return Model(bodies=(disc,), rigid=(plate,), contacts=(pair,))

    found, true = shares(made, RELEASED)
    assert true > down / 2
    assert found == pytest.approx(true, rel=0.2)


def test_the_pressure_in_a_tube_acts_on_the_widened_bore() -> None:
    """At 2 / sqrt(3) yield stress ln 2, the limit without hardening; with dead pressure 0.17 %."""
    pressed = Pressure(boundary="left", value=2 / math.sqrt(3) * 200.0 * math.log(2.0))

    def made(strain: Any) -> Model:
        tube = block(strain, (1.0, 0.4), (12, 2), kinematics="axisymmetric",
                     material=steel(200.0, "isotropic", 0.01),
                     supports={"bottom": "y", "top": "y"}, loads=(pressed,))  # fmt: skip
        return Model(bodies=(replace(tube, mesh=tube.mesh.translated((1.0, 0.0))),))

    found, true = shares(made)
    assert true > 0.01
    assert found == pytest.approx(true, rel=0.15)


def test_a_turned_bar_that_flows_bends_under_a_force_that_does_not_turn() -> None:
    """Turning a bar by w under its force P is, to the bar, a transverse force P w."""
    pull, turn, rising = 330.0, 0.03, np.linspace(0.0, 1.0, 13)
    pulled = Traction(boundary="right", x=pull)
    linear, square = (Amplitude(time=rising, value=rising**k) for k in (1, 2))
    along = Traction(boundary="right", x=pull, amplitude=linear)
    aside = Traction(boundary="right", y=pull * turn, amplitude=square)

    def bar(*loads: Load, **fields: Any) -> Body:
        return block("small", (4.0, 1.0), (8, 2), kinematics="plane_stress", element="quad8",
                     material=steel(300.0, "isotropic", 0.02), loads=loads, **fields)  # fmt: skip

    held = {"supports": {"left": "xy"}}
    straight, bent = (
        solve(Model(bodies=(bar(*loads, **held),)), stages=LOADED)
        for loads in ((along,), (along, aside))
    )
    T, other = (run.loaded.responses[0].stress for run in (straight, bent))
    true = math.sqrt(energy(straight, other - T) / energy(straight, T))
    ways = {"x": Moved(), "y": Moved(), "rotation": Moved(value=turn)}
    grip = RigidBody(name="grip", centre=(0.0, 0.5), **ways)
    link = Link(slave=("block", "left"), rigid="grip")
    model = Model(bodies=(bar(pulled),), links=(link,), rigid=(grip,))
    found = solve(model, stages=LOADED).audit().figures["audit_large_strain"]
    assert found == pytest.approx(true, rel=0.1)
