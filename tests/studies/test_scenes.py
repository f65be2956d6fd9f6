"""Studies of the scenes: what its runs are called, and that they do not depend on the study."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from solver import Record
from solver.results.quantities import IN_SPACE, QUANTITIES
from studies import Store, Study, open_study, run_study
from studies.definition.vocabulary import LABEL_ATTRIBUTES
from studies.scenes.entries import assessed
from studies.scenes.registry import built_in, scene_named
from studies.scenes.scene import read_scene
from studies.views.tables import runs_table
from tests.studies.fakes import Canned

pytestmark = [pytest.mark.solves, pytest.mark.usefixtures("one_worker")]

ROOT = Path(__file__).parents[2]
FILES = [
    read_scene(ROOT / file)
    for file in (
        "data/scenes/pin.toml",
        "data/scenes/crack.toml",
        "data/scenes/bree.toml",
        "tests/studies/scenes/everything.toml",
    )
]
OWN = {quantity.name for scene in FILES for quantity in scene.quantities}

COARSE = {"smallest_element": 0.05, "growth": 2.5, "load_step": 0.15, "hardening": "isotropic"}


def computed(directory: Path, load_ratios: list[float]) -> xr.Dataset:
    """Return the data set of a coarse study, computed by a worker process in a fresh store."""
    sweep: dict[str, Any] = {"load_ratio": load_ratios, "friction": [0.3]}
    study = Study.from_dict(
        {"name": "coarse", "scene": "punch", "parameters": COARSE, "sweep": sweep}
    )
    outcome = run_study(study, Store(directory), workers=1)
    assert outcome.ok, outcome.failed
    return open_study(outcome.dataset)


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> xr.Dataset:
    return computed(tmp_path_factory.mktemp("both"), [0.4, 0.7])


FATIGUE = {"criterion": "dang_van", "limits": {"torsion": 300.0, "sensitivity": 0.3}}


@pytest.fixture(scope="module")
def records() -> list[Record]:
    coarse = {
        "punch": (COARSE, 0.4),
        "elastic_punch": ({"smallest_element": 0.1, "growth": 2.5}, 50.0),
        "shaft_hub": ({"accuracy": "draft", "growth": 2.0}, 50.0),
        "ball": ({"accuracy": "draft", "load_ratio": 2.0, "load_step": 0.5}, 1),
        "cone": ({"element_size": 0.2, "growth": 2.0, "load_step": 0.2, "unload_steps": 1}, 1),
        "rigid_punch": ({"smallest_element": 0.1, "largest_element": 0.1}, 50.0),
        "rolling": (
            {"element_size": 2.0, "advance_step": 2.0, "track": 4.0, "growth": 3.0}
            | {"half_space_size": 50.0, "press_steps": 2, "unload_steps": 1},
            1,
        ),
        "rolling, endless": ({"element_size": 3.0}, 1),
        "wheel_rail": ({"accuracy": "draft"}, 1),
        "raceway": ({"accuracy": "draft"}, 1),
    }
    names = {label: label.split(",")[0] for label in coarse}
    product = {each.name for each in built_in() if not isinstance(each, Canned)}
    assert set(names.values()) == product, "every scene of the product is here"
    found = []
    for label, (parameters, value) in coarse.items():
        name = names[label]
        scene = scene_named(name)
        if name in ("ball", "raceway"):
            scene = assessed(scene, FATIGUE | {"crack": {"threshold": 100.0, "initial": 0.01}})
        found += scene.path(scene.parameters(**parameters), [value], lambda fraction: None)
    for own in (FILES[0], *(assessed(own, FATIGUE) for own in FILES[1:])):
        found += own.path(
            own.parameters(), [getattr(own.parameters(), own.branch, None)], lambda share: None
        )
    return found


@pytest.mark.processes
def test_a_run_is_the_same_bit_for_bit_whichever_others_share_its_path(
    both: xr.Dataset, tmp_path: Path
) -> None:
    alone = computed(tmp_path, [0.7])
    shared = both.sel(load_ratio=[0.7])
    assert float(abs(alone["residual_stress"]).max()) > 1.0, "the run yields"
    for name in set(alone.variables) - {"cpu_seconds"}:
        if name.startswith("run_"):  # when and where
            continue
        np.testing.assert_array_equal(shared[name], alone[name], err_msg=str(name))


def undeclared(record: Record) -> set[str]:
    """Return what a record gives and nobody has declared as it is given."""
    declared = {**QUANTITIES, **(IN_SPACE if "z" in record.coordinates else {})}
    unknown = (record.scalars.keys() | record.fields.keys()) - declared.keys() - OWN
    unknown |= record.coordinates.keys() - declared.keys() - LABEL_ATTRIBUTES.keys()
    for name, (dims, _) in record.fields.items():
        own = declared[name].dims if name in declared else dims
        if own[-2:] == ("y", "x") and "z" in record.coordinates:  # the map of a section
            own = (*own[:-2], "y", "z")
        pairs = ("contact", "stage", "fraction") if own == ("stage", "s") else own
        if dims not in (own, ("pass", *own), pairs):
            unknown.add(name)
    return unknown


def test_every_variable_of_a_scene_is_declared(records: list[Record]) -> None:
    assert not set().union(*map(undeclared, records))


def test_what_is_not_declared_is_found(records: list[Record]) -> None:
    record = records[0]
    number = {**record.scalars, "wear": 1.0}
    field = {**record.fields, "heat": (("x",), np.zeros(1))}
    turned = {**record.fields, "plastic_strain": (("x", "y"), np.zeros((1, 1)))}
    axis = {**record.coordinates, "angle": np.zeros(1)}
    assert undeclared(replace(record, scalars=number)) == {"wear"}
    assert undeclared(replace(record, fields=field)) == {"heat"}
    assert undeclared(replace(record, fields=turned)) == {"plastic_strain"}
    assert undeclared(replace(record, coordinates=axis)) == {"angle"}


def test_no_variable_is_described_that_no_scene_gives(records: list[Record]) -> None:
    given = {
        name
        for record in records
        for names in (record.scalars, record.fields, record.coordinates)
        for name in names
    }
    assert QUANTITIES.keys() <= given


@pytest.mark.processes
def test_the_table_of_the_punch_fits_the_terminal(both: xr.Dataset) -> None:
    sweep = xr.concat([both.assign_coords(friction=[f]) for f in (0.3, 0.4)], "friction")
    wide = xr.concat(
        [sweep.assign_coords(hardening=[h]) for h in ("isotropic", "kinematic")], "hardening"
    )
    wide["status"] = wide["status"].astype(object)
    wide["status"][0, 0, 0] = "not_converged"
    whole = runs_table(wide.transpose("load_ratio", "friction", "hardening", ...))
    table, footnote = whole.split("\n\n", 1)  # a second block would be between them
    assert footnote.startswith("* ")
    lines = table.splitlines()
    heading = len(lines) - wide["status"].size
    words = " ".join(" ".join(column.split()) for column in lines[:heading])
    assert heading == 7
    assert "largest" in words and "surface" in words and "cpu" in words
    assert "not_converged" in lines[heading]
    assert max(map(len, lines)) <= 120
