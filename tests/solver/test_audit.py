"""The audit notices what is wrong with a solution."""

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
    PathControl,
    Pressure,
    Stage,
    Temperature,
    solve,
)
from solver.audit.pairs import AuditedPair
from solver.audit.report import audit
from solver.mesh import grid, mapped
from solver.scenes.punch import PunchParameters
from solver.scenes.punch_setup import model
from tests.verification.bodies import block

pytestmark = pytest.mark.solves


@pytest.fixture(scope="module")
def solution():
    parameters = PunchParameters(
        smallest_element=0.02, growth=2.0, half_plane_size=8.0, friction=0.3
    )
    return solve(model(parameters), load=0.6, control=PathControl(load_step=0.1))


def judged(solution, loaded, dissipation=0.0):
    return audit(solution.system, loaded, solution.unloaded, dissipation)


def test_a_converged_solution_passes(solution):
    assert judged(solution, solution.loaded).passed


@pytest.mark.parametrize("factor", [0.5, np.nan])
def test_wrong_stress_is_noticed(solution, factor):
    responses = tuple(r._replace(stress=factor * r.stress) for r in solution.loaded.responses)
    check = judged(solution, replace(solution.loaded, responses=responses))
    assert any("audit_residual" in text for text in check.violations)


@pytest.mark.parametrize("factor", [0.5, np.nan])
def test_wrong_contact_forces_are_noticed(solution, factor):
    state = solution.loaded.state
    contacts = tuple(replace(c, normal=factor * c.normal) for c in state.contacts)
    check = judged(solution, replace(solution.loaded, state=replace(state, contacts=contacts)))
    assert any("audit_residual" in text for text in check.violations)


@pytest.mark.parametrize("dissipation", [-1.0, np.nan])
def test_wrong_dissipation_is_noticed(solution, dissipation):
    assert not judged(solution, solution.loaded, dissipation).passed


def test_a_body_that_sinks_into_the_other_is_noticed(solution):
    state = solution.loaded.state
    u = tuple(ui + (0.01 if k == 1 else 0.0) for k, ui in enumerate(state.u))
    check = judged(solution, replace(solution.loaded, state=replace(state, u=u)))
    assert any("audit_closed_gap" in text for text in check.violations)
    assert any("audit_prescribed" in text for text in check.violations), "its supports hold it"


def test_bodies_that_are_not_released_are_noticed(solution):
    check = audit(solution.system, solution.loaded, solution.loaded, 0.0)
    assert [text.split(" = ")[0] for text in check.violations] == ["audit_contact_after_unloading"]


def test_a_little_load_left_on_is_noticed(solution):
    responses = tuple(
        left._replace(stress=left.stress + 1e-5 * under.stress)
        for left, under in zip(solution.unloaded.responses, solution.loaded.responses, strict=True)
    )
    unloaded = replace(solution.unloaded, responses=responses)
    check = audit(solution.system, solution.loaded, unloaded, 0.0)
    assert any("audit_contact_after_unloading" in text for text in check.violations)


def test_a_closed_gap_has_a_floor_from_the_forces_in_the_model():
    """A block is hardly pressed, and 0.012 nm away; another one is pressed, or not."""
    x, y, held = np.linspace(-2.0, 2.0, 5), np.linspace(0.0, 2.0, 3), {"bottom": "xy"}
    steel = Material(youngs_modulus=2e5, poisson_ratio=0.3)
    base = block("base", x, y - 2.0, material=steel, supports=held)
    top = block("top", x, y, material=steel, pressure={"top": 0.1}, supports={"left": "x"})

    def closed(beside, gap):
        other = block("other", x + 9.0, y, material=steel, pressure=beside, supports=held)
        pair = ContactPair(slave=("top", "bottom"), master=("base", "top"))
        found = solve(Model(bodies=(top, base, other), contacts=(pair,)))
        state, raised = found.loaded.state, found.system.part("top")
        u = tuple(ui + (gap if k == raised else 0.0) for k, ui in enumerate(state.u))
        audited = AuditedPair(found.system, 0, replace(found.loaded, state=replace(state, u=u)))
        assert audited.figures["audit_closed_gap"] == pytest.approx(gap)
        return audited.figures["audit_closed_gap"] <= audited.limits["audit_closed_gap"]

    assert closed({}, 3e-9)  # in proportion to the bodies
    assert not closed({}, 1.2e-8)
    assert closed({"top": 1e4}, 1.2e-8)
    assert not closed({"top": 1e4}, 2.4e-8)


# -- contact on the deformed bodies --------------------------------------------------------------


def hump(sliding):
    """A soft block, held at its top and pushed sideways, over a steel hump of radius 10 mm."""

    def arc(p):
        return np.stack([p[0], p[1] - (10 - np.sqrt(100 - p[0] ** 2)) * (p[1] + 6) / 6])

    steel = Material(youngs_modulus=2e5, poisson_ratio=0.3)
    base = Body(name="hump", mesh=mapped(grid(np.linspace(-8, 8, 33), np.linspace(-6, 0, 9)), arc),
                material=steel, supports={"bottom": "xy"})  # fmt: skip
    soft = block("soft", np.linspace(-3, 3, 13), np.linspace(-0.02, 8, 9),
                 material=Material(youngs_modulus=10.0, poisson_ratio=0.3),
                 supports={"top": "xy"}, pressure={"left": 2.0})  # fmt: skip
    pair = ContactPair(slave=("soft", "bottom"), master=("hump", "top"), sliding=sliding)
    return Model(bodies=(soft, base), contacts=(pair,))


def test_small_sliding_that_moves_far_is_noticed():
    """The pairing at rest holds the block up where the hump has fallen away under it."""
    solution = solve(hump("small"), control=PathControl(load_step=0.25))
    moved = solution.displacement("soft", "loaded")[0].max()
    assert moved > 3.0
    check = solution.audit()
    assert [text.split(" = ")[0] for text in check.violations] == ["audit_overlap"]
    assert check.figures["audit_overlap"] > 0.2


def test_finite_sliding_follows_the_bodies():
    solution = solve(hump("finite"), load=0.5, control=PathControl(load_step=0.05))
    assert solution.displacement("soft", "loaded")[0].max() > 3.0
    check = solution.audit()
    # the hump has too few elements for its contact, which is not what is looked at here
    assert {text.split()[0] for text in check.violations} <= {"audit_contact_resolution"}
    assert check.figures["audit_closed_gap"] < 1e-4


# -- work ------------------------------------------------------------------------------------------


def test_the_work_of_the_loads_is_found_again(solution):
    energy = solution.loaded.energy
    assert energy.external > 0
    assert energy.plastic > 0
    assert energy.friction > 0
    assert judged(solution, solution.loaded).figures["audit_energy"] < 1e-9


def test_released_and_unloaded_states_pass_by_themselves():
    """Bodies that were taken apart give up what friction had locked in; no load is left."""
    there = Amplitude([0, 1, 2], [0, 1, 0])
    steel = Material(youngs_modulus=2e5, poisson_ratio=0.3, yield_stress=400.0)
    pad = block("pad", np.linspace(0, 10, 6), np.linspace(0, 2, 3), supports={"left": "x"},
                loads=(Pressure(boundary="top", value=500.0, amplitude=there),))  # fmt: skip
    base = block("base", np.linspace(-4, 14, 13), np.linspace(-6, 0, 5), material=steel,
                 supports={"bottom": "xy"})  # fmt: skip
    pair = ContactPair(slave=("pad", "bottom"), master=("base", "top"), friction=0.3)
    for apart in (True, False):
        stages = (Stage(name="pressed", target=1.0, steps=4),
                  Stage(name="free", target=2.0, steps=4, apart=apart))  # fmt: skip
        solution = solve(Model(bodies=(pad, base), contacts=(pair,)), stages=stages)
        for stage in ("pressed", "free"):
            check = solution.audit(stage)
            assert check.passed, check.violations
            assert check.figures["audit_energy"] < 1e-9


def test_lost_work_is_noticed(solution):
    energy = solution.loaded.energy
    short = replace(energy, plastic=0.9 * energy.plastic)
    check = judged(solution, replace(solution.loaded, energy=short))
    assert any("audit_energy" in text for text in check.violations)


@pytest.mark.parametrize("element", ["quad8", "tri6"])
@pytest.mark.parametrize("friction", [0.05, 0.3])
def test_work_is_found_again_where_contact_spreads(element, friction):
    """Vertices of a curved body come into contact, and slip before they touch."""

    def bent(p):
        return np.stack([p[0], p[1] + p[0] ** 2 / 40 * (1 - p[1] / 3)])

    cells = "tri" if element.startswith("tri") else "quad"
    mesh = grid(np.linspace(0, 2, 17), np.linspace(0, 3, 8), cells)
    if cells == "quad":
        mesh = mapped(mesh, bent)
    else:
        mesh = type(mesh)(bent(mesh.p), mesh.t, sort_t=False).with_boundaries(dict(mesh.boundaries))
    steel = Material(youngs_modulus=2e5, poisson_ratio=0.3)
    soft = Material(youngs_modulus=5e4, poisson_ratio=0.3, yield_stress=200.0)
    fields = {"kinematics": "axisymmetric", "element": element}
    ball = Body(name="ball", mesh=mesh, material=steel, supports={"left": "x"},
                pressure={"top": 100.0}, **fields)  # fmt: skip
    base = block("base", np.linspace(0, 4, 25), np.linspace(-4, 0, 9), material=soft,
                 supports={"left": "x", "bottom": "y"}, **fields)  # fmt: skip
    # the work is exact where the directions of contact are fixed
    pair = ContactPair(slave=("ball", "bottom"), master=("base", "top"), friction=friction,
                       sliding="small")  # fmt: skip
    check = solve(Model(bodies=(ball, base), contacts=(pair,)),
                  control=PathControl(load_step=0.25)).audit()  # fmt: skip
    assert check.passed, check.violations
    assert check.figures["audit_energy"] < 1e-9


# -- where nothing acts ----------------------------------------------------------------------------


def expanding(yield_stress, kinematics, **heat):
    """A bar that grows by 0.012 mm in heat, without a force."""
    steel = Material(youngs_modulus=2e5, poisson_ratio=0.3, yield_stress=yield_stress)
    rise = Temperature(rise=100.0, expansion=1.2e-5, **heat)
    bar = block("bar", np.linspace(0, 10, 6), np.linspace(0, 2, 3), material=steel,
                supports={"left": "x", "bottom": "y"}, kinematics=kinematics,
                loads=(rise,))  # fmt: skip
    return solve(Model(bodies=(bar,)))


@pytest.mark.parametrize("yield_stress", [np.inf, 400.0])
@pytest.mark.parametrize("kinematics", ["plane_stress", "axisymmetric"])
@pytest.mark.parametrize("heat", [{}, {"modulus_drop": 5e-4, "yield_drop": 5e-4}])
def test_free_expansion_passes(yield_stress, kinematics, heat):
    """Stress, forces and work are rounding of what they would be in a held bar."""
    check = expanding(yield_stress, kinematics, **heat).audit()
    assert check.passed, check.violations
    assert check.figures["audit_error_loaded"] < 1e-3


@pytest.mark.parametrize("stage", ["loaded", "unloaded"])
def test_a_little_stress_in_free_expansion_is_noticed(stage):
    """A hundred-thousandth of the stress of a held bar is no rounding."""
    solution = expanding(400.0, "plane_stress")
    (response,) = solution.loaded.responses
    little = np.zeros_like(response.stress)
    little[0] = 1e-5 * 2e5 * 1.2e-5 * 100.0
    spoiled = replace(getattr(solution, stage),
                      responses=(response._replace(stress=response.stress + little),))  # fmt: skip
    states = {"loaded": solution.loaded, "unloaded": solution.unloaded} | {stage: spoiled}
    check = audit(solution.system, states["loaded"], states["unloaded"], 0.0)
    assert any("audit_residual" in text for text in check.violations)
