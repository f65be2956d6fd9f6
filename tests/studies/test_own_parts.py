"""Words of one's own, from files that RESIDUA_PARTS names: in studies, scene files and ids."""

from __future__ import annotations

import math
import os
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.architecture.sources import ROOT
from tests.programs import Programs

BAR = """
name = "bar"
kinematics = "plane_stress"

[parameters]
rule = { default = "none", choices = ["none", "swift", "threshold"] }

[materials.steel]
youngs_modulus = 2e5
poisson_ratio = 0.3
yield_stress = 350.0
hardening = "$rule"
swift_exponent = 0.3

[bodies.bar]
material = "steel"
shape = { kind = "rectangle", x = [0, 4], y = [0, 1], size = 1.0 }
supports = { left = "x", bottom = "y" }

[[loads]]
body = "bar"
kind = "pressure"
boundary = "right"
value = -420.0

[loading]
factor = 1.0
step = 0.05

[outputs.strain]
of = "plastic_strain"
body = "bar"
stage = "loaded"
"""
STUDY = """
name = "own"
scene = "bar.toml"
[sweep]
rule = ["swift", "threshold"]
"""
HELD = (
    BAR.replace("plane_stress", "plane_strain")
    .replace('default = "none", choices = ["none", "swift", "threshold"]', "default = 8.0")
    .replace('hardening = "$rule"', 'yield_condition = "hosford"')
    .replace("swift_exponent = 0.3", 'hosford_exponent = "$rule"')
    .replace('kind = "pressure"', 'kind = "displacement"')
    .replace("value = -420.0", "x = 0.08")
    .replace("step = 0.05", "step = 0.1")
    .replace('of = "plastic_strain"', 'of = "stress.xx"')
)
"""The bar held across its plane and stretched by 2 %: it flows in pure shear at last."""
EXPONENTS = (2.0, 8.0, 20.0)
SWIFT = 0.002 * ((420.0 / 350.0) ** (1 / 0.3) - 1)
"""Plastic strain at which 350 MPa (1 + p / 0.002)^0.3 is 420 MPa."""
WORDS = "none, isotropic, kinematic, mixed, voce, power, table, chaboche, layered"
RUN_ID = """
from studies import Study
study = Study.from_dict({"name": "a", "scene": "ball", "sweep": {"load_ratio": [1.0]}})
print(next(iter(study.cases())).id)
"""


def command(*words: str) -> str:
    """Return a program that does what the command ``residua`` does."""
    run = f"sys.exit(main({[*words]}))"
    return f'import sys\nfrom residua.cli import main\nif __name__ == "__main__":\n    {run}\n'


Called = Callable[[str, str], subprocess.CompletedProcess[str]]
RUN, HERE = (command("run", "study.toml", "--out", "out", "--workers", workers) for workers in "10")
SCENES = command("scenes", "punch")


@pytest.fixture
def called(tmp_path: Path, programs: Programs) -> Called:
    """Run a program with some files of parts, in a folder with the examples."""
    for name in ("own_curve.py", "own_back_stress.py", "own_yield_surface.py"):
        (tmp_path / name).write_text((ROOT / "examples" / name).read_text())
    paths = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH", "")]))

    def run(parts: str, program: str) -> subprocess.CompletedProcess[str]:
        (tmp_path / "program.py").write_text(program)
        environment = os.environ | {"PYTHONPATH": paths, "RESIDUA_PARTS": parts}
        return programs.run(tmp_path / "program.py", tmp_path, environment)

    return run


BOTH = os.pathsep.join(["own_curve.py", "own_back_stress.py"])


@pytest.mark.processes
def test_a_study_of_a_scene_file_is_computed_with_words_of_ones_own(
    tmp_path: Path, called: Called
) -> None:
    (tmp_path / "bar.toml").write_text(BAR)
    (tmp_path / "study.toml").write_text(STUDY)
    done = called(BOTH, RUN)
    assert done.returncode == 0, done.stderr
    rows = [line.split() for line in done.stdout.splitlines()]
    strain = {row[0]: float(row[2]) for row in rows if row[:1] in (["swift"], ["threshold"])}
    assert strain["swift"] == pytest.approx(SWIFT, rel=1e-3)
    # 350 MPa and 70 MPa of the back stress: 40 MPa without recall, the rest fading
    assert strain["threshold"] == pytest.approx(40 / 6e4 - math.log(1 - 30 / 100) / 600, rel=0.02)
    again = called(BOTH, RUN)
    assert "0 computed" in again.stdout
    refused = called("own_curve.py", RUN)
    assert (refused.returncode, refused.stderr.count("\n")) == (2, 1)
    assert (
        f"hardening = 'threshold': must be one of {WORDS}, swift (at rule = threshold)"
        in refused.stderr
    )


@pytest.mark.processes
def test_a_yield_surface_of_ones_own_is_swept_in_a_scene_file(
    tmp_path: Path, called: Called
) -> None:
    (tmp_path / "bar.toml").write_text(HELD)
    study = STUDY.replace('["swift", "threshold"]', str([*EXPONENTS]))
    (tmp_path / "study.toml").write_text(study)
    done = called("own_yield_surface.py", HERE)
    assert done.returncode == 0, done.stderr
    rows = [line.split() for line in done.stdout.splitlines()]
    stress = [float(row[2]) for row in rows if row[:1] in [[f"{a:g}"] for a in EXPONENTS]]
    # no strain across: the third stress tends to the mean, and the bar bears twice the shear stress
    assert stress == pytest.approx(
        [2 * 350.0 * (2 / (2 + 2**a)) ** (1 / a) for a in EXPONENTS], abs=0.06
    )  # four digits are printed


SURFACE = """
from solver import SCENES, ModelError
from solver.parameters import unmet
from solver.scenes.punch import PunchParameters
from solver.rolling.scenes.rolling import RollingParameters
from studies import Study

print(type(PunchParameters(yield_condition="hosford").material()).__name__)
print(unmet(PunchParameters(), "hosford_exponent"))
print(bool(unmet(PunchParameters(yield_condition="hosford"), "hosford_exponent")))
p = RollingParameters(
    element_size=4.0, growth=2.0, load="hertz", passes=1, yield_condition="hosford"
)
(record,) = SCENES["rolling"].path(p, [1], lambda share: None)
print(record.status.solved, record.scalars["max_plastic_strain"] > 1e-3)
print(max(record.scalars[f"audit_{each}"] for each in ("law", "history", "yield")) < 1e-9)
content = {"name": "a", "scene": "punch", "parameters": {"yield_condition": "hosford"}}
print(len(list(Study.from_dict(content | {"sweep": {"hosford_exponent": [2.0, 8.0]}}).cases())))
for refused in (
    lambda: PunchParameters(yield_condition="round"),
    lambda: PunchParameters(yield_condition="hosford", hosford_exponent=1.0),
    lambda: PunchParameters(yield_condition="hosford", hardening="kinematic"),
    lambda: Study.from_dict({"name": "a", "scene": "punch", "sweep": {"hosford_exponent": [2, 8]}}),
):
    try:
        print(refused())
    except ValueError as error:
        print(error)
"""


@pytest.mark.processes
def test_a_yield_surface_of_ones_own_is_known_to_scenes_and_rolls(called: Called) -> None:
    done = called("own_yield_surface.py", SURFACE)
    assert done.returncode == 0, done.stderr
    *found, word, exponent, rule, idle = done.stdout.splitlines()
    assert found == [
        "SmoothMaterial",
        "needs yield_condition = hosford",
        "False",
        "True True",
        "True",
        "2",
    ]
    assert word == "yield_condition = 'round': must be one of mises, tresca, hosford"
    assert exponent == "hosford_exponent = 1.0: must be at least 2 and at most 100"
    rules = "none, isotropic, voce, power, table where yield_condition is hosford"
    assert rule == f"hardening = 'kinematic': must be one of {rules}"
    assert idle.endswith(
        "changes nothing in any run of this study: needs yield_condition = hosford"
    )


@pytest.mark.processes
def test_a_shipped_scene_is_read_beside_parts_with_a_modulus(called: Called) -> None:
    done = called(BOTH, RUN_ID)
    assert done.returncode == 0, done.stderr


@pytest.mark.processes
def test_ids_of_runs_follow_what_a_file_of_parts_computes(tmp_path: Path, called: Called) -> None:
    def run_id(text: str = "") -> str:
        own = tmp_path / "mine.py"
        own.write_text(text)
        done = called(str(own) if text else "", RUN_ID)
        assert done.returncode == 0, done.stderr
        return done.stdout

    text = (ROOT / "examples/own_curve.py").read_text()
    none, first, same, other = map(
        run_id, ["", text, text + "# a comment\n", text.replace("0.002,", "0.003,")]
    )
    assert len({none, first, other}) == 3
    assert same == first


@pytest.mark.processes
def test_a_word_is_listed_with_its_parameters_and_a_bad_file_is_one_line(
    tmp_path: Path, called: Called
) -> None:
    listed = called(BOTH, SCENES)
    assert f"one of {WORDS}, swift, threshold" in listed.stdout
    assert "n of swift hardening" in listed.stdout
    (tmp_path / "bad.py").write_text("from solver import SCENES\n")
    refused = called("bad.py", SCENES)
    assert refused.returncode == 2
    (line,) = refused.stderr.splitlines()
    assert line.startswith("residua: RESIDUA_PARTS = ")
    assert line.endswith("must run: it imports scenes, whose parameters include those of its parts")
