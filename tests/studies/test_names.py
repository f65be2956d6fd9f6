"""Names of axes: each is computed, stored, opened, drawn and exported, or refused before a run."""

from __future__ import annotations

import random
import tomllib
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from residua.cli import main
from solver.results.quantities import IN_SPACE, QUANTITIES
from solver.scenes import Scene
from solver.shipped import SCENES
from studies import Study, StudyError, open_study
from studies.definition.parameters import parameters_of
from studies.errors import SceneError
from studies.scenes.description import Description
from studies.scenes.names import RESERVED, in_use
from studies.scenes.scene import FileScene, file_scene
from tests.studies.fakes import Canned
from tests.studies.test_sensitivity import ishigami

SCENE = """
name = "bar"
kinematics = "plane_stress"

[parameters]
NUMBER = { default = 200.0, range = [50.0, 900.0], unit = "MPa", description = "yield stress" }
WORD = { default = "none", choices = ["none", "isotropic", "kinematic"], description = "rule" }
INTEGER = { default = 1, range = [1, 4], description = "elements across" }

[materials.steel]
youngs_modulus = 2e5
poisson_ratio = 0.3
yield_stress = "$NUMBER"
hardening = "$WORD"
hardening_ratio = 0.05

[bodies.bar]
material = "steel"
supports = { left = "x", bottom = "y" }

[bodies.bar.shape]
kind = "grid"
x = [{ at = 0 }, { at = 10, parts = 1 }]
y = [{ at = 0 }, { at = 2, parts = "$INTEGER" }]

[[loads]]
body = "bar"
kind = "displacement"
boundary = "right"
x = 0.1

[[stages]]
name = "pulled"
increments = 2

[[stages]]
name = "off"
increments = 1
release = true

[results]
outputs = ["maps", "profiles"]
map = { x = [1.0, 9.0], y = [0.5, 1.5] }
profile = { body = "bar", depth = [0.5, 1.5], stations = [5.0] }

[outputs.pull]
of = "stress.xx"
take = "maximum"
body = "bar"
stage = "pulled"
"""

TWO = "[sweep.AXIS]\na = { NUMBER = 150.0, WORD = 'none' }\nb = { NUMBER = 250.0 }\n"
NUMBERS = "[sweep]\nNUMBER = [150.0, 250.0]\n"
KINDS = {
    "numbers and words": f"{NUMBERS}WORD = ['none', 'isotropic']\n",
    "words": "[sweep]\nWORD = ['none', 'isotropic']\n",
    "integers": "[sweep]\nINTEGER = [1, 2]\n",
    "labels": TWO,
    "points": "points = [{ NUMBER = 150.0, INTEGER = 1 }, { NUMBER = 250.0, INTEGER = 2 }]\n",
    "sample": "[sample]\nmethod = 'sobol'\nnum = 2\n[sample.ranges]\nNUMBER = [150.0, 250.0]\n",
    "goal": "[sweep]\nWORD = ['isotropic']\n[goal]\nparameter = 'NUMBER'\nof = 'pull'\nat = 300.0\n"
    "between = [100.0, 400.0]\nwithin = 0.3\n",
    "refinement": f"{NUMBERS}[refine]\nof = ['pull']\nhalvings = 1\n",
    "fit": "[fit.ranges]\nNUMBER = [100.0, 400.0]\n[[fit.measured]]\nof = 'pull'\n"
    "values = [250.0]\nsigma = 5.0\n",
}
FREE = [
    "hardening", "friction", "load_ratio", "z_axis", "state", "stages", "sets", "index", "value",
    "variables", "coordinates", "dataset", "field", "select", "error", "sigma", "low", "high",
    "path", "study", "units", "dims", "runs_over", "number", "over", "pass_number", "E",
]  # fmt: skip
"""Names that no data set has, some of which have a meaning elsewhere."""


@pytest.mark.solves
@pytest.mark.divides
@pytest.mark.parametrize(
    ("kind", "keep"), [*zip(KINDS, ["", "fields"] * len(KINDS), strict=False), ("words", "")]
)
def test_axes_of_any_name_go_all_the_way(
    kind: str, keep: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    draw = random.Random(kind + keep)
    names = dict(zip(["NUMBER", "WORD", "INTEGER", "AXIS"], draw.sample(FREE, 4), strict=True))
    if kind == "labels":  # the topology of the fields that are kept
        names["AXIS"] = "mesh"
    if kind == "words":  # of three names that are dimensions of every data set, it alone
        names["WORD"] = "hardening"
    monkeypatch.chdir(tmp_path)

    def named(text: str) -> str:
        for role, name in names.items():
            text = text.replace(role, name)
        return text

    Path("scene.toml").write_text(named(SCENE))
    head = f'name = "s"\nscene = "scene.toml"\nkeep = "{keep}"\n'
    Path("study.toml").write_text(head + named(KINDS[kind]))
    assert main(["run", "study.toml", "--out", "o", "--workers", "0"]) == 0, names
    searched = kind in {"goal", "fit"}
    with open_study("o") as dataset:
        assert (dataset["status"] == "ok").all()
        swept = {"labels": "AXIS", "words": "WORD", "integers": "INTEGER"}.get(kind, "NUMBER")
        assert names[swept] in dataset.variables
        assert searched or 150.0 * 0.9 < dataset["pull"].min() < 300.0
    for asked in (["table", "--out", "t.csv"], *([["report", "--out", "r.html"]] if keep else [])):
        assert main([asked[0], "o", *asked[1:]]) == 0, names
    if not searched:
        for drawn in ("residual_stress", "pull"):
            assert main(["plot", "o", "--field", drawn, "--out", f"{drawn}.png"]) == 0, names
            assert Path(f"{drawn}.png").stat().st_size > 10_000
        assert main(["best", "o", "--of", "pull"]) == 0, names
        assert main(["export", "o", "--vtu", "v"]) == (0 if keep else 2), names


def bar(number: str = "number", integer: str = "integer") -> FileScene:
    text = SCENE.replace("NUMBER", number).replace("WORD", "word").replace("INTEGER", integer)
    return file_scene(Description("bar.toml", tomllib.loads(text), {}))


@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)
def test_no_parameter_of_a_scene_of_the_package_has_a_name_of_data_sets(scene: Scene) -> None:
    names = parameters_of(scene)
    assert not [name for name in names if in_use(name, names)]


def test_names_that_a_data_set_has_are_refused_before_a_run() -> None:
    made = ["pull_low", "pull_error", "integer_sigma", "x_fraction", "mesh_face", "cell_state",
            "run_low", "tried_x"]  # fmt: skip
    for name in [*RESERVED, *QUANTITIES, *IN_SPACE, *made]:
        with pytest.raises(SceneError, match=rf"parameters.{name} = .*: a data set has"):
            bar(name)


@pytest.mark.parametrize("axis", ["cell", "run", "mesh_face", "number_low", "time", "pull"])
def test_labels_of_such_a_name_are_refused(axis: str) -> None:
    sweep = {axis: {"a": {"number": 150.0}, "b": {"number": 250.0}}}
    with pytest.raises(StudyError, match="the data set has a variable of this name"):
        Study.from_dict({"name": "s", "sweep": sweep}, scene=bar())


@dataclass(frozen=True, slots=True, kw_only=True)
class Cells:
    """A parameter whose name a refinement has."""

    cell: float = field(default=1.0, metadata={"description": "size"})


def test_a_scene_of_python_with_such_a_parameter_is_refused() -> None:
    scene = Canned(name="cells", summary="cells", parameters=Cells, branch="", records=ishigami)
    with pytest.raises(StudyError, match="has a parameter cell: data sets have something else"):
        Study.from_dict({"name": "s", "sweep": {"cell": [1.0, 2.0]}}, scene=scene)
