"""Derivatives through flow, contact and friction: closed forms, laws of scale, and differences."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any
from unittest import mock

import numpy as np
import pytest

from solver import (
    Amplitude,
    Body,
    ContactPair,
    Model,
    ModelError,
    PathControl,
    Solution,
    Stage,
    Traction,
    derive,
    solve,
)
from solver.contact.state import Converged
from solver.contact.system import System
from solver.derivatives.asked import STEP, Derivatives, doubted
from solver.derivatives.family import _slopes
from solver.errors import NoContact, NotConverged
from solver.loading.increment import Increment
from solver.loading.step import newton_step
from solver.loading.walker import Walker
from solver.materials import ArmstrongFrederick, Chaboche, Elasticity, TrescaMaterial, Voce
from solver.mesh import grid
from solver.results.record import Status
from solver.rolling.passing import EXACT
from solver.rolling.scenes import rail_passes
from solver.rolling.scenes.rolling_endless import TrackPasses, load_on
from solver.rolling.scenes.wheel_rail_setup import load_on as rail_load
from solver.rolling.scenes.wheel_rail_setup import prism as rail_prism
from solver.rolling.search import search
from solver.scenes import Scene
from solver.shipped import SCENES
from studies.scenes.registry import scene_named
from studies.scenes.scene import read_scene
from tests.marks import HERE as TESTS

HERE = TESTS.parent

STEEL = Elasticity(youngs_modulus=210e3, poisson_ratio=0.3)
CONTROL = PathControl(load_step=0.1)


def tube(strength: float, pressure: float) -> Model:
    """A thick tube, radii 100 and 200 mm, that yields by Tresca's condition."""
    curve = Voce(yield_stress=strength * 2 / np.sqrt(3))
    body = Body(
        name="tube",
        mesh=grid(np.linspace(100, 200, 61), np.linspace(0, 5, 2)),
        material=TrescaMaterial(elasticity=STEEL, curve=curve),
        kinematics="axisymmetric",
        supports={"bottom": "y", "top": "y"},
        pressure={"left": pressure},
    )
    return Model(bodies=(body,))


def at_the_bore(solution: Solution) -> float:
    """Return the residual hoop stress at the bore."""
    inner = np.argmin(solution.nodes("tube")[0])
    return float(solution.stress("tube")[2, inner])


def test_residual_stress_of_a_thick_tube_has_the_derivatives_of_the_closed_form() -> None:
    """Hoop stress 2 k - p b^2 terms: by strength 2 / sqrt(3), by pressure -8/3 (b = 2 a)."""
    found = derive(tube, {"strength": 240.0, "pressure": 180.0}, at_the_bore, control=CONTROL)
    assert found["strength"] == pytest.approx(2 / np.sqrt(3), rel=1e-4)
    assert found["pressure"] == pytest.approx(-8 / 3, rel=1e-4)
    for name, value in {"strength": 240.0, "pressure": 180.0}.items():
        at = {"strength": 240.0, "pressure": 180.0}
        more, less = (
            at_the_bore(solve(tube(**{**at, name: value * share}), control=CONTROL))
            for share in (1 + 1e-4, 1 - 1e-4)
        )
        assert found[name] == pytest.approx((more - less) / (2e-4 * value), rel=1e-5)


AMPLITUDE = Amplitude([0, 1, 2, 3, 4], [0, 1, 1, -0.6, -0.6])
STAGES = [
    Stage(name=name, target=k, steps=2)
    for k, name in enumerate(("loaded", "held", "reversed", "unloaded"), 1)
]


@pytest.mark.parametrize("law", ["mises", "tresca", "recall"])
def test_flow_that_stops_and_turns_has_the_derivatives_of_differences(law: str) -> None:
    """A load is held, so that points stay on the yield surface, then reversed."""

    def block(strength: float, load: float) -> Model:
        curve = Voce(yield_stress=strength, saturation=200.0, rate=20.0)
        back = (ArmstrongFrederick(modulus=2e4, recall=100.0),) if law == "recall" else ()
        material = (
            TrescaMaterial(elasticity=STEEL, curve=curve)
            if law == "tresca"
            else Chaboche(elasticity=STEEL, curve=curve, back_stresses=back)
        )
        pull = Traction(boundary="right", x=load, y=0.1 * load, amplitude=AMPLITUDE)
        body = Body(
            name="block", mesh=grid(np.linspace(0, 4, 4), np.linspace(0, 2, 4)),
            material=material, supports={"left": "x", "bottom": "y"}, loads=(pull,),
        )  # fmt: skip
        return Model(bodies=(body,))

    def stress(solution: Solution) -> np.ndarray:
        return np.concatenate([solution.stress("block", each.name).ravel() for each in STAGES])

    compare(block, {"strength": 200.0, "load": 241.0}, stress, 2e-5, stages=STAGES)


def test_a_press_fit_that_flows_has_the_derivatives_of_differences() -> None:
    """The overlap before loading is pushed apart."""

    def fit(overlap: float, strength: float) -> Model:
        curve = Voce(yield_stress=strength, saturation=100.0, rate=20.0)
        law = Chaboche(elasticity=STEEL, curve=curve, back_stresses=())
        how: dict[str, Any] = {"material": law, "kinematics": "axisymmetric"}
        how |= {"supports": {"bottom": "y"}}
        hub = Body(name="hub", mesh=grid(np.linspace(10, 20, 9), np.linspace(0, 6, 5)), **how)
        across = np.linspace(0, 10 + overlap, 7)
        shaft = Body(name="shaft", mesh=grid(across, np.linspace(-2, 8, 9)), **how)
        sides = {"slave": ("hub", "left"), "master": ("shaft", "right")}
        return Model(bodies=(hub, shaft), contacts=(ContactPair(**sides, friction=0.2),))

    def stress(solution: Solution) -> np.ndarray:
        return solution.stress("hub", "on").ravel()

    stages = [Stage(name="on", target=1.0, steps=2)]
    compare(fit, {"overlap": 0.03, "strength": 250.0}, stress, 1e-5, stages=stages)


def compare(
    make: Callable[..., Model], at: dict[str, float], of: Callable[[Solution], np.ndarray],
    tolerance: float, **how: Any,
) -> None:  # fmt: skip
    """Compare derivatives with central differences, in relation to their largest."""
    found = derive(make, at, of, **how)
    for name, value in at.items():
        more, less = (
            of(solve(make(**{**at, name: value * share}), **how)) for share in (1 + 1e-5, 1 - 1e-5)
        )
        expected = (more - less) / 2e-5
        size = np.abs(expected).max()
        assert size > 1.0
        assert np.abs(value * found[name] - expected).max() < tolerance * size, name


def pads(
    friction: float, modulus: float, pressure: float, strength: float = 200.0, law: str = "recall"
) -> Model:
    """Two pads pressed together, the upper one wider on top."""
    elasticity = Elasticity(youngs_modulus=2e5, poisson_ratio=0.3)
    back = (ArmstrongFrederick(modulus=modulus, recall=100.0),)
    linear = Voce(yield_stress=strength, modulus=modulus)
    material = (
        TrescaMaterial(elasticity=elasticity, curve=linear)
        if law == "tresca"
        else Chaboche(elasticity=elasticity, curve=Voce(yield_stress=strength), back_stresses=back)
    )
    upper = Body(
        name="upper", mesh=grid(np.linspace(0, 5, 6), np.linspace(0, 4, 4)), material=material,
        supports={"left": "x"}, pressure={"top": pressure},
    )  # fmt: skip
    lower = Body(
        name="lower", mesh=grid(np.linspace(0, 10, 11), np.linspace(-8, 0, 5)), material=material,
        supports={"left": "x", "bottom": "y"},
    )  # fmt: skip
    pair = ContactPair(slave=("upper", "bottom"), master=("lower", "top"), friction=friction)
    return Model(bodies=(upper, lower), contacts=(pair,))


def fields(solution: Solution) -> np.ndarray:
    """Return residual stress at all nodes, and pressure and shear under load."""
    contact = solution.contact()
    own = [solution.stress(name).ravel() for name in ("upper", "lower")]
    return np.concatenate([*own, contact.pressure, contact.shear])


def test_whole_fields_equal_differences_of_runs() -> None:
    control = PathControl(load_step=0.25, unload_steps=2)
    at = {"friction": 0.2, "modulus": 2e4, "pressure": 320.0}
    compare(pads, at, fields, 1e-5, control=control)


def numbers(scene: Scene, parameters: Any, by: tuple[str, ...], of: tuple[str, ...]) -> Any:
    """Return a run of a scene: its record."""
    with_them = replace(scene, derivatives=Derivatives(by=by, of=of))
    values = [getattr(parameters, scene.branch)] if scene.branch else [0.0]
    (record,) = with_them.path(parameters, values, lambda share: None)
    return record


def shares(record: Any, of: str, by: tuple[str, ...]) -> list[float]:
    """Return the elasticities of a number: its relative change by that of each parameter."""
    values = record.scalars
    each = ((values[f"d_{of}_d_{name}"], getattr(record.parameters, name)) for name in by)
    return [slope * value / values[of] for slope, value in each]


def test_a_punch_obeys_the_laws_of_scale() -> None:
    """Stress is of degree one in yield stress and modulus together, and of zero in the size."""
    scene, by = SCENES["punch"], ("yield_stress", "youngs_modulus", "half_width")
    of = ("residual_x_half_plane", "residual_x_punch", "peak_residual_tension", "plastic_work")
    record = numbers(
        scene, scene.parameters(accuracy="draft", load_ratio=0.7, friction=0.3), by, of
    )
    assert record.message == ""
    for name in of:
        degrees = [2.0, -1.0, 2.0] if name == "plastic_work" else [1.0, 0.0, 0.0]
        assert shares(record, name, by) == pytest.approx(degrees, abs=2e-5), name


@pytest.mark.long
def test_a_ball_obeys_the_laws_of_scale() -> None:
    """Surfaces that turn: lengths are of degree one in the radius, and of zero in the stress."""
    scene, by = scene_named("ball"), ("yield_stress", "youngs_modulus", "radius")
    parameters = scene.parameters(accuracy="draft", load_ratio=2.0)
    record = numbers(scene, parameters, by, ("approach", "crater_depth", "max_plastic_strain"))
    for name, size in (("approach", 1.0), ("crater_depth", 1.0), ("max_plastic_strain", 0.0)):
        strength, modulus, radius = shares(record, name, by)
        assert strength + modulus == pytest.approx(0.0, abs=1e-4)
        assert radius == pytest.approx(size, abs=1e-4)


def test_a_punch_of_large_strain_obeys_the_laws_of_scale() -> None:
    scene, by = SCENES["punch"], ("yield_stress", "youngs_modulus")
    parameters = scene.parameters(
        accuracy="draft", growth=2.5, load_ratio=0.5, friction=0.3, strain="large", element="quad4"
    )
    record = numbers(scene, parameters, by, ("residual_x_half_plane",))
    assert sum(shares(record, "residual_x_half_plane", by)) == pytest.approx(1.0, abs=1e-4)


def test_peak_pressure_of_a_roller_grows_with_the_root_of_its_force() -> None:
    """Hertz: p0 ~ sqrt(P), so that dp0 / dP = p0 / (2 P)."""
    scene = read_scene(HERE / "data/scenes/roller.toml")
    record = numbers(scene, scene.parameters(), ("load",), ("peak_pressure",))
    assert shares(record, "peak_pressure", ("load",)) == pytest.approx([0.5], abs=5e-3)


def bar(strength: float, load: float) -> Model:
    """A bar in tension; its stress is the load."""
    material = Chaboche(
        elasticity=STEEL, curve=Voce(yield_stress=strength, saturation=900.0, rate=9.0),
        back_stresses=(),
    )  # fmt: skip
    body = Body(
        name="bar", mesh=grid(np.linspace(0, 1, 2), np.linspace(0, 1, 2)), material=material,
        kinematics="axisymmetric", supports={"bottom": "y"}, pressure={"top": -load},
    )  # fmt: skip
    return Model(bodies=(body,))


@pytest.mark.parametrize("gap", [3e-4, 3e-6, -3e-6, -3e-4])
def test_the_range_ends_where_a_bar_yields(gap: float, caplog: pytest.LogCaptureFixture) -> None:
    """The fifth of ten increments ends by a share ``gap`` below yield."""
    at, control = {"strength": 200.0, "load": 400.0 * (1 - gap)}, PathControl(load_step=0.1)
    assert ranges(bar, at, control) == pytest.approx([abs(gap)] * 2, rel=2e-3)
    derive(bar, at, lambda solution: 0.0, control=control)
    assert [*caplog.messages] == [
        f"derivatives by {name} may be one-sided: a relative change of 3.0e-06 decides "
        "whether a point yields, touches, sticks or slides"
        for name in (at if abs(gap) < 1e-5 else ())
    ]


def test_an_elastic_run_in_one_increment_ends_its_range_where_it_would_yield() -> None:
    at, control = {"strength": 200.0, "load": 200.0 * (1 - 3e-4)}, PathControl(load_step=0.1)
    assert ranges(bar, at, control) == pytest.approx([3e-4] * 2, rel=2e-3)


@pytest.mark.parametrize("law", ["recall", pytest.param("tresca", marks=pytest.mark.long)])
def test_sets_hold_up_to_the_end_of_the_range_and_not_beyond(law: str) -> None:
    def pressed(friction: float, strength: float, pressure: float) -> Model:
        return pads(friction, 2e4, pressure, strength, law)

    at = {"friction": 0.2, "strength": 200.0, "pressure": 320.0}
    control = PathControl(load_step=0.25, unload_steps=2)
    own = sets(pressed(**at), control)
    for (name, value), share in zip(at.items(), ranges(pressed, at, control), strict=True):
        assert 1e-5 < share < 0.02

        def same(times: float, name: str = name, value: float = value * share) -> bool:
            return sets(pressed(**{**at, name: at[name] + times * value}), control) == own

        assert same(0.9) and same(-0.9), name
        assert not (same(1.1) and same(-1.1)), name


def ranges(make: Callable[..., Model], at: dict[str, float], control: PathControl) -> list[float]:
    """Return for each parameter the relative change up to which sets hold."""
    beside = {name: make(**{**at, name: value * (1 + STEP)}) for name, value in at.items()}
    _, *found = solve(make(**at), beside=beside, control=control).beside
    return [-STEP * each.unloaded.near for each in found]


def sets(model: Model, control: PathControl) -> list[Any]:
    """Return which points yield, and the states of contact vertices, at each increment."""

    def watch(now: Converged) -> Any:
        yields = [each.yielding.tolist() for each in now.responses]
        return yields, [each.status.tolist() for each in now.state.contacts]

    (outcome,) = Walker(System(model), control, watch=watch).walk([control.program(1.0)])
    return list(outcome.history)


def test_of_places_that_share_the_maximum_the_first_is_named_and_stays() -> None:
    scene = read_scene(HERE / "data/scenes/bending.toml")
    record = numbers(scene, scene.parameters(), ("ratio",), ("residual", "residual_x"))
    assert record.scalars["d_residual_d_ratio"] == pytest.approx(300.0, rel=1e-6)
    assert record.scalars["residual_x"] == 0.0
    assert record.scalars["d_residual_x_d_ratio"] == 0.0


def test_what_jumps_has_no_derivative() -> None:
    """A place that moves by more than 1e-3 of itself has moved to another node."""
    found = _slopes({"place": 2.0, "value": 2.0}, {"place": 2.01, "value": 2.0001}, 1e-4)
    assert np.isnan(found["place"])
    assert found["value"] == pytest.approx(1.0)


@pytest.mark.parametrize("by", ["unload_steps", "hardening"])
def test_what_has_no_decimals_is_refused(by: str) -> None:
    scene = SCENES["punch"]
    with pytest.raises(ModelError, match="must be a parameter with decimals") as caught:
        numbers(scene, scene.parameters(accuracy="draft"), (by,), ("plastic_work",))
    assert caught.value.field == "by[0]"


def test_a_run_in_which_a_parameter_is_zero_has_no_derivative_by_it() -> None:
    scene = SCENES["punch"]
    parameters = scene.parameters(accuracy="draft", friction=0.0, load_ratio=0.2)
    record = numbers(scene, parameters, ("friction", "yield_stress"), ("plastic_work",))
    assert np.isnan(record.scalars["d_plastic_work_d_friction"])
    assert np.isfinite(record.scalars["d_plastic_work_d_yield_stress"])
    assert "no derivative was found for d_plastic_work_d_friction" in record.message


def test_a_number_that_changes_the_elements_is_refused() -> None:
    def plate(size: float) -> Model:
        parts = 3 if size < 1 else 4
        body = Body(
            name="plate", mesh=grid(np.linspace(0, 1, parts), np.linspace(0, 1, 3)),
            material=TrescaMaterial(elasticity=STEEL, curve=Voce(yield_stress=200.0)),
            supports={"left": "x", "bottom": "y"}, pressure={"right": 10.0},
        )  # fmt: skip
        return Model(bodies=(body,))

    with pytest.raises(ModelError, match=r"size = 'the elements of plate': must not change"):
        derive(plate, {"size": 1.0}, lambda solution: 0.0)


def elastic_step(self: Increment, end: Converged, operators: Any) -> Any:
    """Return the increment after one step with the elastic stiffness, whatever forces are left."""
    with mock.patch("solver.loading.increment._small", lambda *sizes: True):
        return LINEARISED(self, end, [each.elastic for each in self.system.operators])


def long_step(self: Increment, end: Converged, operators: Any) -> Any:
    """Return the increment after one step that is a hundredth too long."""

    def long(*given: Any) -> Any:
        step = newton_step(*given)
        return step and replace(step, u=tuple(1.01 * u for u in step.u))

    with (
        mock.patch("solver.loading.increment._small", lambda *sizes: True),
        mock.patch("solver.loading.increment.newton_step", long),
    ):
        return LINEARISED(self, end, operators)


LINEARISED = Increment.linearised


@cache
def punched() -> list[Any]:
    """Return the records of three punches."""
    scene = SCENES["punch"]
    given = {"smallest_element": 0.05, "growth": 3.0, "load_ratio": 0.7, "load_step": 0.2}
    given |= {"accuracy": "draft", "unload_steps": 2}
    asked = ("friction", "yield_stress"), ("peak_residual_tension", "plastic_work")
    punches = [scene.parameters(**given, friction=friction) for friction in (0.12, 0.14, 0.16)]
    return [numbers(scene, each, *asked) for each in punches]


@pytest.mark.parametrize("fault", [elastic_step, long_step])
def test_the_audit_finds_a_fault_in_the_step_of_a_neighbour(
    fault: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One increment of each run is solved again: in some of the runs the fault is in it."""
    right = punched()
    assert max(each.scalars["audit_derivatives"] for each in right) < 2e-5
    assert {each.message for each in right} == {""}
    monkeypatch.setattr(Increment, "linearised", fault)
    wrong = punched.__wrapped__()
    assert max(each.scalars["audit_derivatives"] for each in wrong) > 1e-3
    for each in wrong:
        off = each.scalars["audit_derivatives"]
        assert each.status is Status.OK, "the run itself is right"
        assert (f"audit_derivatives = {off:.1e}: " in each.message) == (off > 1e-3)


def test_an_audit_that_could_not_be_made_is_in_the_message() -> None:
    assert doubted({}) == doubted({"audit_derivatives": 1e-6}) == []
    assert "not audited" in doubted({"audit_derivatives": float("nan")})[0]


def rolled(**given: Any) -> Any:
    """Return parameters of a braked wheel on an endless track."""
    usual = {"accuracy": "draft", "load_ratio": 2.2, "friction": 0.2, "traction": 0.5}
    return SCENES["rolling"].parameters(**{**usual, **given})


PASSED = (
    "surface_residual_x", "lowest_residual_x", "surface_residual_z", "max_plastic_strain",
    "peak_residual_tension", "creepage", "axle_height", "peak_contact_pressure", "pass_creepage",
    "residual_profile",
)  # fmt: skip


def test_ten_steady_passes_obey_the_laws_of_scale() -> None:
    """Pressure and residual stress are of degree one in yield stress and modulus together.

    After ten passes residual stress is so curved over a parameter, as the edge of contact moves
    through the mesh, that a difference of 1e-6 has an error of 3e-5 (measured; of 3e-4 with 1e-5).
    """
    by = ("yield_stress", "youngs_modulus")
    parameters = rolled(passes=10, hardening="kinematic", element_size=2.2, growth=2.0)
    record = numbers(SCENES["rolling"], parameters, by, PASSED)
    assert record.message == ""
    for name in PASSED:
        stress = "residual" in name or name.endswith("pressure")
        value, *slopes = (
            np.asarray(record.fields[each][1] if each in record.fields else record.scalars[each])
            for each in (name, *(f"d_{name}_d_{parameter}" for parameter in by))
        )
        each = zip(slopes, by, strict=True)
        changes = [slope * getattr(record.parameters, parameter) for slope, parameter in each]
        size = np.abs(value).max() + np.nanmax(np.abs(changes))
        off = changes[0] + changes[1] - (value if stress else 0.0)
        assert np.nanmax(np.abs(off)) < 1e-4 * size, name


@pytest.mark.parametrize("law", ["linear", "recall"])
def test_steady_passes_there_and_back_have_the_derivatives_of_differences(law: str) -> None:
    """A compiled sweep of linear hardening, and one of any law; stress over the largest one.

    The radius moves the nodes of the rim, where gaps are known up to rounding. A radius larger by
    1e-5 is beyond a switch within a column: the differences are of 1e-6.
    """
    hard: dict[str, Any] = {"hardening": "kinematic"}
    if law == "recall":
        hard = {"hardening": "chaboche", "back_stresses": ((4e4, 300.0), (5e3, 0.0))}
    parameters = rolled(passes=2, direction="back_and_forth", element_size=3.3, growth=2.0, **hard)
    # what the radius moves is the same for all laws
    scene, by = SCENES["rolling"], ("friction", "radius") if law == "linear" else ("friction",)
    found = numbers(scene, parameters, by, PASSED[:-2]).scalars
    for name in by:
        value = getattr(parameters, name)
        more, less = (
            exact(replace(parameters, **{name: value * share})) for share in (1 + 1e-6, 1 - 1e-6)
        )
        for of in PASSED[:-2]:
            expected = (more[of] - less[of]) / 2e-6
            stress = abs(found["lowest_residual_x"]) if "residual" in of else 0.0
            size = max(abs(found[of]), abs(expected), stress)
            off = abs(found[f"d_{of}_d_{name}"] * value - expected)
            assert off < (1e-4 if name == "radius" else 5e-5) * size, (of, name)


def exact(parameters: Any) -> Any:
    """Return the numbers of passes that are solved to the tolerance of differences."""
    with (
        mock.patch("solver.rolling.plane.rolling.TOLERANCE", EXACT),
        mock.patch("solver.rolling.scenes.rolling_endless.load_on", lambda *a: load_on(*a).exact),
    ):
        (record,) = SCENES["rolling"].path(parameters, [parameters.passes], lambda share: None)
    return record.scalars


def test_a_neighbour_with_another_mesh_is_taken_on_the_other_side() -> None:
    """The half-width of the mesh is rounded to three digits: a smaller load has a coarser one."""
    usual = rolled(passes=1, growth=2.0)
    rounding = float(f"{usual.half_width:.2f}") + 0.005
    edge = usual.load_ratio * rounding / usual.half_width
    near, beyond = (
        rolled(passes=1, load_ratio=edge * (1 + share), growth=2.0) for share in (5e-7, 3e-6)
    )
    below = replace(near, load_ratio=near.load_ratio * (1 - 1e-6))
    assert below.mesh_width < near.mesh_width == beyond.mesh_width
    same_slope("load_ratio", near, beyond)


def test_a_neighbour_whose_rim_is_longer_is_taken_on_the_other_side() -> None:
    parameters = rolled(passes=1, radius=334.92, element_size=0.8414898492000003, growth=2.0)
    softer = replace(parameters, youngs_modulus=parameters.youngs_modulus * (1 - 1e-6))
    assert softer.reach > parameters.reach + 0.5
    stiffer = replace(parameters, youngs_modulus=parameters.youngs_modulus * (1 + 5e-6))
    same_slope("youngs_modulus", parameters, stiffer)


def same_slope(by: str, *each: Any) -> None:
    """Check that runs with almost the same parameters have the same derivative."""
    scene, of = SCENES["rolling"], ("axle_height",)
    found = [numbers(scene, parameters, (by,), of) for parameters in each]
    assert [record.message for record in found] == ["", ""]
    (own,), (other,) = (shares(record, *of, (by,)) for record in found)
    assert abs(own) > 0.1 and own == pytest.approx(other, rel=1e-4)


def test_a_neighbour_that_is_not_found_leaves_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    def follow(self: TrackPasses, *given: Any) -> Any:
        if self.parameters.friction != 0.2:
            raise NotConverged("no pass was found")
        return FOLLOW(self, *given)

    monkeypatch.setattr(TrackPasses, "follow", follow)
    by = ("friction", "yield_stress")
    record = numbers(SCENES["rolling"], rolled(passes=1), by, ("axle_height", "residual_profile"))
    names = "d_axle_height_d_friction, d_residual_profile_d_friction"
    assert record.message == f"no derivative was found for {names}"
    assert np.isnan(record.scalars["d_axle_height_d_friction"])
    assert np.isfinite(record.scalars["d_axle_height_d_yield_stress"])
    assert np.isfinite(record.fields["d_residual_profile_d_yield_stress"][1]).all()


FOLLOW = TrackPasses.follow


@pytest.mark.long
def test_a_neighbour_that_fails_under_load_does_not_end_its_run() -> None:
    scene = scene_named("elastic_punch")
    parameters = scene.parameters(friction=0.02)
    record = numbers(scene, parameters, ("friction",), ("peak_contact_pressure",))
    assert record.message == "no derivative was found for d_peak_contact_pressure_d_friction"


@pytest.mark.long
@pytest.mark.parametrize(("accuracy", "error"), [("standard", 1e-5), ("fine", 1e-3)])
def test_rounding_on_a_fine_mesh_leaves_derivatives_and_their_audit(
    accuracy: str, error: float
) -> None:
    """The forces left after unloading are known to 1e-10 of the load, to 5e-10 on the finer mesh.

    Plastic work is of degree one in yield stress and modulus together.
    """
    parameters = SCENES["punch"].parameters(accuracy=accuracy, load_ratio=0.7)
    by = ("yield_stress", "youngs_modulus")
    record = numbers(SCENES["punch"], parameters, by, ("plastic_work",))
    assert record.message == ""
    assert record.scalars["audit_derivatives"] < error
    assert sum(shares(record, "plastic_work", by)) == pytest.approx(1.0, abs=error)


RAIL = {"accuracy": "draft", "traction": 0.3, "friction": 0.3}
CHABOCHE = {"hardening": "chaboche", "back_stresses": ((4e4, 300.0), (5e3, 0.0))}
IN_SPACE: dict[str, tuple[str, dict[str, Any], tuple[str, ...]]] = {
    "rail": ("wheel_rail", {**RAIL, "passes": 2, "lateral_position": -4.0}, ("lateral_position",)),
    "recall": ("wheel_rail", {**RAIL, **CHABOCHE}, ("yield_stress",)),
    # the nodes move with the size of the ellipse
    "raceway": (
        "raceway", {**RAIL, "friction": 0.1, "load_ratio": 1.8, "passes": 2},
        ("friction", "load_ratio"),
    ),
}  # fmt: skip
"""Scene, parameters, and parameters by which a run is derived."""


@pytest.mark.parametrize("name", IN_SPACE)
def test_passes_in_space_have_the_derivatives_of_differences(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Relative to the number, or to its derivative times the parameter if that is larger."""
    kind, given, by = IN_SPACE[name]
    scene = SCENES[kind]
    of = ("axle_height", "creepage", "peak_residual_tension", "max_plastic_strain")
    parameters = scene.parameters(**given)
    record = numbers(scene, parameters, by, of)
    assert "derivative" not in record.message

    def exactly(track: Any, law: Any, load: Any, *rest: Any, **how: Any) -> Any:
        return search(track, law, load.exact, *rest, **how, tolerance=rail_passes.RailPasses.exact)

    monkeypatch.setattr(rail_passes, "search", exactly)
    for each in by:
        value = getattr(parameters, each)
        more, less = (
            next(scene.path(changed, [changed.passes], lambda share: None)).scalars
            for changed in (
                replace(parameters, **{each: value * share}) for share in (1 + 1e-5, 1 - 1e-5)
            )
        )
        changes = {one: (more[one] - less[one]) / 2e-5 for one in of}
        assert max(abs(changes[one] / record.scalars[one]) for one in of) > 0.1
        for one, expected in changes.items():
            size = max(abs(record.scalars[one]), abs(expected))
            off = abs(record.scalars[f"d_{one}_d_{each}"] * value - expected)
            assert off < 5e-5 * size, (one, each)


def test_passes_with_derivatives_do_not_go_on_from_a_run_without() -> None:
    """A stored run has no state of its neighbours."""
    scene = SCENES["wheel_rail"]
    parameters, of = scene.parameters(**RAIL, passes=2), ("axle_height",)
    first, second = scene.path(parameters, [1, 2], lambda share: None)
    assert first.state()
    with_them = replace(scene, derivatives=Derivatives(by=("friction",), of=of))
    (begun,) = with_them.path(parameters, [2], lambda share: None, begun=first.state())
    whole = numbers(scene, parameters, ("friction",), of)
    assert begun.scalars["axle_height"] == second.scalars["axle_height"]
    name = "d_axle_height_d_friction"
    assert begun.scalars[name] == whole.scalars[name] != 0
    assert not whole.state(), "a longer run with derivatives begins anew, and estimates say so"


def test_a_longer_length_after_which_waves_repeat_is_another_mesh() -> None:
    """Between near wheels the window has no room to grow with it."""
    scene = SCENES["wheel_rail"]
    lighter, heavier = (
        scene.parameters(
            accuracy="draft", wheel_distance=20.0, foundation=1e4, lateral_position=-6.0, load=load,
        )
        for load in (250e3, 252e3)
    )  # fmt: skip
    passes = rail_passes.RailPasses(rail_prism, rail_load, lighter, scene.view(lighter), 1.0)
    assert passes.same_mesh(replace(lighter, load=249.9e3))
    assert not passes.same_mesh(heavier)


def test_a_locked_wheel_has_no_derivative_by_traction() -> None:
    """With a little less traction it turns: the height of its axle would fall by 0.001 mm."""
    parameters = SCENES["wheel_rail"].parameters(**{**RAIL, "traction": 1.0, "friction": 0.2})
    record = numbers(SCENES["wheel_rail"], parameters, ("traction", "friction"), ("axle_height",))
    assert np.isnan(record.scalars["d_axle_height_d_traction"])
    assert np.isfinite(record.scalars["d_axle_height_d_friction"])
    assert "no derivative was found for d_axle_height_d_traction" in record.message


def test_passes_that_are_found_with_smaller_elements_keep_their_derivatives(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The first search fails, as of a contact that draft elements do not resolve."""
    scene, given = SCENES["raceway"], {"load": "hertz", "load_ratio": 1.8, "friction": 0.1}
    searches = iter([True])

    def lost(*passed: Any, **how: Any) -> Any:
        if next(searches, False):
            raise NoContact("no contact forces were found")
        return search(*passed, **how)

    monkeypatch.setattr(rail_passes, "search", lost)
    asked = ("yield_stress",), ("max_plastic_strain",)
    record, plain = (
        numbers(scene, scene.parameters(accuracy=accuracy, **given), *asked)
        for accuracy in ("draft", "standard")
    )
    assert "computed with accuracy = standard instead" in record.message
    name = "d_max_plastic_strain_d_yield_stress"
    assert record.scalars[name] == plain.scalars[name] != 0


def test_a_size_of_the_elements_of_a_track_is_refused() -> None:
    with pytest.raises(ModelError, match=r"element_size = .*must not change the mesh"):
        numbers(SCENES["rolling"], rolled(), ("element_size",), PASSED)


def test_a_track_with_ends_has_no_derivatives() -> None:
    with pytest.raises(ModelError, match=r"track = 6\.0: must be endless"):
        numbers(SCENES["rolling"], rolled(track=6.0), ("friction",), PASSED)
