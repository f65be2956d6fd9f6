"""Loads and elements of one's own in scene files, by the words that examples give them."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.architecture.sources import ROOT
from tests.programs import Programs

pytestmark = pytest.mark.processes

SHAFT = """
name = "shaft"
kinematics = "axisymmetric"

[materials.steel]
youngs_modulus = 2e5
poisson_ratio = 0.3

[bodies.shaft]
material = "steel"
shape = { kind = "rectangle", x = [0, 100], y = [0, 5], size = 2.5 }
element = "ELEMENT"
supports = { bottom = "y", top = "y" }

[[loads]]
body = "shaft"
kind = "hydrostatic"
boundary = "right"
weight = WEIGHT
level = 1e5

[[stages]]
name = "sunk"
increments = 1

[outputs.largest]
of = "stress.xx"
body = "shaft"
stage = "sunk"
"""
BEAM = """
name = "shaft"
kinematics = "plane_stress"

[materials.steel]
youngs_modulus = 2e5
poisson_ratio = 0.3

[bodies.beam]
material = "steel"
shape = { kind = "rectangle", x = [0, 100], y = [0, 5], size = 1.25 }
supports = { left = "xy" }

[[loads]]
body = "beam"
kind = "trolley"
boundary = "top"
force = 1.5
width = 2.0
position = { near = 40.0, sunk = 80.0 }
amplitude = { near = 1.0 }

[[loads]]
body = "beam"
kind = "travelling_pressure"
boundary = "top"
half_width = 4.0
peak = 0.0796
position = { near = 40.0, sunk = [[0.5, 50.0], [1.0, 80.0]] }

[[stages]]
name = "near"
increments = 1

[[stages]]
name = "sunk"
increments = 2

[outputs.largest]
of = "stress.xx"
body = "beam"
stage = "sunk"
x = [19.9, 20.1]
"""
RUN = """
import json, sys, tempfile
from pathlib import Path
import meshio
from solver.results.mesh_fields import write_vtu
from studies.errors import SceneError
from studies.scenes.description import Description
from studies.scenes.scene import file_scene
try:
    scene = file_scene(Description.read(Path("shaft.toml")), built=True)
except SceneError as error:
    print(json.dumps({"error": str(error)}))
    sys.exit()
record = list(scene.path(scene.parameters(), [0.0], lambda done: None))[-1]
with tempfile.TemporaryDirectory() as folder:
    write_vtu(record.mesh(), Path(folder))
    cells = meshio.read(next(Path(folder).glob("*-sunk.vtu"))).cells[0].type
print(json.dumps({"status": record.status.name, "message": record.message, "cells": cells,
                  "largest": record.scalars["largest"]}))
"""


Told = Callable[..., dict[str, object]]


@pytest.fixture
def told(tmp_path: Path, programs: Programs) -> Told:
    """Run a scene file with some of the examples, and return what is told of it."""
    (tmp_path / "program.py").write_text(RUN)

    def run(text: str, *examples: str) -> dict[str, object]:
        (tmp_path / "shaft.toml").write_text(text)
        own = os.pathsep.join(str(ROOT / "examples" / name) for name in examples)
        setting = os.environ | {"RESIDUA_PARTS": own, "PYTHONPATH": str(ROOT)}
        done = programs.run(Path("program.py"), tmp_path, setting, strict=True)
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    return run


@pytest.mark.parametrize("element", ["quad8", "quad8_mean"])
def test_a_load_and_an_element_of_ones_own_are_named_in_a_scene_file(
    element: str, told: Told
) -> None:
    text = SHAFT.replace("ELEMENT", element).replace("WEIGHT", "1e-3")
    found = told(text, "own_load.py", "own_element.py")
    assert found["status"] == "OK", found["message"]
    assert found["cells"] == "quad8"
    assert found["largest"] == pytest.approx(-100.0, rel=1e-3)


def test_loads_that_move_are_named_in_a_scene_file(told: Told) -> None:
    """The largest stress at x = 20 is that of the moment of both loads, at x = 80 at the end."""
    found = told(BEAM, "own_moving_load.py")
    assert found["status"] == "OK", found["message"]
    assert found["largest"] == pytest.approx(6 * 2.0 * 60.0 / 5.0**2, rel=2e-3)


@pytest.mark.parametrize(
    ("weight", "element", "examples", "words"),
    [
        ("-1.0", "quad8", ["own_load.py"], "loads[0].weight = -1.0: must be at least 0"),
        ("1.0\nlevl = 1.0", "quad8", ["own_load.py"], "amplitude, kind, boundary, weight, level"),
        ("1.0", "quad8", [], "loads[0].kind = 'hydrostatic': must be one of"),
        ("1.0", "quad8_mean", ["own_load.py"], "bodies.shaft.element = 'quad8_mean': must be one"),
    ],
)
def test_what_is_not_declared_is_refused(
    weight: str, element: str, examples: list[str], words: str, told: Told
) -> None:
    text = SHAFT.replace("ELEMENT", element).replace("WEIGHT", weight)
    assert words in str(told(text, *examples)["error"])
