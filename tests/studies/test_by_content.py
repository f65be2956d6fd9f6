"""What is made of arrays is made once for the same content."""

from __future__ import annotations

import weakref
from typing import Any

import numpy as np
import pytest

from solver.memory import SETTING
from studies import StudyError, predict
from studies.views import gaussian, sensitivity
from studies.views.fits import by_content
from tests.studies.test_predict import rough, sampled, smooth


def test_equal_arrays_are_taken_for_one_and_others_are_not() -> None:
    made: list[float] = []

    @by_content
    def total(values: np.ndarray, factor: float) -> float:
        made.append(float(values.sum()) * factor)
        return made[-1]

    values = np.arange(6.0)
    assert [total(values, 1.0), total(values.copy(), 1.0)] == [15.0, 15.0] and len(made) == 1
    total(values, 2.0)
    total(values.reshape(2, 3), 1.0)
    total(np.arange(6), 1.0)
    values[0] = 1.0
    assert total(values, 1.0) == 16.0 and len(made) == 5
    assert total(np.asfortranarray(values.reshape(2, 3)), 1.0) == 16.0 and len(made) == 6
    assert total(np.arange(6.0), 1.0) == 15.0 and len(made) == 6


def test_results_are_kept_up_to_a_number_of_bytes_and_the_arrays_are_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv(SETTING, "8MB")
    made: list[float] = []

    @by_content
    def spread(values: np.ndarray, factor: float) -> np.ndarray:
        made.append(factor)
        return factor * values[:200_000]

    long = np.ones(4_000_000)
    for factor in (1.0, 2.0, 3.0, 4.0, 5.0):  # 1.6 MB each
        spread(long, factor)
    assert spread(long, 3.0).mean() == 3.0 and len(made) == 5
    for factor in (6.0, 7.0, 8.0, 9.0, 1.0):
        spread(long, factor)
    assert made[-1] == 1.0 and len(made) == 10
    before = weakref.ref(long)
    del long
    assert before() is None, "a digest is the key"


def test_what_is_refused_is_refused_again_without_a_second_look() -> None:
    looked: list[np.ndarray] = []

    @by_content
    def refusing(values: np.ndarray) -> None:
        looked.append(values)
        raise StudyError("runs", 1, "are too few")

    for _ in range(3):
        with pytest.raises(StudyError, match="too few"):
            refusing(np.ones(3))
    assert len(looked) == 1


def test_a_process_is_fitted_once_to_the_numbers_of_a_data_set(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    fits: list[Any] = []
    likely = gaussian._most_likely
    monkeypatch.setattr(gaussian, "_most_likely", lambda *g: fits.append(g) or likely(*g))
    places = ({"x": 0.3, "y": 0.4}, {"x": 0.5, "y": 0.6}, {"x": 0.3, "y": 0.4})
    found = [predict(sampled(smooth), of="number", **at)["number"].item() for at in places]
    once = len(fits)
    assert found[0] == found[2] != found[1] and once > 0
    predict(sampled(smooth), of="number", x=0.7, y=0.2)
    assert len(fits) == once
    predict(sampled(rough), of="line", x=0.7, y=0.2)
    assert len(fits) > once


def test_indices_are_found_once_for_the_numbers_of_a_data_set(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    fits: list[Any] = []
    fitted = sensitivity.fitted
    monkeypatch.setattr(sensitivity, "fitted", lambda *g: fits.append(g) or fitted(*g))
    dataset = sampled(lambda x, y: x + 0.31 * y**2)
    first = sensitivity.sensitivity(dataset, "number")
    once = len(fits)
    assert once > 0
    assert sensitivity.sensitivity(dataset, "number").identical(first) and len(fits) == once
