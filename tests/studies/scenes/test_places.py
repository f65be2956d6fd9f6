"""Positions along lines: even, graded, away from a place, in pieces; and cycles of loading."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from studies.errors import SceneError
from studies.scenes.scene import FileScene
from studies.scenes.tables import SpacedTable, positions
from tests.studies.scenes.conftest import blocks, built


def piece(**given: Any) -> SpacedTable:
    return SpacedTable(**given)


def test_pieces_and_single_places_follow_each_other() -> None:
    whole = (0.0, piece(start=1.0, stop=2.0, num=3), piece(start=3.0, stop=5.0, num=2))
    assert positions(whole).tolist() == [0.0, 1.0, 1.5, 2.0, 3.0, 5.0]


def test_distances_from_a_place_are_in_a_constant_ratio() -> None:
    after = positions(piece(start=5.001, stop=6.0, num=81, away=5.0))
    before = positions(piece(start=4.0, stop=4.999, num=81, away=5.0))
    assert after - 5.0 == pytest.approx(np.geomspace(1e-3, 1.0, 81))
    assert 5.0 - before[::-1] == pytest.approx(np.geomspace(1e-3, 1.0, 81))
    assert (before[0], before[-1], after[0], after[-1]) == (4.0, 4.999, 5.001, 6.0)


def test_of_a_piece_with_bounds_those_between_them_are_taken() -> None:
    found = positions(piece(start=0.0, stop=1.0, num=11, within=(0.1, 0.45)))
    assert found == pytest.approx([0.2, 0.3, 0.4])


@pytest.mark.parametrize(
    ("x", "told"),
    [
        ([0.0, {"start": 1.0, "stop": 0.5, "num": 3}], "results.map.x[1].stop"),
        ([2.0, {"start": 1.0, "stop": 3.0, "num": 3}], "results.map.x"),
        ({"start": 1.0, "stop": 3.0, "num": 3, "away": 2.0}, "results.map.x.away"),
        ({"start": 1.0, "stop": 3.0, "num": 3, "within": [5, 6]}, "results.map.x.within"),
        ([{"start": 1.0, "stop": 3.0}], "results.map.x[0].num"),
        ({"start": 1.0, "stop": "high", "num": 3}, "results.map.x.stop"),
        ([], "results.map.x"),
        (3.0, "results.map.x"),
    ],
)
def test_wrong_places_are_told(x: Any, told: str) -> None:
    tables = blocks()
    tables["results"]["map"] = {"x": x, "y": {"start": -1.0, "stop": 1.0, "num": 3}}
    with pytest.raises(SceneError) as caught:
        built(tables)
    assert told in [each.field for each in caught.value.mistakes], caught.value


def cycled(cycles: Any) -> FileScene:
    """Return the small scene, pressed and released several times."""
    tables = blocks()
    del tables["stages"]
    tables["parameters"]["times"] = {"default": 2, "range": [1, 9]}
    tables["outputs"]["least"]["stage"] = "loaded"
    tables["loading"] = {"factor": 1.0, "step": 0.5, "release_increments": 2, "cycles": cycles}
    if cycles != "$times":
        tables["loads"][0]["value"] = "150.0 + $times"
    return built(tables)


def test_a_load_is_put_on_as_often_as_asked() -> None:
    scene = cycled(3)
    assert scene.branch == ""
    program = scene.program(scene.parameters())
    assert (len(program.laps), program.count) == (3, 12)


@pytest.mark.solves
def test_runs_of_more_and_more_cycles_go_on_where_the_others_end() -> None:
    scene = cycled("$times")
    assert scene.branch == "times"
    calls: list[float] = []
    records = list(scene.path(scene.parameters(mu=0.0), [1, 3], calls.append))
    assert len(calls) == 12 + 1
    for times, record in zip((1, 3), records, strict=True):
        assert record.parameters.times == times
        dims, force = record.fields["contact_normal_force"]
        assert dims == ("contact", "increment")
        assert force[0] == pytest.approx([0.0, *[300.0, 600.0, 300.0, 0.0] * times], abs=1e-6)
