"""Samples: which points they have, that longer ones keep them, and what is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from studies import Study, StudyError
from tests.studies.fakes import FAKE

METHODS = ["sobol", "lhs", "halton"]
NAMES = ["load_ratio", "friction", "hardening", "passes"]
RANGES: dict[str, Any] = {
    "friction": [0.0, 0.5],
    "load_ratio": {"start": 0.1, "stop": 4.0, "spacing": "log"},
    "hardening": ["none", "isotropic"],
    "passes": [1, 10],
}


def study(sample: dict[str, Any], **content: Any) -> Study:
    return Study.from_dict({"name": "sampled", "scene": FAKE.name, "sample": sample, **content})


def points(method: str, num: int, seed: int = 0, ranges: Any = None) -> list[dict[str, Any]]:
    sample = {"method": method, "num": num, "seed": seed, "ranges": ranges or RANGES}
    found: Any = study(sample).sweep["point"]
    return list(found)


@pytest.mark.parametrize("method", METHODS)
def test_a_longer_sample_of_the_same_seed_keeps_its_points(method: str) -> None:
    longer = points(method, 128)
    assert longer[:64] == points(method, 64)
    assert longer[:32] == points(method, 32)
    assert points(method, 100)[:50] == points(method, 50)
    assert len(longer) == 128
    assert points(method, 64, seed=1) != longer[:64]


@pytest.mark.parametrize("method", ["sobol", "halton"])
def test_a_sequence_may_be_cut_anywhere(method: str) -> None:
    assert points(method, 41)[:17] == points(method, 17)


def test_samples_are_the_same_to_the_bit_on_every_machine() -> None:
    """The numbers are those of scipy 1.17 and numpy 2.4; a study keeps the points themselves."""
    first = {method: points(method, 8)[0] for method in METHODS}
    assert first == {
        "sobol": dict(zip(NAMES, (0.45369483415, 0.482060109265, "isotropic", 7), strict=True)),
        "lhs": dict(zip(NAMES, (1.04821612253, 0.134893356882, "none", 1), strict=True)),
        "halton": dict(zip(NAMES, (1.35836541046, 0.234539835168, "none", 10), strict=True)),
    }


@pytest.mark.parametrize("num", [64, 50, 7])
def test_a_latin_hypercube_has_one_point_in_each_interval(num: int) -> None:
    ranges = {"friction": [0.0, 1.0], "half_width": [10.0, 20.0]}
    for size in (num, 2 * num):
        found = points("lhs", size, ranges=ranges)
        for name, start, length in (("friction", 0.0, 1.0), ("half_width", 10.0, 10.0)):
            shares = np.array([(each[name] - start) / length for each in found])
            assert sorted((shares * size).astype(int)) == list(range(size))


def test_sobol_points_have_one_in_each_box_of_every_shape() -> None:
    """16 scrambled points in two dimensions: a (0, 4, 2)-net in base 2."""
    ranges = {"friction": [0.0, 1.0], "half_width": [1.0, 2.0]}
    found = points("sobol", 16, ranges=ranges)
    shares = np.array([(each["friction"], each["half_width"] - 1.0) for each in found])
    for k in range(5):
        boxes = (shares * [2**k, 2 ** (4 - k)]).astype(int)
        assert len(np.unique(boxes, axis=0)) == 16


@pytest.mark.parametrize("method", METHODS)
def test_ranges_have_equal_shares_equal_ratios_and_all_whole_numbers(method: str) -> None:
    found = points(method, 160)
    loads = np.array([each["load_ratio"] for each in found])
    assert loads.min() > 0.1
    assert loads.max() < 4.0
    assert np.median(np.log(loads / 0.1) / np.log(40.0)) == pytest.approx(0.5, abs=0.03)
    passes = np.bincount([each["passes"] for each in found], minlength=11)
    assert passes[0] == 0
    assert (abs(passes[1:] - 16) <= 3).all()
    rules = [each["hardening"] for each in found]
    assert abs(rules.count("none") - 80) <= 3


@pytest.mark.parametrize("method", METHODS)
def test_words_and_whole_numbers_make_each_combination_once(method: str) -> None:
    ranges = {"hardening": ["none", "isotropic"], "passes": [1, 10]}
    found = points(method, 20, ranges=ranges)
    assert len({(each["hardening"], each["passes"]) for each in found}) == 20
    assert found[:5] == points(method, 20, ranges=ranges)[:5]


def test_a_sample_is_stored_as_its_points_and_has_their_id() -> None:
    sampled = study({"method": "halton", "num": 3, "ranges": {"friction": [0.0, 0.5]}})
    same = Study.from_dict({"name": "sampled", "scene": "fake", "points": sampled.sweep["point"]})
    assert sampled.id == same.id == Study.from_dict(sampled.to_dict()).id
    assert "sample" not in sampled.to_dict()


@pytest.mark.parametrize(
    ("change", "field", "allowed"),
    [
        ({"method": "latin"}, "sample.method", "must be one of sobol, lhs, halton"),
        ({"method": "sobel"}, "sample.method", "did you mean sobol?"),
        ({"method": None}, "sample.method", "must be one of sobol, lhs, halton"),
        ({"method": []}, "sample.method", "must be one of sobol, lhs, halton"),
        ({"num": 0}, "sample.num", "must be at least 1"),
        ({"num": True}, "sample.num", "must be an integer"),
        ({"num": 100_001}, "sample.num", "at most 100000"),
        ({"seed": -1}, "sample.seed", "must be at least 0"),
        ({"seeds": 1}, "sample.seeds", "did you mean seed?"),
        ({"ranges": {}}, "sample.ranges", "a range for each parameter"),
        ({"ranges": {"frictoin": [0, 1]}}, "sample.ranges.frictoin", "did you mean friction?"),
        ({"ranges": {"friction": [0.5, 0.1]}}, "sample.ranges.friction", "its lowest value"),
        ({"ranges": {"friction": [0.0, 7.0]}}, "sample.ranges.friction[1]", ">= 0 and <= 1"),
        ({"ranges": {"friction": [0.1, 0.2, 0.3]}}, "sample.ranges.friction", "[lowest, highest]"),
        ({"ranges": {"friction": 0.1}}, "sample.ranges.friction", "[lowest, highest]"),
        ({"ranges": {"friction": {"start": 0}}}, "sample.ranges.friction.stop", "must be given"),
        ({"ranges": {"passes": [1, 2.5]}}, "sample.ranges.passes[1]", "an integer"),
        ({"ranges": {"hardening": ["none", "x"]}}, "sample.ranges.hardening[1]", "none, isotropic"),
        ({"ranges": {"hardening": ["none"] * 2}}, "sample.ranges.hardening[1]", "keep one"),
        ({"ranges": {"hardening": [1, 2]}}, "sample.ranges.hardening[0]", "must be one of none"),
        (
            {"ranges": {"friction": {"start": 0.0, "stop": 1.0, "spacing": "log"}}},
            "sample.ranges.friction.start",
            "must be > 0",
        ),
        (
            {"ranges": {"friction": {"start": 0.0, "stop": 1.0, "spacing": "cubic"}}},
            "sample.ranges.friction.spacing",
            "must be one of linear, log",
        ),
        ({"ranges": {"passes": [1, 3]}}, "sample.num", "at most 3, which are all combinations"),
    ],
)
def test_a_wrong_sample_is_refused_in_one_line(
    change: dict[str, Any], field: str, allowed: str
) -> None:
    with pytest.raises(StudyError) as caught:
        study({"method": "lhs", "num": 4, "ranges": {"friction": [0.0, 0.5]}} | change)
    assert caught.value.field == field
    assert allowed in caught.value.allowed
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("sample", [[{"friction": 0.1}], "lhs", None])
def test_what_is_no_table_is_no_sample(sample: Any) -> None:
    with pytest.raises(StudyError, match=r"sample.*: must be a table"):
        study(sample)
    with pytest.raises(StudyError, match=r"sample\.method: must be given"):
        study({"num": 4, "ranges": {"friction": [0.0, 0.5]}})
