"""Repeated stages: thermal ratchetting of a wall (Bree), and the same stages written one by one."""

from __future__ import annotations

import tomllib
from typing import Any

import numpy as np
import pytest

from solver.results.record import Record
from studies.scenes.description import Description
from studies.scenes.scene import file_scene, read_scene
from tests.architecture.sources import ROOT

FILE = ROOT / "data" / "scenes" / "bree.toml"
YIELD, E = 300.0, 2e5


def wall(**values: Any) -> Record:
    scene = read_scene(FILE)
    (*_, record) = scene.path(scene.parameters(**values), [0.0], lambda done: None)
    assert record.status.name == "OK", record.message
    return record


def growth(steady: float, thermal: float) -> float:
    """Return the strain that a cycle adds: J. Bree, J. Strain Analysis 2 (1967) 226-238."""
    share = 1 - 2 * np.sqrt((1 - steady) / thermal)
    return float(2 * thermal * YIELD / E * max(share, 0.0))


def test_the_wall_ratchets_from_brees_boundary_on() -> None:
    """The boundary is a thermal stress of 4 (1 - steady stress): one per cent below and above."""
    boundary = 4 * (1 - 0.7)
    assert abs(wall(steady=0.7, thermal=0.99 * boundary).scalars["growth"]) < 1e-3 * YIELD / E
    above = 1.01 * boundary
    found = wall(steady=0.7, thermal=above).scalars["growth"]
    assert found == pytest.approx(growth(0.7, above), rel=0.02)


@pytest.mark.parametrize(("steady", "thermal"), [(0.7, 1.5), (0.8, 1.2)])
def test_a_cycle_adds_the_strain_of_brees_closed_form(steady: float, thermal: float) -> None:
    found = wall(steady=steady, thermal=thermal).scalars["growth"]
    assert found == pytest.approx(growth(steady, thermal), rel=0.02)


def test_repeated_stages_are_those_written_one_by_one() -> None:
    content = tomllib.loads(FILE.read_text())
    start, hot, cold = content["stages"]
    content["parameters"]["times"]["default"] = 3
    every = {k: [hot | {"name": f"hot{k}"}, cold | {"name": f"cold{k}"}] for k in (1, 2, 3)}
    flat = {key: each for key, each in content.items() if key != "repeat"}
    flat["parameters"] = {k: v for k, v in content["parameters"].items() if k != "times"}
    flat["stages"] = [start, *(stage for both in every.values() for stage in both)]
    amplitude = {"start": 0} | {f"hot{k}": 1 for k in every} | {f"cold{k}": 0 for k in every}
    flat["loads"] = [content["loads"][0], content["loads"][1] | {"amplitude": amplitude}]
    flat["outputs"] = {
        "growth": content["outputs"]["growth"] | {"stage": "cold3", "minus": "cold2"}
    }
    found = []
    for tables in (content, flat):
        scene = file_scene(Description("bree.toml", tables, {}), built=True)
        (*_, record) = scene.path(scene.parameters(), [0.0], lambda done: None)
        found.append(record.scalars["growth"])
        assert record.status.name == "OK", record.message
    assert found[0] == found[1] != 0.0
