"""Values from tables: exact where they are linear, none outside, and what is refused."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from solver import ModelError, Pressure
from solver.model.tabulated import Tabulated

Array = NDArray[np.float64]

RNG = np.random.default_rng(3)
CORNERS = np.array([[0.0, 10.0, 10.0, 0.0], [0.0, 0.0, 4.0, 4.0]])
PLACES = np.hstack([CORNERS, RNG.uniform(0, 1, (2, 30)) * [[10.0], [4.0]]])
INSIDE = RNG.uniform(0, 1, (2, 200)) * [[10.0], [4.0]]


def linear(x: Array) -> Array:
    return np.asarray(3.0 - 2.0 * x[0] + 0.5 * x[1])


def test_a_linear_field_is_exact_between_scattered_positions() -> None:
    table = Tabulated(x=PLACES[0], y=PLACES[1], value=linear(PLACES))
    assert np.allclose(table(INSIDE), linear(INSIDE), atol=1e-12)
    assert np.allclose(table(CORNERS * (1 + 1e-12)), linear(CORNERS), atol=1e-8)
    again = pickle.loads(pickle.dumps(table))
    assert np.array_equal(again.times(2.0)(INSIDE), 2.0 * table(INSIDE))


@pytest.mark.parametrize("axis", ["x", "y"])
def test_a_table_along_one_axis_is_linear_between_its_positions(axis: str) -> None:
    at = np.array([2.0, 0.0, 1.0])  # in any order
    table = Tabulated(**{axis: at}, value=at**2)
    places = np.full((2, 2), 99.0)
    places["xy".index(axis)] = 0.5, 1.5
    assert np.allclose(table(places), [0.5, 2.5])


def test_a_table_is_read_from_a_file_with_a_header(tmp_path: Path) -> None:
    file = tmp_path / "p.csv"
    file.write_text("\ufeffy , x,first,second\n0,0,1,2\n\n0,1,3,4\n1,0,5,6\n", encoding="utf-8")
    table = Tabulated.read(file, "second")
    assert np.allclose(table(np.array([[0.5], [0.5]])), 5.0)


def test_a_position_outside_is_refused_by_the_load() -> None:
    table = Tabulated(x=np.array([0.0, 5.0]), value=np.ones(2))
    with pytest.raises(
        ModelError, match=r"pressure.top = \(5.1, 1.0\): must be inside the table: x"
    ):
        Pressure(boundary="top", value=table).push(np.array([[5.1], [1.0]]), np.ones((2, 1)))
    wide = Tabulated(x=PLACES[0], y=PLACES[1], value=linear(PLACES))
    with pytest.raises(ModelError, match="x from 0 to 10 and y from 0 to 4 mm"):
        wide(np.array([[11.0], [1.0]]))


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "table = 'nothing': must have the columns x, y or both, and value"),
        ("x,y,v\n0,0,1\n", "table = 'x, y, v': must have the columns"),
        ("z,value\n0,1\n", "must have the columns x, y or both"),
        ("x,value\n0,1\n1,b\n", "could not convert .* must be numbers"),
        ("x,value\n0,1\n1\n", "a line of another length"),
        ("x,value\n0,1\n", "must be lists of one length, 2 or more"),
        ("x,value\n0,1\n1,nan\n", "must be finite"),
        ("x,value\n0,1\n1,2\n0,3\n", r"table = \(0.0,\): must not be a position of two values"),
        ("x,y,value\n0,0,1\n1,1,2\n2,2,3\n", "positions on one line.*: needs x alone, or y alone"),
    ],
)
def test_what_is_no_table_is_refused(text: str, told: str) -> None:
    with pytest.raises(ModelError, match=told):
        Tabulated.of(text)
