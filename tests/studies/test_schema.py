"""All mistakes of a study are reported at once, and its JSON Schema describes a study whole."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema_rs
import pytest

from solver.results.quantities import QUANTITIES
from solver.shipped import SCENES
from studies import Study, StudyError
from studies.definition.files import read_study
from studies.definition.schema import OF_STUDY
from studies.errors import MOST_MISTAKES

ROOT = Path(__file__).parents[2]
SHIPPED = sorted((ROOT / "data" / "studies").glob("*.toml"))
SCHEMA = jsonschema_rs.validator_for(Study.model_json_schema())
FIT = {"measured": [{"of": "peak_contact_pressure", "values": [500.0, "0.6 GPa"]}]}
BOUNDS = {"friction": [0.0, 0.3], "yield_stress": {"start": "0.2 GPa", "stop": 500.0}}
RIGHT: list[dict[str, Any]] = [
    {"goal": {"find": "limit_load", "between": [0.1, 1.0]}},
    {"goal": {"parameter": "friction", "of": "plastic_work", "at": "2 J", "between": [0, "0.5"]}},
    {"refine": {"of": "plastic_work"}, "sweep": {"friction": [0.1, 0.2]}},
    {"refine": {"of": ["plastic_work", {"of": "depth", "take": "largest"}], "most": 40}},
    {"fit": FIT | {"ranges": BOUNDS, "first": {"friction": 0.1}}},
    {"minimise": {"of": "plastic_work", "where": "plastic_work < 2 J", "ranges": BOUNDS}},
    {"minimise": {"of": "plastic_work", "where": ["plastic_work < 2"], "ranges": BOUNDS}},
    {"sweep": {"friction": {"start": 0.0, "stop": "0.4", "num": 5, "spacing": "log"}}},
    {"sweep": {"both": {"low": {"friction": 0.1}}, "points": [{"friction [1]": "0.3"}]}},
    {"sample": {"method": "lhs", "num": 8, "ranges": BOUNDS | {"hardening": ["none"]}}},
    {"points": [{"case": "a", "friction": 0.1}]},
    {"extends": "before", "sweep": {"friction": [0.2]}},
]
WRONG: list[dict[str, Any]] = [
    {"goal": {"between": 7}},
    {"goal": {"between": [0.1, 1.0], "within": 7}},
    {"goal": {"between": [0.1, 1.0], "find": "peace"}},
    {"refine": {"of": [], "most": 0}},
    {"fit": {"ranges": BOUNDS}},
    {"fit": FIT | {"ranges": BOUNDS, "step": 2}},
    {"minimise": {"of": "plastic_work", "ranges": {"friction": {"start": 0.1}}}},
    {"sample": {"method": "dice", "num": 8, "ranges": BOUNDS}},
    {"points": []},
    {"peace": 1},
]


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_the_schema_accepts_every_shipped_study(path: Path) -> None:
    SCHEMA.validate(read_study(path))


@pytest.mark.parametrize("content", RIGHT)
def test_the_schema_accepts_all_ways_to_write_an_entry(content: dict[str, Any]) -> None:
    SCHEMA.validate({"name": "right", "scene": "punch"} | content)


@pytest.mark.parametrize("content", WRONG)
def test_the_schema_refuses_what_the_study_refuses(content: dict[str, Any]) -> None:
    wrong = {"name": "wrong", "scene": "punch"} | content
    assert not SCHEMA.is_valid(wrong)
    with pytest.raises(StudyError):
        Study.from_dict(wrong)


def refused(**content: Any) -> StudyError:
    with pytest.raises(StudyError) as caught:
        Study.from_dict({"name": "wrong", "scene": "punch"} | content)
    return caught.value


def test_all_mistakes_of_a_study_are_reported_at_once() -> None:
    error = refused(
        name="no name", parameters={"frictoin": 0.1, "half_width": "20 MPa"}, tags=["a", "b c"],
        sweep={"load_ratio": [0.5, "x", 0.5], "friction": {"start": 0, "stop": "1 mm", "num": 1},
               "steel": {"soft": {"yield_stress": -1}, "hard": {"yield_strain": 1}}},
        fit={"measured": [{"of": "plastic_work", "values": [], "sigma": 0}, {"of": "peace"}],
             "ranges": {"load_step": [0.2, 0.1]}, "most": 0},
        peace=1,
    )  # fmt: skip
    assert [each.field for each in error.each] == [
        "name", "parameters.frictoin", "parameters.half_width", "sweep.load_ratio[1]",
        "sweep.load_ratio[2]", "sweep.friction.stop", "sweep.friction.num",
        "sweep.steel.soft.yield_stress", "sweep.steel.hard.yield_strain", "tags[1]", "peace",
        "fit.ranges.load_step", "fit.measured[0].values", "fit.measured[1].of",
        "fit.measured[1].values", "fit.most",
    ]  # fmt: skip
    assert [each.value for each in error.each][:3] == ["no name", 0.1, "20 MPa"]
    assert str(error).count("\n") == len(error.each) - 1


def test_mistakes_between_entries_are_reported_at_once() -> None:
    goal = {"parameter": "friction", "find": "limit_load", "between": [0.1, 0.2]}
    fixed = {"load_ratio": 0.4, "friction": 0.2}
    error = refused(parameters=fixed, sweep={"load_ratio": [0.3]}, goal=goal)
    assert [each.field for each in error.each] == ["parameters.load_ratio", "goal.parameter"]


def test_a_scene_that_is_not_known_hides_no_mistake_that_does_not_depend_on_it() -> None:
    error = refused(scene="pumch", parameters={"frictoin": 0.1}, keep="all", goal={"within": 7})
    assert [each.field for each in error.each] == ["scene", "keep", "goal.within", "goal.between"]


def test_of_many_mistakes_the_first_are_listed_and_all_are_counted() -> None:
    error = refused(points=[{"friction": "x"}] * 1000)
    assert (len(error.each), error.count) == (MOST_MISTAKES, 1000)
    assert str(error).endswith("and 980 more")


def test_an_entry_of_the_study_among_its_parameters_is_told_its_place() -> None:
    entries = {*Study.model_json_schema()["properties"]}
    assert entries == {*OF_STUDY, "name", "scene", "parameters", "sweep", "files"}
    with pytest.raises(StudyError, match=r"parameters\.goal = .*: write goal above all tables"):
        Study.from_dict({"name": "a", "scene": "punch", "parameters": {"goal": RIGHT[0]["goal"]}})


def test_a_number_of_a_scene_has_no_name_that_a_kind_of_study_uses() -> None:
    number = replace(QUANTITIES["plastic_work"], name="search_state")
    scene = replace(SCENES["punch"], name="own", quantities=(number,))
    content = {"name": "least", "minimise": {"of": "plastic_work", "ranges": BOUNDS}}
    with pytest.raises(StudyError, match=r"minimise = 'search_state': .* rename that of the scene"):
        Study.from_dict(content, scene)
