"""A law of friction in a file of one's own, by its word: in scene files and in scenes."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.architecture.sources import ROOT
from tests.programs import Programs

OWN = ROOT / "examples/own_friction.py"
BY_ITS_WORD = """
import numpy as np
from solver import ModelError
from solver.parameters import unmet
from solver.scenes.punch import PunchParameters
from solver.rolling.scenes.rolling import RollingParameters
from tests.studies.scenes.conftest import blocks, built

tables = blocks()
tables["contacts"][0] |= {"friction_law": "saturating", "tau_max": 8.0}
scene = built(tables)
(pair,) = scene.model(scene.parameters()).contacts
print(pair.law)
(record,) = scene.path(scene.parameters(), [None], lambda share: None)
_, shear = record.fields["contact_shear"]
_, pressure = record.fields["contact_pressure"]
print(record.status.name, float(np.abs(shear).max()) <= 8.0 < 0.2 * float(pressure.max()))
p = PunchParameters(friction_law="saturating", friction=0.4)
print(p.tau_max, [each for each in ("cohesion", "friction", "shear_limit") if unmet(p, each)])
print(unmet(PunchParameters(), "tau_max"))
for refused in (
    lambda: PunchParameters(friction_law="none"),
    lambda: PunchParameters(tau_max=0.0),
    lambda: RollingParameters(friction_law="saturating", traction=0.5),
    lambda: RollingParameters(friction_law="saturating", load="hertz"),
):
    try:
        print(refused())
    except ModelError as error:
        print(error)
"""
CLASHES = """
from dataclasses import dataclass
from solver.model.friction import FRICTION, FrictionLaw
from solver.parameters import Stress, described

@FRICTION.word("own")
@dataclass(frozen=True, kw_only=True)
class Own(FrictionLaw):
    yield_stress: Stress = described(10.0, "of the film")
    def bound(self, at): return [(0.0, 0.0)]
"""


Called = Callable[[str, Path | str], subprocess.CompletedProcess[str]]


@pytest.fixture
def called(tmp_path: Path, programs: Programs) -> Called:
    """Run a program with a file of parts."""

    def run(code: str, own: Path | str) -> subprocess.CompletedProcess[str]:
        (tmp_path / "program.py").write_text(code)
        setting = os.environ | {"RESIDUA_PARTS": str(own), "PYTHONPATH": str(ROOT)}
        return programs.run(Path("program.py"), tmp_path, setting)

    return run


@pytest.mark.processes
def test_a_law_of_ones_own_is_known_by_its_word(called: Called) -> None:
    done = called(BY_ITS_WORD, OWN)
    assert done.returncode == 0, done.stderr
    law, record, scene, idle, *refused = done.stdout.splitlines()
    assert law == "Saturating(friction=0.2, tau_max=8.0)"
    assert record == "OK True"
    assert scene == "50.0 ['cohesion', 'shear_limit']"
    assert idle == "needs friction_law = saturating"
    assert [text.split(":")[0] for text in refused] == [
        "friction_law = 'none'",
        "tau_max = 0.0",
        "traction = 0.5",
        "friction_law = 'saturating'",
    ]
    assert refused[0].endswith("must be one of coulomb, saturating")


@pytest.mark.processes
def test_a_parameter_that_scenes_have_already_is_refused(tmp_path: Path, called: Called) -> None:
    own = tmp_path / "own.py"
    own.write_text(CLASHES)
    done = called("import solver.scenes.punch", own)
    assert "friction_law = 'yield_stress': is another parameter already" in done.stderr


@pytest.mark.processes
def test_ids_follow_the_file_of_a_law(tmp_path: Path, called: Called) -> None:
    own, found = tmp_path / "own.py", []
    asked = "from studies.definition.identity import solver_hash; print(solver_hash())"
    for text in ("", OWN.read_text(), OWN.read_text().replace("6.0, 25", "6.0, 13")):
        own.write_text(text)
        found.append(called(asked, own if text else "").stdout)
    assert all(found)
    assert len(set(found)) == 3
