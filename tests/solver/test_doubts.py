"""What is allowed but hardly meant is told: numbers in another unit, pairs that never touch."""

from __future__ import annotations

import logging
import math
from dataclasses import replace

import numpy as np
import pytest

from solver import Body, ContactPair, Displacement, Material, Model, Record, solve
from solver.materials.doubts import doubts
from solver.mesh import grid
from solver.shipped import SCENES

pytestmark = pytest.mark.solves

STEEL = Material(youngs_modulus=1.95e5, poisson_ratio=0.3, yield_stress=350.0)
IN_GPA = (
    "lower.youngs_modulus = 195: 195000 MPa was probably meant, 195 GPa; no metal has a yield "
    "strain of 1.79 (yield_stress = 350 MPa, youngs_modulus = 195 MPa)"
)


def blocks(material: Material, gap: float = 0.0) -> Model:
    """A block that is moved down by 0.01 mm on another one, from a gap."""
    x = np.linspace(0.0, 4.0, 5)
    upper = Body(name="upper", mesh=grid(x, np.linspace(0.0, 2.0, 3)), material=material,
                 loads=(Displacement(boundary="top", x=0.0, y=-0.01),))  # fmt: skip
    lower = Body(name="lower", mesh=grid(x, np.linspace(-2.0, 0.0, 3)), material=material,
                 supports={"bottom": "xy"})  # fmt: skip
    pair = ContactPair(slave=("upper", "bottom"), master=("lower", "top"), friction=0.2, gap=gap)
    return Model(bodies=(upper, lower), contacts=(pair,))


@pytest.mark.parametrize(
    ("stiffness", "strength", "told"),
    [
        (195.0, 350.0, "lower.youngs_modulus = 195: 195000 MPa was probably meant, 195 GPa"),
        (2e5, 3.5e8, "lower.yield_stress = 3.5e+08: 350 MPa was probably meant, 3.5e+08 Pa"),
        (2e5, 3.5e5, "lower.yield_stress = 350000: 350 MPa was probably meant, 350000 kPa"),
        (3.0, 350.0, "lower.youngs_modulus = 3: must be in MPa, like the yield stress"),
    ],
)
def test_the_number_in_another_unit_is_named_with_what_was_meant(
    stiffness: float, strength: float, told: str
) -> None:
    material = replace(STEEL, youngs_modulus=stiffness, yield_stress=strength)
    (text,) = doubts({"lower": material})
    assert text.startswith(f"{told}; no metal has a yield strain of {strength / stiffness:.3g}")


@pytest.mark.parametrize(
    ("stiffness", "strength"),
    [(2e5, 350.0), (2.1e5, 4200.0), (3e3, 100.0), (7e4, 500.0), (195.0, math.inf)],
    ids=["steel", "piano wire", "acrylic", "aluminium", "elastic"],
)
def test_materials_that_there_are_raise_no_doubt(stiffness: float, strength: float) -> None:
    material = replace(STEEL, youngs_modulus=stiffness, yield_stress=strength)
    assert doubts({"lower": material}) == ()


def test_a_model_of_ones_own_is_doubted_before_and_after(
    caplog: pytest.LogCaptureFixture,
) -> None:
    soft = replace(STEEL, youngs_modulus=195.0)
    with caplog.at_level(logging.WARNING, "solver"):
        solution = solve(blocks(soft))
    assert IN_GPA in caplog.messages
    assert IN_GPA in solution.audit().warnings
    caplog.clear()
    assert solve(blocks(STEEL)).audit().warnings == ()
    assert not caplog.messages


def run(name: str, **given: object) -> Record:
    """Return the record of one run of a scene of the package."""
    scene = SCENES[name]
    parameters = scene.parameters(**given)
    values = [getattr(parameters, scene.branch)]
    (record,) = scene.path(parameters, values, lambda share: None)
    return record


@pytest.mark.parametrize(
    ("name", "given"),
    [
        ("punch", {"smallest_element": 0.1, "growth": 2.0, "load_ratio": 0.3}),
        ("rolling", {"element_size": 100.0, "growth": 1.5, "load": "hertz", "load_ratio": 1.0}),
    ],
)
def test_a_run_of_a_scene_tells_it_in_its_message(name: str, given: dict[str, object]) -> None:
    doubted = run(name, youngs_modulus=195.0, **given)
    first = doubted.message.partition(";")[0]
    assert "youngs_modulus = 195: 195000 MPa was probably meant" in first


@pytest.mark.parametrize("gap", [0.02, 1.0])
def test_a_pair_that_never_touches_is_told_and_passes_its_audit(gap: float) -> None:
    solution = solve(blocks(STEEL, gap))
    audit = solution.audit()
    assert audit.passed, audit.violations
    assert audit.warnings == (
        "upper.bottom and lower.top do not touch at the end of any stage: move them together, or "
        "remove the pair",
    )
    # moved as a whole: no stress but that of rounding, of the modulus times strain of the machine
    assert np.abs(solution.stress("upper", "loaded")).max() < 1e-10 * STEEL.youngs_modulus
    assert solution.displacement("upper", "loaded")[1] == pytest.approx(-0.01)


def test_a_pair_that_touches_under_load_alone_is_not_told() -> None:
    solution = solve(blocks(STEEL, 0.005))
    assert solution.contact(0, "loaded").pressure.max() > 0.0
    assert solution.contact(0, "unloaded").pressure.max() == 0.0
    assert solution.audit().warnings == ()
