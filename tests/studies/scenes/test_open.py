"""Open tables: a file has every parameter of materials and of friction without naming it."""

from __future__ import annotations

import dataclasses
import pickle
from typing import Any

import pytest

from solver import ModelError
from solver.materials import Chaboche
from solver.scenes.material_parameters import ContactParameters
from solver.scenes.punch import PunchParameters
from studies import Study, StudyError
from studies.definition.parameters import parameters_of
from studies.errors import SceneError
from studies.scenes.scene import FileScene
from tests.studies.scenes.conftest import blocks, built


def opened(**material: Any) -> dict[str, Any]:
    """Return the small scene, its material and its contact open."""
    tables = blocks()
    del tables["parameters"]["mu"], tables["parameters"]["rule"], tables["contacts"][0]["friction"]
    tables["materials"]["steel"] = {"open": True} | material
    tables["contacts"][0]["open"] = True
    return tables


@pytest.fixture
def scene() -> FileScene:
    return built(opened())


def test_its_parameters_are_those_of_the_punch_in_name_default_range_and_meaning(
    scene: FileScene,
) -> None:
    own, known = parameters_of(scene), dataclasses.fields(ContactParameters)
    assert list(own) == [*(field.name for field in known if field.name != "accuracy"), "wide"]
    hints = parameters_of(dataclasses.replace(scene, parameters=PunchParameters))
    for name in own.keys() & hints.keys():
        mine, its = ((p.default, p.unit, p.description, p.schema) for p in (own[name], hints[name]))
        assert mine == its


def test_its_laws_are_made_of_them(scene: FileScene) -> None:
    parameters = scene.parameters(
        hardening="chaboche", back_stresses=((5e4, 400.0),), friction=0.3, yield_stress=200.0
    )
    model = scene.model(pickle.loads(pickle.dumps(parameters)))
    law = model.bodies[0].material
    assert isinstance(law, Chaboche)
    assert law.yield_stress == 200.0 and len(law.back_stresses) == 1
    assert model.contacts[0].friction == dataclasses.replace(
        scene.model(scene.parameters()).contacts[0].friction, friction=0.3
    )


def test_what_does_not_go_together_is_refused_by_its_parameter(scene: FileScene) -> None:
    for name, given in {
        "curve": {"hardening": "table"},
        "hardening": {"hardening": "kinematic", "yield_condition": "tresca"},
        "friction": {"friction": -0.1},
        "hardening_ratio": {"hardening_ratio": 2.0},
    }.items():
        with pytest.raises(ModelError, match=f"^{name} = "):
            scene.parameters(**given)


def test_what_is_given_is_no_parameter_and_what_is_declared_is_as_declared() -> None:
    tables = opened(hardening="isotropic", youngs_modulus="2*$stiffness")
    tables["parameters"]["stiffness"] = {"default": 1e5, "unit": "MPa"}
    tables["parameters"]["yield_stress"] = {"default": 300.0, "range": [1, 999], "unit": "MPa"}
    scene = built(tables)
    names = parameters_of(scene).keys()
    assert "hardening_ratio" in names and not {"hardening", "youngs_modulus"} & names
    law = scene.model(scene.parameters(hardening_ratio=0.1)).bodies[0].material
    assert (law.yield_stress, law.elasticity.youngs_modulus) == (300.0, 2e5)
    with pytest.raises(ModelError, match="yield_stress = 1000"):
        scene.parameters(yield_stress=1000.0)


def test_a_sweep_of_what_changes_nothing_is_refused(scene: FileScene) -> None:
    with pytest.raises(StudyError, match=r"sweep\.saturation.*changes nothing"):
        Study.from_dict({"name": "idle", "sweep": {"saturation": [1.0, 2.0]}}, scene=scene)
    assert Study.from_dict({"name": "a", "sweep": {"friction": [0.1, 0.2]}}, scene=scene).size == 2


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda t: t["materials"]["steel"].update(open="$wide > 1"), "materials.steel.youngs"),
        (lambda t: t["outputs"].update(friction=t["outputs"]["least"]), "outputs.friction"),
    ],
)
def test_wrong_open_tables_are_told(change: Any, told: str) -> None:
    tables = opened()
    change(tables)
    with pytest.raises(SceneError) as caught:
        built(tables)
    assert any(each.field.startswith(told) for each in caught.value.mistakes), caught.value
