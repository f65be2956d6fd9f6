"""Sweeps of functions."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import xarray as xr

from solver import LimitLoad, NotConverged
from studies import StudyError, sweep


def product(a: float, word: str) -> dict[str, Any]:
    if a < 0:
        raise LimitLoad(f"a = {a}", 0.5, 1.0)
    if word == "bad":
        raise NotConverged("bad word")
    line = xr.DataArray(a * np.arange(3.0), dims="s", coords={"s": [0.0, 1.0, 2.0]})
    return {"double": 2 * a, "line": line, "long": len(word)}


AXES = {"a": [3.0, -1.0, 2.0], "word": ["one", "bad", "four"]}


@pytest.mark.processes
@pytest.mark.parametrize("workers", [1, 2])
def test_a_function_is_swept_over_its_axes(workers: int) -> None:
    found = sweep(product, AXES, workers=workers)
    assert found.double.dims == ("a", "word")
    assert found.a.values.tolist() == AXES["a"]  # in the order given
    assert found.word.values.tolist() == AXES["word"]
    assert float(found.double.sel(a=2.0, word="four")) == 4.0
    assert found.line.sel(a=3.0, word="one").values.tolist() == [0.0, 3.0, 6.0]
    assert found.status.sel(a=3.0).values.tolist() == ["ok", "not_converged", "ok"]
    assert (found.status.sel(a=-1.0) == "limit_load").all()
    assert str(found.message.sel(a=-1.0, word="one").values) == "a = -1.0"
    assert np.isnan(found.double.sel(a=-1.0)).all()
    assert np.isnan(found.line.sel(word="bad")).all()


def test_other_errors_are_not_kept_quiet() -> None:
    with pytest.raises(ZeroDivisionError):
        sweep(lambda a: {"b": 1 / a}, {"a": [1, 0]})


@pytest.mark.parametrize(
    ("axes", "told"),
    [({}, "axes = {}"), ({"a": []}, r"axes\.a = \[\]"), ({"a": [1, 1]}, r"axes\.a = \[1, 1\]")],
)
def test_axes_that_are_none_are_refused(axes: dict[str, Any], told: str) -> None:
    with pytest.raises(StudyError, match=told):
        sweep(product, axes)


def test_where_all_fails_the_status_is_left() -> None:
    found = sweep(product, {"a": [-1.0], "word": ["one"]})
    assert found.status.values.tolist() == [["limit_load"]]
