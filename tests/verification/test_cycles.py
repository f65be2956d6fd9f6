"""Repeated stages: thermal ratchetting of a wall (Bree), and the same stages written one by one."""

from __future__ import annotations

import tomllib
from typing import Any

import numpy as np
import pytest

from solver.results.record import Record
from solver.results.shakedown import ShakedownState
from studies.scenes.description import Description
from studies.scenes.scene import file_scene
from tests.architecture.sources import ROOT
from tests.studies.scenes.conftest import blocks

FILE = ROOT / "data" / "scenes" / "bree.toml"
YIELD, E = 300.0, 2e5


def content(**repeat: Any) -> dict[str, Any]:
    """Return the tables of the file, cycles as many as asked unless `until` is given."""
    tables = tomllib.loads(FILE.read_text())
    del tables["repeat"]["until"]
    tables["repeat"] |= repeat
    return tables


def computed(tables: dict[str, Any], **values: Any) -> Record:
    scene = file_scene(Description("bree.toml", tables, {}), built=True)
    (*_, record) = scene.path(scene.parameters(**values), [0.0], lambda done: None)
    assert record.status.name == "OK", record.message
    return record


def wall(**values: Any) -> Record:
    return computed(content(until="shaken_down"), **values)


def boundary(steady: float) -> float:
    """Return the thermal stress at which ratchetting begins, over the yield stress."""
    return 4 * (1 - steady) if steady >= 0.5 else 1 / steady


def growth(steady: float, thermal: float) -> float:
    """Return the strain that a cycle adds: J. Bree, J. Strain Analysis 2 (1967) 226-238."""
    share = 1 - 2 * np.sqrt((1 - steady) / thermal)
    return float(2 * thermal * YIELD / E * max(share, 0.0))


@pytest.mark.parametrize(
    ("steady", "below"),
    [(0.3, ShakedownState.PLASTIC_SHAKEDOWN), (0.5, ShakedownState.ELASTIC_SHAKEDOWN),
     (0.7, ShakedownState.ELASTIC_SHAKEDOWN), (0.9, ShakedownState.ELASTIC_SHAKEDOWN)],
)  # fmt: skip
def test_the_wall_ratchets_from_brees_boundary_on(steady: float, below: ShakedownState) -> None:
    """Two per cent below and above; cycles end when they are decided."""
    under, above = (wall(steady=steady, thermal=f * boundary(steady)) for f in (0.98, 1.02))
    assert under.scalars["shakedown_state"] == below
    assert above.scalars["shakedown_state"] == ShakedownState.RATCHETTING
    assert abs(under.scalars["growth"]) < 1e-3 * YIELD / E
    for record in (under, above):
        assert len(record.fields["cycle_net_increment"][1]) < 6


def test_a_wall_that_never_yields_is_elastic_after_two_cycles() -> None:
    record = wall(steady=0.4, thermal=0.5)
    assert record.scalars["shakedown_state"] == ShakedownState.ELASTIC
    np.testing.assert_array_equal(record.coordinates["cycle"], [1, 2])
    assert not record.fields["cycle_dissipation"][1].any()


@pytest.mark.parametrize(("steady", "thermal"), [(0.7, 1.5), (0.8, 1.2)])
def test_a_cycle_adds_the_strain_of_brees_closed_form(steady: float, thermal: float) -> None:
    """Every point has it as plastic strain, in tension; increments take the mean of the stress."""
    record = wall(steady=steady, thermal=thermal)
    found = record.scalars["growth"]
    assert found == pytest.approx(growth(steady, thermal), rel=0.02)
    assert record.scalars["steady_net_increment"] == pytest.approx(found, rel=1e-3)
    dissipated = record.fields["cycle_dissipation"][1][-1]
    assert dissipated == pytest.approx(YIELD * found, rel=0.05)


def test_after_cycles_that_end_early_the_loading_goes_on_as_after_all() -> None:
    """Nothing yields any more after some cycles of shakedown: the others would change nothing."""
    found = []
    for tables in (content(), content(until="shaken_down")):
        tables["stages"] += [{"name": "colder", "increments": 2}]
        tables["loads"][1]["amplitude"]["colder"] = -0.4
        tables["outputs"]["last"] = {"of": "displacement.x", "body": "wall", "stage": "colder"}
        found.append(computed(tables, times=14, steady=0.5, thermal=1.8))
    every, early = found
    cycles = [len(each.coordinates["cycle"]) for each in found]
    assert cycles[1] < cycles[0] == 14
    assert early.scalars["last"] == pytest.approx(every.scalars["last"], rel=1e-4)
    for record, count in zip(found, cycles, strict=True):
        assert len(record.coordinates["increment"]) == 1 + 1 + 8 * count + 2
        assert np.isfinite(record.fields["reaction_x"][1]).all()
        assert np.isfinite(record.fields["cycle_dissipation"][1]).all()


def test_repeated_stages_are_those_written_one_by_one() -> None:
    tables = content()
    start, hot, cold = tables["stages"]
    tables["parameters"]["times"]["default"] = 3
    every = {k: [hot | {"name": f"hot{k}"}, cold | {"name": f"cold{k}"}] for k in (1, 2, 3)}
    flat = {key: each for key, each in tables.items() if key != "repeat"}
    flat["parameters"] = {k: v for k, v in tables["parameters"].items() if k != "times"}
    flat["stages"] = [start, *(stage for both in every.values() for stage in both)]
    amplitude = {"start": 0} | {f"hot{k}": 1 for k in every} | {f"cold{k}": 0 for k in every}
    flat["outputs"] = {"growth": tables["outputs"]["growth"] | {"stage": "cold3", "minus": "cold2"}}
    flat["loads"] = [tables["loads"][0], tables["loads"][1] | {"amplitude": amplitude}]
    found = [computed(each).scalars["growth"] for each in (tables, flat)]
    assert found[0] == found[1] != 0.0


def test_the_work_that_a_cycle_turns_into_heat_is_the_area_of_its_loop() -> None:
    """A block pressed on another one is dragged to and fro; most of the work is friction."""
    tables = blocks()
    tables["kinematics"] = "plane_stress"
    del tables["bodies"]["upper"]["supports"], tables["loads"], tables["outputs"]
    factors = {"pressed": 0, "to": 1, "fro": -1}
    tables["rigid"] = {
        "plate": {"y": {"pushed": -800.0}, "x": {"moved": 0.04, "amplitude": factors}}
    }
    tables["links"] = [{"slave": "upper.top", "rigid": "plate"}]
    tables["stages"] += [{"name": name, "increments": 10} for name in ("to", "fro")]
    tables["repeat"] = {"stages": ["to", "fro"], "times": 3}
    fields = computed(tables).fields
    force, way = (fields[name][1][-1] for name in ("reaction_x", "motion_x"))
    last = slice(-21, None)
    loop = float(np.trapezoid(force[last], way[last]))
    assert loop > 0.85 * 4 * 0.04 * 0.2 * 800.0
    assert fields["cycle_dissipation"][1][-1] == pytest.approx(loop, rel=1e-6)
