"""Ranges in a sweep."""

from __future__ import annotations

from typing import Any

import pytest

from studies import Study, StudyError


def study(**sweep: Any) -> Study:
    return Study.from_dict({"name": "range", "scene": "punch", "sweep": sweep})


def test_a_range_is_the_list_of_its_values() -> None:
    one = study(friction={"start": 0.0, "stop": 0.4, "num": 5})
    same = study(friction=[0.0, 0.1, 0.2, 0.3, 0.4])
    assert one.sweep == same.sweep
    assert one.id == same.id


def test_a_range_may_go_back_and_in_equal_ratios() -> None:
    one = study(load_ratio={"start": 0.8, "stop": 0.1, "num": 4, "spacing": "log"})
    assert one.sweep["load_ratio"] == [0.8, 0.4, 0.2, 0.1]


def test_a_range_of_a_parameter_that_counts_has_whole_numbers() -> None:
    content = {"name": "passes", "scene": "rolling"}
    one = Study.from_dict(content | {"sweep": {"passes": {"start": 1, "stop": 7, "num": 4}}})
    assert one.sweep["passes"] == [1, 3, 5, 7]
    with pytest.raises(StudyError, match=r"sweep\.passes\[1\] = 2\.5"):
        Study.from_dict(content | {"sweep": {"passes": {"start": 1, "stop": 4, "num": 3}}})


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"start": 0.0, "stop": 0.4}, "sweep.friction.num: must be given"),
        (
            {"start": 0.0, "stop": 0.4, "num": 5, "step": 1},
            "sweep.friction.step = 1: there is no such entry",
        ),
        ({"start": 0.0, "stop": 0.4, "num": 1}, "sweep.friction.num = 1: must be at least 2"),
        ({"start": 0.0, "stop": 0.4, "num": 2.5}, "sweep.friction.num = 2.5"),
        ({"start": 0.0, "stop": 0.4, "num": True}, "sweep.friction.num = True"),
        ({"start": "0", "stop": 0.4, "num": 3}, "sweep.friction.start = '0': must be a finite"),
        ({"start": 0.0, "stop": float("nan"), "num": 3}, "sweep.friction.stop = nan"),
        (
            {"start": 0.0, "stop": 0.4, "num": 3, "spacing": "log"},
            "sweep.friction.start = 0.0: must be > 0 for spacing = log",
        ),
        ({"start": 0, "stop": 1, "num": 3, "spacing": "cubic"}, "one of linear, log"),
        ({"start": 0.1, "stop": 0.1, "num": 3}, r"sweep.friction\[1\] = 0.1: occurs already"),
        ({"start": 0.0, "stop": 40.0, "num": 3}, r"sweep.friction\[1\] = 20.*<= 10"),
        ({"start": 0.0, "stop": 1.0, "num": 10**9}, "sweep.friction.num = 1000000000"),
    ],
)
def test_a_wrong_range_names_what_is_wrong(given: dict[str, Any], told: str) -> None:
    with pytest.raises(StudyError, match=told):
        study(friction=given)


def test_ranges_count_as_their_values_do() -> None:
    many = {"start": 0.0, "stop": 0.4, "num": 1000}
    with pytest.raises(StudyError, match="at most 100000 runs"):
        study(friction=many, load_ratio={"start": 0.1, "stop": 0.5, "num": 101})
