"""Loads with a course of their own: tractions, prescribed displacements, heat, initial stress."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from solver import Body, ContactPair, Material, Model, ModelError, System, Walker, solve
from solver.loading.program import Control, Lap, Program, Stage
from solver.mesh import grid
from solver.model.amplitude import Amplitude
from solver.model.loads import Displacement, Gravity, InitialStress, Pressure, Temperature, Traction

pytestmark = pytest.mark.solves

E, NU, RE = 2.0e5, 0.3, 400.0
ELASTIC = Material(youngs_modulus=E, poisson_ratio=NU)
STEEL = Material(youngs_modulus=E, poisson_ratio=NU, yield_stress=RE, hardening="isotropic",
                 hardening_ratio=0.1)  # fmt: skip
ALPHA = 1.2e-5
FREE_BAR = {"left": "x", "bottom": "y"}


def bar(material: Material = ELASTIC, length: float = 10.0, **own: Any) -> Body:
    mesh = grid(np.linspace(0.0, length, 6), np.linspace(0.0, 2.0, 3))
    own = {"kinematics": "plane_stress", "supports": FREE_BAR} | own
    return Body(name="bar", mesh=mesh, material=material, **own)


def loaded(body: Body, load: float = 1.0) -> Any:
    return solve(Model(bodies=(body,)), load=load)


def test_a_traction_has_its_resultant_and_direction() -> None:
    found = loaded(bar(loads=(Traction(boundary="right", x=50.0),)))
    stress = found.stress("bar", "loaded")
    assert stress[0] == pytest.approx(50.0, rel=1e-9)
    assert np.abs(stress[[1, 3]]).max() < 1e-6
    assert found.audit().passed


def test_shear_traction_on_all_sides_is_pure_shear() -> None:
    sides = {"right": (0, 1), "top": (1, 0), "left": (0, -1), "bottom": (-1, 0)}
    shear = tuple(Traction(boundary=b, x=80.0 * x, y=80.0 * y) for b, (x, y) in sides.items())
    mesh = grid(np.linspace(0.0, 10.0, 6), np.linspace(0.0, 2.0, 3))
    held = mesh.with_boundaries({"corner": lambda x: (x[0] == 0) & (x[1] < 1e-9 + 1)})
    body = replace(bar(loads=shear), mesh=held, supports={"corner": "xy"})
    found = loaded(body)
    far = found.nodes("bar")[0] > 6.0
    assert found.stress("bar", "loaded")[3, far] == pytest.approx(80.0, rel=1e-3)
    assert found.strain("bar", "loaded")[3, far] == pytest.approx(80.0 * (1 + NU) / E, rel=1e-3)


@pytest.mark.parametrize("material", [ELASTIC, STEEL])
def test_a_prescribed_displacement_stretches_as_the_traction_that_does_the_same(
    material: Material,
) -> None:
    pull = 480.0
    by_force = loaded(bar(material, loads=(Traction(boundary="right", x=pull),)))
    stretch = float(by_force.displacement("bar", "loaded")[0].max())
    body = bar(material, loads=(Displacement(boundary="right", x=stretch),))
    moved = loaded(body)
    assert moved.stress("bar", "loaded")[0] == pytest.approx(pull, rel=1e-6)
    assert moved.displacement("bar", "loaded")[0].max() == stretch
    assert moved.audit().passed
    # back at zero displacement the yielded bar is compressed: it has grown longer
    left = moved.stress("bar")[0].max()
    assert left < -50.0 if material is STEEL else abs(left) < 1e-9


def test_a_displacement_in_one_step_finds_the_same_stress_as_in_many() -> None:
    body = bar(STEEL, loads=(Displacement(boundary="right", x=0.1),))
    stresses = []
    for steps in (1, 20):
        stage = Stage(name="loaded", target=1.0, steps=steps)
        (outcome,) = Walker(System(Model(bodies=(body,))), Control(increment_error=np.inf)).walk(
            [Program(laps=(Lap((stage,)),))]
        )
        assert outcome.error is None
        stresses.append(outcome.points["loaded"].responses[0].stress)
    assert stresses[0] == pytest.approx(stresses[1], rel=1e-7, abs=1e-6)


def test_displacements_of_one_boundary_add_up() -> None:
    """Press, then slide, then press further: each load has its own course."""
    rise, later = Amplitude([0, 1], [0, 1]), Amplitude([1, 2], [0, 1])
    body = bar(loads=(
        Displacement(boundary="right", x=-0.010, y=0.0, amplitude=rise),
        Displacement(boundary="right", x=-0.030, amplitude=later),
        Displacement(boundary="right", y=0.004, amplitude=later),
    ), supports={"left": "xy"})  # fmt: skip
    stages = (Stage(name="pressed", target=1.0, steps=2), Stage(name="both", target=2.0, steps=2))
    found = solve(Model(bodies=(body,)), stages=stages)
    tip = found.nodes("bar")[0] == 10.0
    for stage, x, y in (("pressed", -0.010, 0.0), ("both", -0.040, 0.004)):
        moved = found.displacement("bar", stage)[:, tip]
        assert moved[0] == pytest.approx(x, abs=1e-15)
        assert moved[1] == pytest.approx(y, abs=1e-15)
        assert found.audit(stage).passed


def test_a_displacement_given_twice_counts_twice() -> None:
    half = Displacement(boundary="right", x=0.01)
    moved = loaded(bar(loads=(half, half))).displacement("bar", "loaded")
    assert moved[0].max() == pytest.approx(0.02)


RISE = Amplitude([0, 1], [0, 1])


@pytest.mark.parametrize(
    ("supports", "loads", "message"),
    [
        (
            {"left": "x"},
            (Displacement(boundary="right", y=0.01), Displacement(boundary="top", y=0.02)),
            r"displacement\.top\.y = 0.02: must be 0.01 mm .* the value of displacement\.right",
        ),
        (
            {"left": "x"},
            (Displacement(boundary="right", y=0.01),
             Displacement(boundary="top", y=0.01, amplitude=RISE)),
            r"displacement\.top\.y = .* the value of displacement\.right of body 'bar'",
        ),
        (
            {"bottom": "xy"},
            (Displacement(boundary="right", x=0.01),),
            r"displacement\.right\.x = .*: must be 0 mm .* supports\.bottom .*\(10, 0\) mm",
        ),
        (
            {"left": "x", "bottom": "y", "top": "y"},
            (Displacement(boundary="top", y=0.01),),
            r"displacement\.top\.y = .*: must be 0 mm at time 1, the value of supports\.top",
        ),
    ],
    ids=["values", "courses", "support", "support of the same boundary"],
)  # fmt: skip
def test_boundaries_that_meet_and_contradict_each_other_are_refused(
    supports: dict[str, str], loads: tuple[Displacement, ...], message: str
) -> None:
    with pytest.raises(ModelError, match=message):
        System(Model(bodies=(bar(supports=supports, loads=loads),)))


def test_boundaries_that_meet_and_agree_are_held_together() -> None:
    """Two sides that meet are moved alike; one course is written as two."""
    lift = (
        Displacement(boundary="half", y=0.02),
        Displacement(boundary="right", y=0.005),
        Displacement(boundary="right", y=0.015),
    )
    fixed = bar(supports={"left": "xy"})
    tip = {"half": lambda x: (x[1] > 2.0 - 1e-9) & (x[0] > 8.0)}
    found = loaded(replace(fixed, mesh=fixed.mesh.with_boundaries(tip), loads=lift))
    x, y = found.nodes("bar")
    corner = (x == 10.0) & (y == 2.0)
    assert found.displacement("bar", "loaded")[1, corner] == pytest.approx(0.02)
    assert found.audit().passed


def test_a_free_body_expands_without_stress() -> None:
    heat = Temperature(rise=100.0, expansion=ALPHA)
    found = loaded(bar(loads=(heat,)))
    assert np.abs(found.stress("bar", "loaded")).max() < 1e-8
    assert found.displacement("bar", "loaded")[0].max() == pytest.approx(10.0 * ALPHA * 100.0)


def test_a_held_bar_is_compressed_by_heat_and_keeps_tension_when_it_cools() -> None:
    rise, slope = 250.0, 0.1 * E
    heat = Temperature(rise=rise, expansion=ALPHA)
    found = loaded(bar(STEEL, supports={"left": "x", "right": "x", "bottom": "y"}, loads=(heat,)))
    beyond = ALPHA * rise - RE / E
    hot = -(RE + slope * beyond)
    assert found.stress("bar", "loaded")[0] == pytest.approx(hot, rel=1e-9)
    assert found.stress("bar")[0] == pytest.approx(hot + E * ALPHA * rise, rel=1e-9)
    assert found.audit().passed


def test_heat_and_pressure_may_follow_amplitudes_of_their_own() -> None:
    warm = Amplitude(np.array([0.0, 1.0, 2.0]), np.array([0.0, 1.0, 0.0]))
    press = Amplitude(np.array([1.0, 2.0]), np.array([0.0, 1.0]))
    body = bar(loads=(
        Temperature(rise=100.0, expansion=ALPHA, amplitude=warm),
        Pressure(boundary="right", value=60.0, amplitude=press),
    ))  # fmt: skip
    stages = (Stage(name="warm", target=1.0), Stage(name="pressed", target=2.0))
    system = System(Model(bodies=(body,)))
    (outcome,) = Walker(system, Control()).walk([Program(laps=(Lap(stages),))])
    tip = [system.displacement("bar", outcome.points[n].state)[::2].max() for n in ("warm",)]
    assert tip == pytest.approx([10.0 * ALPHA * 100.0])
    assert outcome.points["pressed"].responses[0].stress[0] == pytest.approx(-60.0)
    with pytest.raises(ModelError, match="amplitude"):
        solve(Model(bodies=(body,)))


def balanced(x: np.ndarray) -> np.ndarray:
    """Return a stress of rolled sheet: tension outside, compression inside, without resultants."""
    out = np.zeros((4, x.shape[1]))
    out[0] = 150.0 * (3 * (x[1] - 1.0) ** 2 - 1.0)
    return out


def test_initial_stress_in_equilibrium_stays_as_it_is_far_from_the_ends() -> None:
    mesh = grid(np.linspace(0.0, 30.0, 31), np.linspace(0.0, 2.0, 9))
    body = replace(bar(STEEL), mesh=mesh, supports={"left": "x", "bottom": "y"}, pressure={},
                   loads=(InitialStress(stress=balanced),))  # fmt: skip
    system = System(Model(bodies=(body,)))
    (outcome,) = Walker(system, Control()).walk(
        [Program(laps=(Lap((Stage(name="end", target=1.0),)),))]
    )
    part = system.full("bar")
    x = part.points.reshape(2, -1)
    far = x[0] < 20.0
    stress = outcome.points["end"].responses[0].stress
    assert np.abs(stress[0] - balanced(x)[0])[far].max() < 3.0
    # at the free end there is none
    end = x[0] > 29.7
    assert np.abs(stress[0][end]).mean() < 0.2 * np.abs(balanced(x)[0, end]).mean()


def test_initial_stress_that_is_not_in_equilibrium_moves_the_body() -> None:
    pulled = InitialStress(stress=lambda x: np.array([[80.0], [0.0], [0.0], [0.0]]))
    found = loaded(bar(loads=(pulled, Traction(boundary="right", x=10.0))))
    assert found.stress("bar", "loaded")[0] == pytest.approx(10.0, abs=1e-7)
    assert np.abs(found.stress("bar")).max() < 1e-7
    assert found.displacement("bar")[0].min() == pytest.approx(-10.0 * 80.0 / E)


@pytest.mark.parametrize("condense", [True, False])
def test_the_energy_of_an_initial_stress_is_there_from_the_beginning(condense: bool) -> None:
    """Of a body reduced to its surface too, whose points are not seen."""
    pulled = InitialStress(stress=lambda x: np.tile([[-20.0], [0.0], [0.0], [0.0]], x.shape[1]))
    bed = Body(name="bed", mesh=grid(np.linspace(-4.0, 4.0, 9), np.linspace(-3.0, 0.0, 4)),
               material=ELASTIC, supports={"bottom": "xy"}, loads=(pulled,),
               condense=condense)  # fmt: skip
    block = Body(name="block", mesh=grid(np.linspace(-1.0, 1.0, 5), np.linspace(0.0, 2.0, 5)),
                 material=STEEL, loads=(Pressure(boundary="top", value=50.0),))  # fmt: skip
    pair = ContactPair(slave=("block", "bottom"), master=("bed", "top"), friction=0.3)
    found = solve(Model(bodies=(bed, block), contacts=(pair,)))
    assert found.loaded.energy.stored > 0.0
    audit = found.audit()
    assert audit.figures["audit_energy"] < 1e-8
    assert audit.passed, audit.violations


def test_what_equilibrium_makes_of_an_initial_stress_is_told() -> None:
    """A mean stress that no force balances goes; what has no resultants stays."""
    mesh = grid(np.linspace(0.0, 30.0, 31), np.linspace(0.0, 2.0, 9))
    y = np.linspace(0.0, 2.0, 41)
    field = np.zeros((4, 41, 2))
    field[0] = (balanced(np.stack([y, y]))[0] + 40.0)[:, None]
    given = InitialStress.on_grid(np.array([0.0, 30.0]), y, field)
    body = replace(bar(STEEL), mesh=mesh, supports={"left": "x", "bottom": "y"}, pressure={},
                   loads=(given,))  # fmt: skip
    x, told, left = solve(Model(bodies=(body,))).initial_stress("bar")
    far = x[0] < 20.0
    assert told[0] == pytest.approx(balanced(x)[0] + 40.0, abs=0.5)  # linear between its points
    assert np.abs(left[0] - balanced(x)[0])[far].max() < 3.5
    with pytest.raises(ModelError, match="grid must cover the whole body"):
        solve(Model(bodies=(replace(body, mesh=mesh.translated((1.0, 0.0))),)))
    for x_, y_, stress in (([0, 1], y, field[:, 1:]), ([1, 1], y, field)):
        with pytest.raises(ModelError, match=r"initial_stress\.stress = "):
            InitialStress.on_grid(np.array(x_), y_, stress)


@pytest.mark.parametrize("material", [ELASTIC, STEEL])
@pytest.mark.parametrize("slope", [0.0, 1.0])
def test_initial_stress_across_plane_strain_is_in_equilibrium(
    material: Material, slope: float
) -> None:
    """No force in the plane belongs to it: what is out of balance is rounding."""
    across = InitialStress(
        stress=lambda x: 80.0 * np.stack([0 * x[0], 0 * x[0], 1 + slope * x[1], 0 * x[0]])
    )
    body = bar(material, kinematics="plane_strain", loads=(across,))
    for loads in ((), (Pressure(boundary="right", value=10.0),)):
        found = loaded(replace(body, loads=(across, *loads)))
        _, given, left = found.initial_stress("bar")
        assert left == pytest.approx(given, abs=1e-9)
        assert found.audit().passed, found.audit().violations


@pytest.mark.parametrize("side", [{"left": "x"}, {}])
@pytest.mark.parametrize("material", [ELASTIC, STEEL])
def test_a_body_that_is_moved_as_a_whole_bears_nothing(
    material: Material, side: dict[str, str]
) -> None:
    """Forces are rounding of the stiffness times the motion: of 2e5 MPa for 1 mm."""
    loads = (Displacement(boundary="right", y=1.0, x=None if side else 0.3),)
    found = loaded(bar(material, supports=side, loads=loads))
    assert np.abs(found.stress("bar", "loaded")).max() < 2e5 * 1e-11
    assert found.displacement("bar", "loaded")[1] == pytest.approx(1.0)
    assert found.audit().passed, found.audit().violations


@pytest.mark.parametrize("condense", [True, False])
def test_initial_stress_across_plane_stress_is_refused(condense: bool) -> None:
    """It would be lost: no equilibrium in the plane holds it."""
    across = InitialStress(stress=lambda x: np.array([[0.0], [0.0], [50.0], [0.0]]))
    with pytest.raises(
        ModelError, match=r"initial_stress\.zz = 50.0: must be zero in plane stress"
    ):
        System(Model(bodies=(bar(loads=(across,), condense=condense),)))
    rounded = InitialStress(stress=lambda x: np.array([[50.0], [0.0], [1e-12], [0.0]]))
    System(Model(bodies=(bar(loads=(rounded,), condense=condense),)))


def test_initial_stress_above_the_strength_yields_before_any_load() -> None:
    soft = replace(STEEL, hardening="none", hardening_ratio=0.0)
    held = {"left": "x", "right": "x", "bottom": "y"}
    bent = InitialStress(stress=lambda x: np.stack([900.0 * x[1], *np.zeros((3, x.shape[1]))]))
    stress = loaded(bar(soft, supports=held, loads=(bent,))).unloaded.responses[0].stress[0]
    assert stress.max() == pytest.approx(RE)
    assert stress.min() == pytest.approx(900.0 * (1 - 1 / np.sqrt(3)) / 2)


@pytest.mark.parametrize("heated", ["block", "base"])
def test_a_condensed_elastic_body_expands_like_a_whole_one(heated: str) -> None:
    def bodies(condense: bool) -> Any:
        base = Body(name="base", mesh=grid(np.linspace(-3.0, 3.0, 13), np.linspace(-2.0, 0.0, 5)),
                    material=STEEL, supports={"bottom": "xy"}, condense=condense)  # fmt: skip
        block = Body(name="block", mesh=grid(np.linspace(-1.0, 1.0, 5), np.linspace(0.0, 1.0, 4)),
                     material=ELASTIC, supports={"top": "y"}, condense=condense)  # fmt: skip
        warm = Temperature(rise=lambda x: 80.0 + 20.0 * x[1], expansion=ALPHA)
        both = [replace(b, loads=(warm,)) if b.name == heated else b for b in (base, block)]
        pair = ContactPair(slave=("block", "bottom"), master=("base", "top"), friction=0.3)
        return solve(Model(bodies=tuple(both), contacts=(pair,)))

    one, other = bodies(True), bodies(False)
    assert one.contact().pressure.max() > 50.0
    assert one.contact().pressure == pytest.approx(other.contact().pressure, rel=1e-6, abs=1e-4)
    for name in ("base", "block"):
        assert one.stress(name, "loaded") == pytest.approx(other.stress(name, "loaded"), abs=1e-3)
    assert one.audit().passed, one.audit().violations
    assert other.audit().passed, other.audit().violations


@pytest.mark.parametrize(
    ("load", "message"),
    [
        (lambda: Traction(boundary="nowhere", x=1.0), "traction = .nowhere.: must name a boundary"),
        (lambda: Traction(boundary="top", x=np.inf), "traction.x = inf: must be a finite"),
        (lambda: Displacement(boundary="top"), "displacement.top = None: must give x, y or both"),
        (
            lambda: Displacement(boundary="top", y=np.nan),
            "y = nan: must be a finite number",
        ),
        (
            lambda: Displacement(boundary="top", y=math.sin),
            "y = .*: must be a number",
        ),
        (lambda: Gravity(density=7.85e-9, y=math.sin), r"gravity\.y = .*: must be a number"),
        (
            lambda: Temperature(rise=np.nan, expansion=1e-5),
            "temperature.rise = nan: must be",
        ),
        (
            lambda: Temperature(rise=1.0, expansion=np.inf),
            "expansion = inf: must be a finite",
        ),
        (
            lambda: InitialStress(stress=100.0),
            "stress = 100.0: must be a function",
        ),  # type: ignore[arg-type]
        (
            lambda: InitialStress(stress=balanced, amplitude=Amplitude.constant(0.5)),
            "initial_stress.amplitude = .*: must not be given",
        ),
    ],
)
def test_bad_loads_are_refused_by_field_value_and_what_is_allowed(load: Any, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        bar(loads=(load(),))


@pytest.mark.parametrize(
    ("load", "message"),
    [
        (Temperature(rise=lambda x: np.ones(3), expansion=1e-5), "temperature.rise = .*shape"),
        (InitialStress(stress=lambda x: np.full((4, 1), np.nan)), "must be finite at all points"),
    ],
)
def test_bad_fields_are_refused_when_the_body_is_discretised(load: Any, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        loaded(bar(loads=(load,)))
