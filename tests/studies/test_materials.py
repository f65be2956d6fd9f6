"""Materials by name in studies, scene files and Python."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from solver.materials.library import SOURCE, library, named
from solver.scenes.material_parameters import MaterialParameters
from studies import Study, StudyError
from studies.definition.parameters import read_values
from studies.errors import SceneError
from studies.scenes.description import Description
from studies.scenes.registry import scene_named
from studies.scenes.scene import file_scene, read_scene

ROOT = Path(__file__).parents[2]
STEELS = """
[40Cr]
source = "own tests"
youngs_modulus = "205 GPa"
poisson_ratio = 0.3
yield_stress = 600.0
"""


def study(scene: str = "punch", **content: Any) -> Study:
    return Study.from_dict({"name": "steels", "scene": scene, **content})


def refused(**content: Any) -> str:
    with pytest.raises(StudyError) as caught:
        study(**content)
    return str(caught.value)


@pytest.mark.parametrize("name", library())
def test_a_material_has_a_source_and_is_a_law_that_yields_at_its_yield_stress(name: str) -> None:
    assert len(library()[name][SOURCE]) > 40
    law: Any = MaterialParameters(**named(name)).material()
    assert law.curve.flow_stress(np.zeros(1)) == pytest.approx(named(name)["yield_stress"])


@pytest.mark.parametrize(("name", "n"), [("Al-6061", 0.08), ("Al-7075", 0.122)])
def test_the_aluminium_curves_are_the_published_power_laws(name: str, n: float) -> None:
    law: Any = MaterialParameters(**named(name)).material()
    E, Y = named(name)["youngs_modulus"], named(name)["yield_stress"]
    p = np.geomspace(1e-4, 1.0, 200)
    published = Y * (1 + E * p / Y) ** n
    # a chord is at most n/8 ln(ratio)^2 below: 0.4 % if 1 + E p / Y grows by 1.67
    assert np.abs(law.curve.flow_stress(p) / published - 1).max() < 0.004


def test_a_name_has_the_runs_of_its_explicit_values() -> None:
    by_name, explicit = study(parameters={"material": "Al-6061"}), named("Al-6061")
    assert by_name.id == study(parameters=explicit).id
    assert [*by_name.run_ids()] == [*study(parameters=explicit).run_ids()]
    labels = {name: named(name) for name in ("Al-7075", "rail-steel")}
    assert study(sweep={"material": [*labels]}).id == study(sweep={"material": labels}).id
    points = study(points=[{"material": name} for name in labels])
    assert points.id == study(points=[*labels.values()]).id


def test_a_number_of_a_material_can_be_given_or_swept() -> None:
    given = study(parameters={"material": "rail-steel", "yield_stress": 480.0})
    assert (given.fixed["yield_stress"], given.fixed["youngs_modulus"]) == (480.0, 210e3)
    for varied in (
        {"sweep": {"poisson_ratio": [0.3, 0.33]}},
        {"sample": {"method": "sobol", "num": 2, "ranges": {"poisson_ratio": [0.3, 0.33]}}},
        {"points": [{"poisson_ratio [1]": 0.3}]},
    ):
        found = study(parameters={"material": "Al-6061"}, **varied)
        assert "poisson_ratio" not in found.parameters
        assert found.parameters["curve"] == named("Al-6061")["curve"]
        assert Study.from_dict(found.to_dict()).id == found.id


def test_bodies_that_do_not_yield_take_the_elastic_constants() -> None:
    found = study("elastic_punch", parameters={"material": "Al-6061"})
    assert found.parameters == {"youngs_modulus": 66.8e3, "poisson_ratio": 0.33}


def test_a_command_takes_a_name() -> None:
    assert read_values(scene_named("punch"), {"material": "Al-6061"})["yield_stress"] == 284.0


def test_an_unknown_material_is_refused_with_those_that_exist() -> None:
    told = refused(parameters={"material": "Al-6016"})
    assert "parameters.material = 'Al-6016': must be one of rail-steel, Al-6061" in told
    assert "FILE.toml#NAME, a table" in told  # the latter over HTTP, which sends no files
    assert "sweep.material" in (text := refused(sweep={"material": ["Al-7075", "Al7075"]}))
    assert "did you mean Al-7075?" in text
    assert "occurs already" in refused(sweep={"material": ["Al-7075", "Al-7075"]})
    assert "points[0].material" in refused(points=[{"material": 7}])
    assert "has hardness, and the scene" in refused(parameters={"material": {"hardness": 1.0}})


def test_materials_of_a_file_beside_the_study(tmp_path: Path) -> None:
    (tmp_path / "steels.toml").write_text(STEELS)
    path = tmp_path / "study.toml"
    begin = 'name = "steels"\nscene = "punch"\n'
    path.write_text(f'{begin}[sweep]\nmaterial = ["steels.toml#40Cr", "Al-6061"]\n')
    found = Study.from_toml(path)
    assert found.axes == {"material": ["40Cr", "Al-6061"]}
    assert found.sweep["material"]["40Cr"]["youngs_modulus"] == 205e3
    path.write_text(f'{begin}[parameters]\nmaterial = "steels.toml#41Cr"\n')
    with pytest.raises(StudyError, match=r"parameters.material = .*must be one of 40Cr"):
        Study.from_toml(path)
    assert "which only a study or scene file can" in refused(
        parameters={"material": "steels.toml#40Cr"}
    )


def test_a_scene_file_names_a_material(tmp_path: Path) -> None:
    content = tomllib.loads((ROOT / "data/scenes/bending.toml").read_text())
    (name,) = content["materials"]

    def scene(**table: Any) -> Description:
        return Description("bending.toml", {**content, "materials": {name: table}}, {})

    constants = {"youngs_modulus": 210e3, "poisson_ratio": 0.3, "yield_stress": 400.0}
    own = {"named": {"name": "own", "source": "tests", **constants}, "hardening": "none"}
    assert scene(**own).digest == scene(**constants, hardening="none").digest
    assert scene(named="Al-6061").digest == scene(**named("Al-6061")).digest
    with pytest.raises(SceneError) as caught:
        file_scene(scene(named="Al-60"), built=True)
    wrong = [each for each in caught.value.mistakes if each.field.startswith("materials")]
    assert [(each.field, each.value) for each in wrong] == [(f"materials.{name}.named", "Al-60")]
    assert "must be one of rail-steel, Al-6061" in wrong[0].allowed

    (tmp_path / "steels.toml").write_text(STEELS)
    text = (ROOT / "data/scenes/peened.toml").read_text()
    (tmp_path / "peened.csv").write_bytes((ROOT / "data/scenes/peened.csv").read_bytes())
    constants_there = "youngs_modulus = 2e5\npoisson_ratio = 0.3\n"
    named_one = text.replace(constants_there, 'named = "steels.toml#40Cr"\n', 1)
    assert named_one != text
    (tmp_path / "peened.toml").write_text(named_one)
    table = read_scene(tmp_path / "peened.toml").description.content["materials"]["steel"]
    assert table == {"youngs_modulus": 205e3, "poisson_ratio": 0.3, "yield_stress": 600.0}
