"""Numbers, times and sizes as people read them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from studies import StudyError
from studies.numbers import number_text, size_text, time_text, typeset
from studies.views.html import number
from studies.views.table import RunTable, column_of


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (0.0, 4, "0"), (-0.0, 4, "0"), (math.nan, 4, "-"), (math.inf, 4, "inf"),
        (0.123456, 4, "0.1235"), (1e-4, 4, "0.0001"), (9.9e-5, 4, "9.9e-05"),
        (12345.6, 4, "12346"), (-12345.6, 2, "-12346"), (999999.9, 4, "1000000"),
        (1e6, 4, "1e+06"), (1234567.0, 6, "1.23457e+06"), (123.456, 6, "123.456"),
    ],
)  # fmt: skip
def test_a_number_has_a_few_digits_and_no_power_of_ten(
    value: float, digits: int, text: str
) -> None:
    assert number_text(value, digits) == text
    assert number(value if digits == 4 else 1.0) == (typeset(text) if digits == 4 else "1")


def test_times_and_sizes_have_a_unit_of_their_size() -> None:
    assert time_text(90.0, 45.0, 180.0) == "about 90 seconds (45 to 180)"
    assert time_text(5400.0, 60.0, 7200.0) == "about 90 minutes (1 to 120)"
    assert (size_text(2.44e6), size_text(1.26e9)) == ("2.44 MB", "1.26 GB")
    assert number("a-b") == "a-b" and number(None) == "–" and number(-2) == "−2"


def test_the_command_and_the_pages_have_one_filter_of_runs() -> None:
    columns = {
        "friction": np.array([0.0, 0.1, 0.2, math.nan]),
        "case": np.array(["a, b", "a", "b", "b"], dtype=object),
        "shakedown_state": np.array([0.0, 1.0, 2.0, math.nan]),
    }
    found = {name: column_of(name, values, "sweep") for name, values in columns.items()}
    table, (first, second, *_) = (
        RunTable(axes={}, columns=found),
        found["shakedown_state"].flags.values(),
    )
    for name, text, runs in (
        ("friction", "0.1..0.2", [1, 2]), ("friction", "0, 0.2", [0, 2]),
        ("friction", "..", [0, 1, 2]),
        ("case", "a, b", [0]), ("case", "b,a", [1, 2, 3]),
        ("shakedown_state", f"{first},{second}", [0, 1]),
    ):  # fmt: skip
        assert table.chosen("", {name: text}).tolist() == runs
        assert np.flatnonzero(table.meeting(f"{name} = {text}")).tolist() == runs
        rest = [run for run in range(4) if run not in runs]
        assert np.flatnonzero(table.meeting(f"{name} != {text}")).tolist() == rest
    with pytest.raises(StudyError, match="where = 'case=b,c': 'c' must be"):
        table.meeting("case=b,c")
    with pytest.raises(StudyError, match="'often' must be"):
        table.meeting("shakedown_state=often")
