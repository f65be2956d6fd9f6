"""The laws that the parameters of a scene stand for, and the punch with each of them."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from solver import SCENES, ModelError, Status
from solver.materials import (
    ArmstrongFrederick,
    Chaboche,
    Layered,
    PlaneStress,
    Power,
    Table,
    TrescaMaterial,
    Voce,
)
from solver.materials.hardening_rules import HARDENING
from solver.scenes.punch import PunchParameters
from tests.architecture.sources import ROOT

CURVE = ((0.0, 350.0), (0.002, 420.0), (0.02, 480.0))
BACK = ((60_000.0, 600.0), (4000.0, 20.0))
LAWS: dict[str, dict[str, Any]] = {
    "voce": {"hardening": "voce", "saturation": 100.0, "saturation_rate": 50.0},
    "power": {"hardening": "power", "hardening_exponent": 0.2, "youngs_modulus": 70e3},
    "table": {"hardening": "table", "curve": CURVE},
    "chaboche": {"hardening": "chaboche", "back_stresses": BACK},
    "layered": {"hardening": "layered", "curve": CURVE},
    "tresca": {"yield_condition": "tresca"},
    "tresca, isotropic": {"yield_condition": "tresca", "hardening": "isotropic"},
    "tresca, table": {"yield_condition": "tresca", "hardening": "table", "curve": CURVE},
}
ROUGH: dict[str, Any] = {
    "smallest_element": 0.02, "growth": 1.8, "load_step": 0.1, "half_plane_size": 8.0,
    "friction": 0.4, "load_ratio": 0.6, "state": "plane_strain",
}  # fmt: skip


def test_each_word_stands_for_its_law() -> None:
    laws = {name: PunchParameters(**own).material() for name, own in LAWS.items()}
    kinds = {name: type(law) for name, law in laws.items()}
    assert kinds == {
        "voce": Chaboche, "power": Chaboche, "table": Chaboche, "chaboche": Chaboche,
        "layered": Layered,
        "tresca": TrescaMaterial, "tresca, isotropic": TrescaMaterial,
        "tresca, table": TrescaMaterial,
    }  # fmt: skip
    voce, table, chaboche = (laws[name] for name in ("voce", "table", "chaboche"))
    assert isinstance(voce, Chaboche) and isinstance(table, Chaboche)
    assert isinstance(chaboche, Chaboche)
    assert voce.curve == Voce(yield_stress=350.0, saturation=100.0, rate=50.0)
    assert table.curve == Table(plastic_strain=(0.0, 0.002, 0.02), stress=(350.0, 420.0, 480.0))
    assert chaboche.back_stresses == tuple(ArmstrongFrederick(*each) for each in BACK)
    assert not (voce.back_stresses or table.back_stresses)
    power = laws["power"]
    assert isinstance(power, Chaboche)
    assert power.curve == Power(yield_stress=350.0, youngs_modulus=70e3, exponent=0.2)
    assert power.curve.flow_stress(np.array([0.0, 0.005])) == pytest.approx([350.0, 350 * 2**0.2])
    hard = laws["tresca, isotropic"]
    assert isinstance(hard, TrescaMaterial)
    linear = PunchParameters(hardening="isotropic").material()
    assert linear.linear_hardening is not None
    modulus = linear.linear_hardening.isotropic_modulus
    assert hard.curve == Voce(yield_stress=350.0, modulus=modulus) and modulus > 0
    assert PunchParameters(**LAWS["layered"]).material(elastic=True).elastic


def test_the_page_of_materials_lists_each_word_with_its_parameters() -> None:
    laws, _, _ = (ROOT / "docs/reference/materials.md").read_text().partition("## By name")
    _, *rows = [
        [re.findall(r"`(\w+)`", cell) for cell in line.split("|")]
        for line in laws.splitlines()
        if line.startswith("| `")
    ]
    assert {row[1][0]: frozenset(row[3]) for row in rows} == {
        word: HARDENING.used(word) for word in HARDENING
    }


def test_a_curve_that_another_rule_of_the_sweep_needs_is_no_mistake() -> None:
    assert PunchParameters(curve=CURVE, back_stresses=BACK).material().linear_hardening is not None


@pytest.mark.parametrize(
    ("wrong", "field", "words"),
    [
        ({"hardening": "table"}, "curve", "first \\[0, yield_stress\\]"),
        ({"hardening": "layered", "curve": ((0.0, 300.0),)}, "curve", "yield_stress"),
        ({"hardening": "layered", "curve": ((0.0, 350.0), (0.01, 340.0))}, "curve", "not falling"),
        ({"hardening": "layered", "curve": ((0.0, 350.0), (0.01, 400.0), (0.02, 600.0))},
         "curve", "slope falls"),
        ({"hardening": "table", "curve": ((0.0, 350.0), (0.0, 400.0))}, "curve", "increasing"),
        ({"hardening": "table", "curve": ((0.0, 350.0), (0.1, float("nan")))}, "curve[1][1]",
         "a finite"),
        ({"hardening": "chaboche"}, "back_stresses", "must be given"),
        ({"hardening": "chaboche", "back_stresses": ((1.0, -1.0),)}, "back_stresses.1.recall",
         "at least 0"),
        ({"hardening": "voce"}, "saturation", "must be given"),
        ({"hardening": "table", "curve": ((0.0, 350.0, 1.0),)}, "curve[0]", "a number, a number"),
        ({"hardening": "table", "curve": ((0.0, 350.0), (float("inf"), 400.0))}, "curve[1][0]",
         "a finite number"),
        ({"hardening": "chaboche", "back_stresses": (6e4, 600.0)}, "back_stresses[0]", "a tuple"),
        ({"hardening": "chaboche", "back_stresses": (("a", "b"),)}, "back_stresses[0][0]",
         "a number"),
        ({"yield_condition": "tresca", "hardening": "kinematic"}, "hardening",
         "none, isotropic, voce, power, table"),
    ],
)  # fmt: skip
def test_what_does_not_go_together_is_refused(
    wrong: dict[str, Any], field: str, words: str
) -> None:
    with pytest.raises(ModelError, match=words) as refusal:
        PunchParameters(**wrong)
    assert refusal.value.field == field


@pytest.mark.solves
@pytest.mark.parametrize("name", LAWS)
def test_the_punch_is_pressed_and_released_with_each_law(name: str) -> None:
    scene = SCENES["punch"]
    (record,) = scene.path(scene.parameters(**ROUGH, **LAWS[name]), [0.6], lambda fraction: None)
    assert record.status is Status.OK, record.message
    assert record.scalars["max_plastic_strain_half_plane"] > 1e-4
    assert record.scalars["audit_law"] < 1e-8


@pytest.mark.solves
def test_without_friction_tresca_lets_the_half_plane_yield_in_plane_stress_alone() -> None:
    # published: none with von Mises; with Tresca a little in plane stress, none in plane strain
    scene = SCENES["punch"]
    own = ROUGH | {"friction": 0.0}
    strains = {}
    for condition, state in (("mises", "plane_stress"), ("tresca", "plane_stress"),
                             ("tresca", "plane_strain")):  # fmt: skip
        parameters = scene.parameters(**(own | {"yield_condition": condition, "state": state}))
        (record,) = scene.path(replace(parameters, load_ratio=0.6), [0.6], lambda fraction: None)
        assert record.status is Status.OK, record.message
        strains[condition, state] = record.scalars["max_plastic_strain_half_plane"]
        assert record.scalars["max_plastic_strain_punch"] > 1e-4
    assert strains["mises", "plane_stress"] == 0.0
    assert strains["tresca", "plane_strain"] == 0.0
    assert strains["tresca", "plane_stress"] > 0.0


@pytest.mark.solves
def test_no_tangent_in_a_corner_of_the_yield_surface_is_no_limit_load() -> None:
    # a punch without hardening bears this load; in long increments whole elements stand in corners
    scene = SCENES["punch"]
    own = ROUGH | {"friction": 0.0, "load_step": 0.2, "state": "plane_stress"}
    parameters = scene.parameters(**own, yield_condition="tresca")
    (record,) = scene.path(parameters, [0.6], lambda fraction: None)
    assert record.status is Status.OK, record.message
    assert PlaneStress(parameters.material()).surface.has_corners
    assert not PlaneStress(PunchParameters().material()).surface.has_corners
