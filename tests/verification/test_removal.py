"""Elements that are removed: a layer off a bar with residual stress, a bar cut through, reaming."""

from __future__ import annotations

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
    Pressure,
    RigidBody,
    Solution,
    Stage,
    Traction,
    solve,
)
from solver.mesh import grid, marked, within
from solver.model.loads import InitialStress, Load, Removal
from solver.model.rigid import line
from studies.scenes.scene import read_scene
from tests.architecture.sources import ROOT

E = 2e5
STEEL = Material(youngs_modulus=E, poisson_ratio=0.3)
HEIGHT, LAYER, PEAK = 1.0, 0.25, 100.0
REST, CUT = Stage(name="rest", target=1.0), Stage(name="cut", target=2.0, steps=3)
AWAY = Amplitude([1, 2], [0, 1])


def stress_before(y: np.ndarray) -> np.ndarray:
    """Return the stress along a bar, with neither force nor moment: a parabola over the height."""
    return np.asarray(PEAK * (12 * (y / HEIGHT - 0.5) ** 2 - 1))


def bar(material: Material, *loads: Load) -> Body:
    """Return the right half of a bar whose upper layer is removed."""
    mesh = grid(np.linspace(0.0, 6.0, 25), np.linspace(0.0, HEIGHT, 9))
    mesh = marked(within(mesh, "foot", ["left"], y=(0.0, 0.2)), "skin", y=(HEIGHT - LAYER, HEIGHT))
    before = InitialStress(xx=lambda x: stress_before(x[1]))
    return Body(name="bar", mesh=mesh, material=material, kinematics="plane_stress",
                supports={"left": "x", "foot": "xy"},
                loads=(before, Removal(region="skin", amplitude=AWAY), *loads))  # fmt: skip


def cut(body: Body) -> Solution:
    return solve(Model(bodies=(body,)), stages=(REST, CUT))


@pytest.mark.parametrize("hardening", ["none", "kinematic"])
def test_a_layer_that_is_removed_bends_the_bar_by_the_moment_of_its_stress(hardening: str) -> None:
    """Away from the ends: curvature M / (E I) of what is left, under minus its old moment.

    In relation to a thin layer this is Stoney's formula. Where it may yield nothing does.
    """
    found = cut(bar(Material(youngs_modulus=E, poisson_ratio=0.3, yield_stress=250.0,
                             hardening=hardening, hardening_ratio=0.02)))  # fmt: skip
    places = np.array([[1.0, 2.0, 3.0], [0.0, 0.0, 0.0]])
    after, before = (found.at("bar", places, stage)["displacement"][1] for stage in ("cut", "rest"))
    curvature = np.diff(after - before, n=2)[0]
    left = HEIGHT - LAYER
    y = np.linspace(0.0, left, 20001)
    moment = np.trapezoid(stress_before(y) * (y - left / 2), y)
    assert curvature == pytest.approx(moment / (E * left**3 / 12), rel=1e-4)
    check = found.audit("cut")
    assert check.passed, check.violations
    assert check.figures["audit_energy"] < 1e-8


def test_what_is_removed_has_no_values_and_its_neighbours_have_their_own() -> None:
    found = cut(bar(STEEL))
    places = np.array([[2.0, 2.0, 2.0], [HEIGHT - LAYER, HEIGHT - LAYER / 2, HEIGHT]])
    after = found.at("bar", places, "cut")
    left = HEIGHT - LAYER
    y = np.linspace(0.0, left, 20001)
    force, moment = (np.trapezoid(stress_before(y) * arm, y) for arm in (1.0, y - left / 2))
    expected = stress_before(np.array(left)) - force / left - moment / (left**3 / 12) * left / 2
    straight = 24 * PEAK * (1 / 8) ** 2 / 12  # stress of an element is linear, not a parabola
    assert after["stress"][0, 0] == pytest.approx(expected, abs=1.01 * straight)
    for values in after.values():
        assert np.isnan(values[..., 1:]).all()
        assert np.isfinite(values[..., 0]).all()


def test_a_bar_that_is_cut_through_between_walls_loses_all_stress_and_springs_apart() -> None:
    """Its halves become longer or shorter by stress times length over Young's modulus."""
    mesh = marked(grid(np.linspace(0.0, 10.0, 21), np.linspace(0.0, 1.0, 3)), "slot", x=(5.0, 6.0))
    between = Body(name="bar", mesh=mesh, material=STEEL, kinematics="plane_stress",
                   supports={"left": "x", "right": "x", "bottom": "y"}, loads=(
                       InitialStress(xx=PEAK), Removal(region="slot", amplitude=AWAY)))  # fmt: skip
    found = cut(between)
    np.testing.assert_allclose(found.at("bar", np.array([[2.5], [0.5]]), "rest")["stress"][0], PEAK)
    sides = found.at("bar", np.array([[2.5, 5.0, 6.0], [0.5, 0.5, 0.5]]), "cut")
    np.testing.assert_allclose(sides["stress"], 0.0, atol=1e-5 * PEAK)
    np.testing.assert_allclose(sides["displacement"][0, 1:], PEAK / E * np.array([-5.0, 4.0]),
                               rtol=1e-5)  # fmt: skip


def test_a_piece_that_is_cut_off_under_load_fails_the_audit() -> None:
    """Only the remaining stiffness of the removed elements holds it: it moves far, in balance."""
    mesh = marked(grid(np.linspace(0.0, 10.0, 21), np.linspace(0.0, 1.0, 3)), "slot", x=(5.0, 6.0))
    pull = Traction(boundary="right", x=1.0, amplitude=Amplitude([0, 1], [0, 1]))
    held = Body(name="bar", mesh=mesh, material=STEEL, kinematics="plane_stress",
                supports={"left": "x", "bottom": "y"},
                loads=(pull, Removal(region="slot", amplitude=AWAY)))  # fmt: skip
    found = cut(held)
    assert found.audit("rest").passed
    (violation,) = found.audit("cut").violations
    assert violation.startswith("removed elements of bar transmit")


def test_the_error_of_contact_pressure_counts_where_nothing_is_removed() -> None:
    mesh = marked(grid(np.linspace(0.0, 4.0, 9), np.linspace(0.0, 1.0, 5)), "end", x=(3.0, 4.0))
    block = Body(name="block", mesh=mesh, material=STEEL, supports={"bottom": "xy"},
                 loads=(Removal(region="end", amplitude=AWAY),))  # fmt: skip
    tool = RigidBody(name="tool", surfaces={"face": line((0.5, 1.0), (2.5, 1.0))},
                     y=Moved(value=-0.01, amplitude=Amplitude([0, 1], [0, 1])))  # fmt: skip
    pair = ContactPair(slave=("block", "top"), master=("tool", "face"))
    found = solve(Model(bodies=(block,), rigid=(tool,), contacts=(pair,)), stages=(REST, CUT))
    before, after = (found.audit(stage) for stage in ("rest", "cut"))
    assert after.passed
    error = before.figures["audit_error_contact"]
    assert error > 0
    assert after.figures["audit_error_contact"] == pytest.approx(error, rel=0.5)


def test_a_reamed_hole_loses_the_stress_that_lames_closed_form_says() -> None:
    """The stress across the new surface vanishes: a pressure there, as in an elastic tube."""
    scene = read_scene(ROOT / "data" / "scenes" / "expansion.toml")
    (*_, record) = scene.path(scene.parameters(), [0.0], lambda done: None)
    assert record.status.name == "OK", record.message
    stress, r = record.fields["line_stress"][1][0], np.asarray(record.fields["line_x"][1][0])
    force = np.asarray(record.fields["contact_normal_force"][1][0])
    assert record.scalars["grip"] == pytest.approx(force[8], rel=1e-9)
    np.testing.assert_allclose(force[8:13], force[8] * np.linspace(1, 0, 5), atol=1e-9)
    inner, outer = 3.2, 15.0
    kept = r > inner + 0.3
    across = np.interp(inner, r, stress[1, 0])
    shape = np.stack([1 - (outer / r) ** 2, 1 + (outer / r) ** 2])
    released = across * inner**2 / (outer**2 - inner**2) * shape
    for component, change in zip((0, 2), released, strict=True):
        after, before = stress[2, component], stress[1, component]
        np.testing.assert_allclose((after - before)[kept], change[kept],
                                   atol=0.01 * np.abs(change).max())  # fmt: skip
    assert np.isnan(stress[2][:, r < inner - 1e-9]).all()


def test_a_load_on_what_is_removed_is_refused() -> None:
    """It may act before; a thermal load may act on, because it has no forces of its own."""
    early = Amplitude([0, 0.5, 1], [0, 1, 0])
    cut(bar(STEEL, Pressure(boundary="top", value=1.0, amplitude=early)))
    with pytest.raises(ModelError, match="acts on region skin"):
        cut(bar(STEEL, Pressure(boundary="top", value=1.0, amplitude=Amplitude([0, 1], [0, 1]))))
    with pytest.raises(ModelError, match="is not all of it: skin"):
        bar(STEEL, Removal(region="shin", amplitude=AWAY))
    with pytest.raises(ModelError, match="must be a share"):
        bar(STEEL, Removal(region="skin", amplitude=Amplitude([1, 2], [0, 2])))
    with pytest.raises(ModelError, match="must not decrease"):
        bar(STEEL, Removal(region="skin", amplitude=Amplitude([1, 2, 3], [0, 1, 0])))
    with pytest.raises(ModelError, match=r"removal.amplitude = None: must be given"):
        bar(STEEL, Removal(region="skin"))
