"""Tables with a condition: where it is false the file is read as if they did not stand in it."""

from __future__ import annotations

from typing import Any

import pytest

from solver import ModelError
from solver.model.loads import Pressure
from studies.errors import SceneError
from tests.studies.scenes.conftest import blocks, built
from tests.studies.scenes.mistakes import MISTAKES, put


def conditional() -> dict[str, Any]:
    """Return the small scene, in which a third block and all of its tables may be left out."""
    tables = blocks()
    tables["parameters"]["third"] = {"default": "no", "choices": ["no", "yes"]}
    there = "$third == 'yes'"
    tables["bodies"]["top"] = tables["bodies"]["upper"] | {
        "when": there,
        "move": [0.0, 2.0],
        "supports": {"left": "x"},
    }
    tables["contacts"].append(
        {"name": "roof", "slave": "top.bottom", "master": "upper.top", "when": there}
    )
    tables["loads"].insert(0, tables["loads"][0] | {"body": "top", "when": there})
    tables["loads"][1]["when"] = "not ($third == 'yes')"
    tables["results"]["lines"]["above"] = {
        "body": "top", "start": [0.0, 2.0], "end": [0.0, 4.0], "when": there,
    }  # fmt: skip
    return tables


def test_a_table_is_there_where_its_condition_holds() -> None:
    scene = built(conditional())
    for third, bodies in (("no", ["upper", "lower"]), ("yes", ["upper", "lower", "top"])):
        parameters = scene.parameters(third=third)
        model = scene.model(parameters)
        assert [body.name for body in model.bodies] == bodies
        assert len(model.contacts) == len(bodies) - 1
        loaded = [b.name for b in model.bodies if any(isinstance(x, Pressure) for x in b.loads)]
        assert loaded == [bodies[-1] if third == "yes" else "upper"]
        assert scene.places is not None
        assert ("above" in scene.places(parameters).lines) == (third == "yes")


def test_it_may_be_a_table_of_the_file_or_stand_in_a_list() -> None:
    tables = blocks()
    tables["parameters"]["fine"] = {"default": True}
    tables["results"] |= {"when": "$fine"}
    near = tables["bodies"]["upper"]["shape"]["near"] = []
    near.append({"at": [0, 0], "size": 0.1, "when": "$fine"})
    scene = built(tables)
    bodies = [scene.model(scene.parameters(fine=fine)).bodies[0] for fine in (True, False)]
    assert bodies[0].mesh.nelements > bodies[1].mesh.nelements
    assert scene.places is not None
    assert [len(scene.places(scene.parameters(fine=f)).lines) for f in (True, False)] == [1, 0]


def test_what_names_a_table_that_is_left_out_is_told() -> None:
    tables = conditional()
    del tables["contacts"][1]["when"]
    with pytest.raises(SceneError, match=r"contacts\[1\]\.slave = 'top': must be one of"):
        built(tables)
    tables["parameters"]["third"]["default"] = "yes"
    scene = built(tables)
    with pytest.raises(ModelError, match=r"contacts\[1\]\.slave = 'top': must be one of"):
        scene.parameters(third="no")


@pytest.mark.parametrize(
    ("when", "told"),
    [
        ("$third == 'Yes' and 2", "2 is 2: must be true or false"),
        ("$third", "must be true or false"),
        (1, "must be true or false"),
        ("always", "must be true or false"),
        ("$fourth > 0", r"\$fourth is no parameter"),
    ],
)
def test_a_wrong_condition_is_told_by_its_entry(when: object, told: str) -> None:
    tables = conditional()
    tables["bodies"]["top"]["when"] = when
    if when == "$third == 'Yes' and 2":
        tables["parameters"]["third"]["choices"].append("Yes")
        tables["parameters"]["third"]["default"] = "Yes"
    with pytest.raises(SceneError, match=rf"bodies\.top\.when = .*{told}"):
        built(tables)


def test_a_name_that_does_not_exist_is_told_in_a_table_that_is_left_out_too() -> None:
    tables = conditional()
    tables["bodies"]["top"]["move"] = [0.0, "$tall"]
    with pytest.raises(SceneError, match=r"bodies\.top\.move\[1\] = .*\$tall is no parameter"):
        built(tables)


def test_a_name_of_the_users_own_may_be_when() -> None:
    tables = blocks()
    tables["bodies"]["when"] = tables["bodies"].pop("lower")
    tables["contacts"][0]["master"] = "when.top"
    tables["results"]["lines"]["middle"]["body"] = tables["outputs"]["least"]["body"] = "when"
    assert [body.name for body in built(tables).model(built(tables).parameters()).bodies] == [
        "upper",
        "when",
    ]


@pytest.mark.parametrize("kind", ["unknown material", "unknown boundary", "unknown kind"])
def test_mistakes_beside_it_are_told_by_their_entries(kind: str) -> None:
    tables = conditional()
    put("loads", [tables["loads"][1]])(tables)
    del tables["loads"][0]["when"]
    change, field, _ = MISTAKES[kind]
    change(tables)
    with pytest.raises(SceneError) as caught:
        built(tables)
    assert [each.field for each in caught.value.mistakes] == [field]
