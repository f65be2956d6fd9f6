"""Runs outside small-strain theory: the message has body, place and value, unless singular."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from solver import (
    SCENES,
    Amplitude,
    Audit,
    Body,
    Displacement,
    Material,
    Model,
    ModelError,
    Record,
    SingularPoint,
    Stage,
    Status,
    Traction,
    solve,
)
from solver.audit.theory import LARGE, largest_strain
from solver.mesh import grid
from solver.scenes import Scene

pytestmark = pytest.mark.solves

SOFT = Material(youngs_modulus=2e5, poisson_ratio=0.3, yield_stress=200.0,
                hardening="isotropic", hardening_ratio=0.01)  # fmt: skip

FLOW = 4e-5
"""Largest change of the estimates below by the least stiffness of flow."""


def stretched(strain: float, material: Material, amplitude: Amplitude | None = None) -> Body:
    """A bar from x = 1 to 5, drawn out evenly."""
    return Body(
        name="bar",
        mesh=grid(np.linspace(1.0, 5.0, 5), np.linspace(0.0, 1.0, 3)),
        material=material,
        kinematics="plane_stress",
        supports={"left": "x", "bottom": "y"},
        loads=(Displacement(boundary="right", x=4.0 * strain, amplitude=amplitude),),
    )


def lacks(strain: float) -> float:
    """Return the share that a bar drawn by ``strain`` lacks: its area, and the hardening.

    By hand: the stress T rises by 1 % of Young's modulus times the strain beyond the yield strain
    0.001. The force shrinks by the strain, and T by its slope times strain less logarithmic strain.
    The least stiffness of flow in the estimate makes this slope 0.1 % larger, and the share `FLOW`.
    """
    slope = 0.01 * SOFT.youngs_modulus
    T = SOFT.yield_stress + slope * (strain - 0.001)
    return strain + slope * (strain - math.log1p(strain)) / T


def pulled(strain: float, singular: tuple[SingularPoint, ...] = ()) -> Audit:
    """The bar, drawn out and pushed back: half of its plastic strain each."""
    bar = stretched(strain / 2, SOFT)
    return solve(Model(bodies=(bar,), singular=singular)).audit()


def test_plastic_strain_beyond_a_tenth_is_outside_with_body_place_and_value() -> None:
    """By hand: the yield strain is 0.001, plastic modulus over Young's modulus h = 0.01 / 0.99."""
    audit = pulled(0.24)
    plastic, balance = audit.outside
    assert plastic.startswith("equivalent plastic strain reaches 12% in bar at (")
    assert "small-strain theory does not hold there" in plastic
    assert "would change the stress of bar by 15%" in balance
    h = 0.01 / 0.99
    out = (0.12 - 0.001) / (1 + h)
    back = (0.12 - 0.002 - 2 * h * out) / (1 + h)
    assert audit.figures["audit_plastic_strain"] == pytest.approx(out + back, rel=1e-6)
    assert audit.figures["audit_large_strain"] == pytest.approx(lacks(0.12), abs=FLOW)
    assert audit.passed, "the equations are solved as they should be"


def test_strain_below_a_twentieth_is_within_theory() -> None:
    audit = pulled(0.08)
    assert audit.outside == ()
    assert lacks(0.04) < LARGE
    assert audit.figures["audit_large_strain"] == pytest.approx(lacks(0.04), abs=FLOW)


def test_cycles_of_small_strain_are_within_theory_however_long() -> None:
    """Strain of 0.8 % either way: a reversal adds 1.4 % to the accumulated strain alone."""
    ends = np.array([0.0, *[1.0, -1.0] * 5])
    swing = Amplitude(time=np.arange(len(ends)), value=ends)
    bar = stretched(0.008, material=SOFT, amplitude=swing)
    stages = tuple(Stage(name=f"s{k}", target=float(k), steps=1) for k in range(1, len(ends)))
    audit = solve(Model(bodies=(bar,)), stages=stages).audit(f"s{len(stages)}")
    assert audit.figures["audit_plastic_strain"] > 0.1
    assert audit.outside == ()
    assert audit.figures["audit_large_strain"] == pytest.approx(lacks(0.008), rel=1e-3)


def test_a_bar_that_is_loaded_again_to_where_it_flowed_lacks_what_it_did() -> None:
    """It flows again by rounding alone."""
    eased = Amplitude(time=np.arange(4.0), value=np.array([0.0, 1.0, 0.0, 1.0]))
    T = SOFT.yield_stress + 0.01 * SOFT.youngs_modulus * 0.049
    pull = Traction(boundary="right", x=T, amplitude=eased)
    bar = replace(stretched(0.0, SOFT), loads=(pull,))
    stages = tuple(Stage(name=f"s{k}", target=float(k), steps=4) for k in range(1, 4))
    audit = solve(Model(bodies=(bar,)), stages=stages).audit("s3")
    assert audit.figures["audit_large_strain"] == pytest.approx(0.05, rel=0.05)


def test_large_strain_at_a_singular_point_does_not_count() -> None:
    everywhere = SingularPoint(at=(3.0, 0.5), radius=3.0)
    assert pulled(0.24, (everywhere,)).outside == ()
    beside = SingularPoint(at=(1.0, 0.0), radius=1.5)
    assert len(pulled(0.24, (beside,)).outside) == 2


def test_the_largest_strain_is_that_of_all_bodies_away_from_singular_points() -> None:
    X = np.array([[0.0, 1.0, 2.0], [0.0, 0.0, -1.0]])
    bodies = [("a", X, np.array([9.0, 0.1, 0.2])), ("b", X, np.array([8.0, 0.3, 0.1]))]
    found = largest_strain(bodies, [SingularPoint(at=(0.0, 0.0), radius=0.5)])
    assert found == (0.3, "b", 1.0, 0.0)
    assert largest_strain(bodies)[:2] == (9.0, "a")


@pytest.mark.parametrize(
    ("field", "wrong"), [("at", (math.nan, 0.0)), ("radius", 0.0), ("radius", math.inf)]
)
def test_a_singular_point_has_a_place_and_a_radius(field: str, wrong: object) -> None:
    given = {"at": (0.0, 0.0), "radius": 1.0}
    entry = r"\[0\]" if field == "at" else ""
    with pytest.raises(ModelError, match=f"^{field}{entry} = "):
        SingularPoint(**{**given, field: wrong})


def punch(**fields: object) -> Record:
    parameters = SCENES["punch"].parameters(
        accuracy="draft", load_ratio=0.8571, friction=0.4, **fields
    )
    (record,) = SCENES["punch"].path(parameters, [0.8571], lambda share: None)
    return record


def test_a_run_outside_theory_has_a_status_of_its_own_and_keeps_its_numbers() -> None:
    """Without hardening the half-plane flows some elements away from the corner too."""
    record = punch(hardening="none")
    assert record.status is Status.OUTSIDE_THEORY
    assert "equivalent plastic strain reaches 1" in record.message
    assert "in half_plane at (" in record.message
    assert np.isfinite(record.fields["residual_stress"][1]).any()
    assert record.scalars["audit_large_strain"] > LARGE


def test_a_limit_load_is_told_by_the_parameter_of_the_scene() -> None:
    parameters = SCENES["punch"].parameters(
        smallest_element=0.05, growth=2.5, load_ratio=1.5, load_step=0.5
    )
    (record,) = SCENES["punch"].path(parameters, [1.5], lambda share: None)
    assert record.status is Status.LIMIT_LOAD
    assert "no equilibrium between load_ratio 0.9" in record.message


def test_what_breaks_the_audit_is_no_question_of_theory() -> None:
    record = punch(hardening="isotropic")
    assert record.status is Status.OK
    scene = SCENES["punch"]
    both = Audit({}, violations=("wrong",), outside=("large",))
    assert judged(scene, both) is Status.AUDIT_FAILED
    assert judged(scene, replace(both, violations=())) is Status.OUTSIDE_THEORY


def judged(scene: Scene, audit: Audit) -> Status:
    """Return the status of a run with this audit, which needs no outputs."""
    coarse = scene.parameters(smallest_element=0.05, growth=3.0, load_step=1.0, load_ratio=0.01)
    plain = replace(scene, outputs=(), method=lambda run: one)

    def one(scene: Scene, runs: object, monitor: object) -> object:
        from solver.scenes.driver import by_increments

        return (replace(look, check=lambda: audit) for look in by_increments(scene, runs, monitor))

    (record,) = plain.path(coarse, [0.01], lambda share: None)
    return record.status


def test_a_run_tells_its_singular_points() -> None:
    """Draft elements of 0.005 a: those at the corner reach farther than its published number."""
    record = punch(hardening="isotropic")
    told = {name: record.fields[name][1] for name in record.fields if name.startswith("singular_")}
    expected = {"x": 50.0, "y": 0.0, "s": 50.0, "radius": 1.5 * 0.005 * 50.0}
    assert {name.removeprefix("singular_"): float(each[0]) for name, each in told.items()} == (
        pytest.approx(expected)
    )
