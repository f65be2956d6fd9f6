"""What a scene file asks for by words: outputs, profiles, surfaces; accuracy, checks, lines."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest

from solver import ModelError, Status
from solver.mesh import refined
from solver.results.outputs import output, outputs
from studies.definition.parameters import parameters_of, scene_schema
from studies.errors import SceneError
from studies.scenes.arithmetic import ExpressionError, evaluated
from studies.scenes.shape_tables import GradedTable, GridTable, mesh_of
from tests.studies.scenes.conftest import blocks, built

LEVELS = {
    "draft": {"fine": "1/2", "parts": 2},
    "standard": {"fine": "1/4", "parts": 2},
    "fine": {"fine": 0.125, "parts": 3},
}


def levelled() -> dict[str, Any]:
    """Return the small scene with two numbers that accuracy sets."""
    tables = blocks()
    tables["parameters"] |= {
        "fine": {"range": [0.01, 0.9], "description": "element side / width"},
        "parts": {"range": [1, 10]},
    }
    tables["derived"]["side"] = "$wide*$fine"
    tables["stages"][0]["increments"] = "$parts"
    tables["accuracy"] = copy.deepcopy(LEVELS)
    return tables


def released() -> dict[str, Any]:
    """Return the small scene with a release, and places along its surface and below it."""
    tables = blocks()
    tables["stages"].append({"name": "left", "increments": 2, "release": True})
    tables["results"] |= {
        "outputs": ["contact", "stick", "surfaces", "profiles", "extremes"],
        "s": {"start": 0, "stop": "$wide", "num": 9},
        "surfaces": ["lower.top", "upper.bottom"],
        "profile": {
            "body": "lower",
            "depth": {"start": 0, "stop": 2, "num": 5},
            "stations": [1.0, "$wide/2"],
        },
    }
    return tables


def test_accuracy_sets_the_numbers_that_are_left_out() -> None:
    scene = built(levelled())
    kind = scene.parameters
    assert (kind().accuracy, kind().fine, kind().parts) == ("standard", 0.25, 2)
    assert (kind(accuracy="draft").fine, kind(accuracy="fine").parts) == (0.5, 3)
    assert kind(accuracy="fine", fine=0.3).fine == 0.3
    assert scene.program(kind(accuracy="fine")).count == 3
    known = parameters_of(scene)
    assert known["accuracy"].default == "standard" and known["fine"].default is None
    properties = scene_schema(scene)["properties"]
    assert properties["parts"]["type"] == "integer" and "default" not in properties["parts"]
    with pytest.raises(ModelError, match="accuracy = 'best': must be one of draft, standard, fine"):
        kind(accuracy="best")
    with pytest.raises(ModelError, match="fine = 2"):
        kind(fine=2.0)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda t: t["accuracy"]["draft"].pop("fine"), "accuracy.draft.fine"),
        (lambda t: t["accuracy"]["fine"].update(fine=5), "accuracy.fine.fine = 5: must be in its"),
        (lambda t: t["accuracy"]["fine"].update(fine="1/x"), "accuracy.fine.fine"),
        (
            lambda t: t["accuracy"]["fine"].update(parts=1.5),
            "accuracy.fine.parts = 1.5: must be an",
        ),
        (lambda t: t["accuracy"]["fine"].update(wide=5), "accuracy.fine.wide"),
        (lambda t: t["parameters"]["fine"].update(default=0.1), "accuracy.draft.fine"),
        (lambda t: t.pop("accuracy"), "parameters.fine.default: must be given"),
        (
            lambda t: t["parameters"].update(accuracy={"default": "a", "choices": ["a"]}),
            "parameters.accuracy",
        ),
    ],
)
def test_a_wrong_accuracy_is_told(change: Any, told: str) -> None:
    tables = levelled()
    change(tables)
    with pytest.raises(SceneError) as error:
        built(tables)
    assert told in str(error.value)


def test_a_check_refuses_parameters_that_do_not_go_together() -> None:
    tables = blocks()
    check = {"parameter": "mu", "that": "$mu*$wide <= 4", "allowed": "must be at most 4 / wide"}
    tables["checks"] = [check]
    scene = built(tables)
    scene.parameters(mu=0.5, wide=8.0)
    with pytest.raises(ModelError, match=r"mu = 0\.6: must be at most 4 / wide"):
        scene.parameters(mu=0.6, wide=8.0)
    tables["checks"] = [check | {"parameter": "nu"}, check | {"that": "$mu > 1"}]
    with pytest.raises(SceneError) as error:
        built(tables)
    assert [each.field for each in error.value.mistakes] == ["checks[0].parameter", "mu"]


def test_comparisons_are_true_or_false() -> None:
    assert evaluated("$a + 1 >= 2*$b", {"a": 1, "b": 1}) is True
    assert evaluated("$a < $b", {"a": 1, "b": 1}) is False
    for text in ("$a < $b < 2", "1 + ($a < $b)"):
        with pytest.raises(ExpressionError):
            evaluated(text, {"a": 1, "b": 1})


@pytest.mark.solves
def test_outputs_have_the_names_of_the_built_in_scenes() -> None:
    scene = built(released())
    (record,) = scene.path(scene.parameters(), [None], lambda share: None)
    assert record.status is Status.OK, record.message
    dims = {name: dims for name, (dims, _) in record.fields.items()}
    assert dims["contact_pressure"] == ("stage", "s")
    assert dims["surface_residual"] == ("body", "component", "s")
    assert dims["residual_profile"] == ("station", "component", "depth")
    assert list(record.coordinates["station"]) == [1.0, 2.0]
    pressure = record.fields["contact_pressure"][1]
    assert pressure[0] == pytest.approx(150.0, rel=0.05)
    assert not pressure[1].any()
    assert record.scalars["contact_half_width"] == pytest.approx(2.0)
    assert 0.0 < record.scalars["stick_fraction"] <= 1.0
    assert record.scalars["peak_residual_tension"] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("lost", "told"),
    [("s", "results.s"), ("profile", "results.profile"), ("surfaces", "results.surfaces")],
)
def test_an_output_that_lacks_something_is_told(lost: str, told: str) -> None:
    tables = released()
    del tables["results"][lost]
    with pytest.raises(SceneError, match=f"results.outputs = .*: needs .*{told}"):
        built(tables)
    tables = released()
    tables["stages"].pop()
    with pytest.raises(SceneError, match="'extremes': needs a last stage that releases"):
        built(tables)


def test_wrong_places_and_words_are_told() -> None:
    tables = released()
    tables["results"]["outputs"].append("wear")
    tables["results"]["surfaces"][0] = "lower.roof"
    tables["results"]["axis"] = {"along": [1, 1]}
    with pytest.raises(SceneError) as error:
        built(tables)
    told = {each.field: each.allowed for each in error.value.mistakes}
    assert "contact" in told["results.outputs[5]"]
    assert "must name a boundary of lower" in told["results.surfaces"]
    assert "length 1" in told["results.axis.along"]


def test_what_stands_twice_is_told() -> None:
    tables = released()
    tables["results"]["outputs"].append("stick")
    tables["results"]["surfaces"].append("lower.top")
    with pytest.raises(SceneError) as error:
        built(tables)
    found = [(each.field, each.value) for each in error.value.mistakes]
    assert found == [("results.outputs", "stick"), ("results.surfaces", "lower")]


def test_an_output_with_parameters_has_a_table_of_them() -> None:
    tables = released()
    tables["results"]["corner"] = {"half_width": "$wide/2"}
    with pytest.raises(SceneError, match=r"results\.corner\.mean_pressure"):
        built(tables)


def test_a_word_is_given_once() -> None:
    known = outputs()["contact"].make
    assert output("contact")(known) is known
    with pytest.raises(ModelError, match="output = 'contact': is the word of contact already"):

        @output("contact")
        def other(run: object) -> object:
            return run

    def namesake(run: object) -> object:
        return run

    namesake.__qualname__ = "contact"  # the same name in another file
    with pytest.raises(ModelError, match="output = 'contact': is the word of contact already"):
        output("contact")(namesake)


def test_runs_of_a_factor_share_increments_where_only_outputs_have_it() -> None:
    tables = released()
    del tables["stages"]
    tables["outputs"]["least"]["stage"] = "loaded"
    tables["parameters"]["load"] = {"default": 1.0, "range": [0.1, 2.0]}
    tables["loading"] = {"factor": "$load"}
    tables["results"]["pressure_error"] = {"half_width": "$wide", "mean_pressure": "100*$load"}
    scene = built(tables)
    assert scene.branch == "load"
    assert scene.program(scene.parameters(load=0.7)).count == 1 + 5  # without a step, one increment


def test_a_grid_has_lines_through_its_marks() -> None:
    x = ({"at": 0, "size": 0.2}, {"at": 5, "size": 0.05, "largest": 0.5}, {"at": 20, "largest": 4})
    table = GridTable(kind="grid", x=x, y=({"at": -3}, {"at": 0, "size": 0.1}), growth=1.5)
    mesh = mesh_of(table, "quad")
    along, up = (np.unique(each) for each in mesh.p)
    inf = float("inf")
    np.testing.assert_array_equal(along, refined([0, 5, 20], [0.2, 0.05, inf], 1.5, [0.5, 4]))
    assert up[-1] - up[-2] <= 0.1 and (up[0], up[-1]) == (-3.0, 0.0)
    assert set(mesh.boundaries) == {"left", "right", "bottom", "top"}
    x = ({"at": 0}, {"at": 5, "size": 0.5, "parts": 9}, {"at": 20, "largest": 4})
    table = GridTable(kind="grid", x=x, y=({"at": -3}, {"at": 0, "size": 0.1}), growth=1.5)
    even = np.unique(mesh_of(table, "quad").p[0])
    np.testing.assert_array_equal(even[:10], np.linspace(0, 5, 10))
    np.testing.assert_array_equal(even[9:], refined([5, 20], [0.5, inf], 1.5, [4]))
    points = ({"at": (0, 1), "size": 0.2}, {"at": (3, 5), "size": 0.05, "largest": 0.5})
    chain = GradedTable(kind="graded", points=points, growth=1.5).chain()
    steps = np.hypot(*np.diff(chain))
    np.testing.assert_allclose(steps, np.diff(along[along <= 5.0]), rtol=1e-9)
    np.testing.assert_allclose(chain[:, [0, -1]].T, [(0, 1), (3, 5)])


@pytest.mark.parametrize(
    ("x", "told"),
    [
        (({"at": 1}, {"at": 0, "size": 1}), "must have increasing places"),
        (({"at": 0, "largest": 1}, {"at": 1, "size": 1}), "no side before its first place"),
        (({"at": 0, "parts": 2}, {"at": 1, "size": 1}), "no side before its first place"),
        (({"at": 0}, {"at": 1e4, "size": 1e-2, "largest": 1e-2}), "at most 200000 elements"),
    ],
)
def test_wrong_marks_are_told(x: Any, told: str) -> None:
    table = GridTable(kind="grid", x=x, y=({"at": 0, "size": 1}, {"at": 1}), growth=1.2)
    with pytest.raises(ModelError, match=told):
        mesh_of(table, "quad")
