"""Studies of traffic: a sequence of passes is a parameter of TOML and JSON, and an axis."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from solver.rolling.scenes import rail_passes
from solver.shipped import SCENES
from studies import Store, Study, open_study
from studies.definition.parameters import scene_schema
from studies.errors import StudyError
from studies.execution.estimate import estimate
from tests.studies.conftest import compute_here

TOML = """
name = "traffic"
scene = "wheel_rail"

[parameters]
accuracy = "draft"
load = 60e3
passes = 3

[[parameters.sequence]]
load = 90e3
traction = -0.3

[[parameters.sequence]]
times = 2

[sweep]
friction = [0.2, 0.3]
"""
ENTRIES = [{"load": 90000, "traction": -0.3}, {"times": 2}]


def study(sweep: dict[str, Any], **parameters: Any) -> Study:
    """A study of traffic."""
    usual = {"accuracy": "draft", "load": 60e3}
    given = {"name": "traffic", "scene": "wheel_rail", "parameters": usual | parameters}
    return Study.from_dict(json.loads(json.dumps(given | {"sweep": sweep})))


def test_tables_of_a_file_are_those_of_a_request(tmp_path: Path) -> None:
    file = tmp_path / "study.toml"
    file.write_text(TOML)
    posted = study({"friction": [0.2, 0.3]}, passes=3, sequence=ENTRIES)
    assert Study.from_toml(file).id == posted.id


@pytest.mark.long
@pytest.mark.solves
def test_a_study_of_sequences_is_computed_and_read(store: Store) -> None:
    order = {"first": {"sequence": ENTRIES}, "last": {"sequence": ENTRIES[::-1]}}
    traffic = study({"order": order}, passes=3, yield_stress=300.0, load_spread=0.05)
    compute_here(traffic, store, SCENES["wheel_rail"])
    data = open_study(store.directory).squeeze()
    assert (data["status"] == "ok").all()
    mean = [[90e3, 60e3, 60e3], [60e3, 60e3, 90e3]]
    scatter = data["pass_load"].transpose("order", "pass") / mean - 1
    assert 0 < abs(scatter).min() and abs(scatter).max() <= 0.15
    np.testing.assert_allclose(scatter[0], scatter[1], atol=1e-12)
    lowest = data["pass_residual_min"].sel(component="xx").isel({"pass": -1})
    assert abs(lowest.diff("order").item()) > 1.0


@pytest.mark.parametrize(
    ("sequence", "told"),
    [
        ([{"load": -1.0}], r"parameters\.sequence\[0\]\.load = -1\.0: must be greater than 0"),
        ([{}, {"gauge": 1}], r"parameters\.sequence\[1\]\.gauge = 1\.0: must be one of load, "),
        ([5], r"parameters\.sequence = \[5\]: must be a list of tables"),
        ([{"load": None}], "must be a list of tables, each value a finite number or a text"),
        ({"load": 1.0}, r"parameters\.sequence = .*: must be a list of tables"),
    ],
)
def test_wrong_tables_are_refused_by_name(sequence: Any, told: str) -> None:
    with pytest.raises(StudyError, match=told):
        study({"friction": [0.3]}, sequence=sequence)


def test_an_axis_of_seeds_needs_a_spread() -> None:
    with pytest.raises(StudyError, match=r"sweep\.seed = \[1, 2\]: changes nothing"):
        study({"seed": [1, 2]})
    study({"seed": [1, 2]}, load_spread=0.1)


def test_an_axis_of_expansions_needs_a_change_of_temperature() -> None:
    with pytest.raises(
        StudyError, match=r"sweep\.expansion = .*needs temperature_change other than 0"
    ):
        study({"expansion": [1e-5, 1.2e-5]})
    study({"expansion": [1e-5, 1.2e-5]}, temperature_change=-20.0)


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (
            {"initial_stress": "roller_straightened", "straightening_stress": 620.0},
            r"parameters\.straightening_stress = 620\.0: makes 61\d.* MPa at z = .*, y = -0\.\d+ m",
        ),
        ({"temperature_change": 250.0}, r"parameters\.temperature_change = 250\.0: makes 575 MPa"),
    ],
)
def test_a_rail_that_yields_before_the_first_pass_is_refused_before_it_is_computed(
    store: Store, given: dict[str, Any], told: str
) -> None:
    end = "[^(]*, which must be below the yield stress of 502 MPa before the first pass"
    with pytest.raises(StudyError, match=told + end):
        estimate(study({"friction": [0.3]}, **given), store)


def test_the_schema_has_tables() -> None:
    own = scene_schema("wheel_rail")["properties"]["sequence"]
    assert own["type"] == "array" and own["items"]["type"] == "object"


def test_a_set_up_is_paid_once_in_a_process(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    """Paths of one geometry share it; another geometry needs its own."""
    monkeypatch.setattr("os.cpu_count", lambda: 1)

    def likely(sweep: dict[str, Any]) -> float:
        found = estimate(study(sweep), store).cpu_seconds
        assert found is not None
        return found[1]

    one, two = likely({"friction": [0.2]}), likely({"friction": [0.2, 0.3]})
    other = likely({"foundation": [21.0, 42.0]})
    (path,) = study({"friction": [0.2]}).paths()
    effort = SCENES["wheel_rail"].effort
    assert effort is not None and two - one < other - two
    assert 0.5 < effort(path.parameters, [1]).set_up < other - two
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    assert likely({"friction": [0.2, 0.3]}) == pytest.approx(other, rel=1e-9)
    assert one < two < 2 * one


@pytest.mark.solves
def test_passes_go_on_from_a_stored_run(
    store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Exactly as if they were computed from the start, and only where the state is stored."""

    def mixed(passes: list[int], keep: dict[str, str]) -> Study:
        content = {
            "name": "mixed", "scene": "wheel_rail", "sweep": {"passes": passes}, **keep,
            "parameters": {"accuracy": "draft", "load": 130e3, "load_spread": 0.1, "seed": 3,
                           "sequence": ENTRIES, "hardening": "kinematic"},
        }  # fmt: skip
        return Study.from_dict(json.loads(json.dumps(content)))

    scene, given = SCENES["wheel_rail"], {"keep": "fields"}
    whole, passed = Store(tmp_path / "whole"), []
    compute_here(mixed([1, 3], {}), whole, scene)
    compute_here(mixed([1], given), store, scene)
    own = rail_passes.search
    monkeypatch.setattr(
        rail_passes, "search", lambda *args, **more: passed.append(1) or own(*args, **more)
    )
    compute_here(mixed([3], {}), store, scene)
    assert len(passed) == 2
    (case,) = mixed([3], {}).cases()
    one, other = (xr.load_dataset(each.run_path(case.id)) for each in (whole, store))
    xr.testing.assert_equal(one.drop_vars("cpu_seconds"), other.drop_vars("cpu_seconds"))
    longer = {each: estimate(mixed([8], {}), each) for each in (store, whole)}
    assert [each.increments for each in longer.values()] == [7, 8]
    words = [each.costs(chooses=False)["loading paths"] for each in longer.values()]
    assert "on from the end of a stored run" in words[0]
    assert "on from" not in words[1]
