"""Texts of TOML and JSON that a parser would take minutes for, or fail in, are refused before."""

from __future__ import annotations

import pytest

from studies import StudyError
from studies.toml import DEEPEST, check_depth, toml_of
from tests.counted import counted, growth


@pytest.mark.parametrize(
    "text",
    [
        ".".join("a" * 100_000) + " = 1",
        "[" + " . ".join(['"a"'] * 60) + "]",
        "a = " + "[" * 100_000,
        "a = {b = " * 51 + "1" + "}" * 51,
        'a = ["""x"""", ' + "[" * 60,
        "a = ['''x''''', " + "[" * 60,
        "[" + ".".join("a" * 40) + "]\n" + ".".join("b" * 40) + " = 1",
    ],
    ids=["key", "header", "lists", "tables", "quotes", "ticks", "both"],
)
def test_what_is_nested_too_deep_is_refused_at_once(text: str) -> None:
    refused = pytest.raises(StudyError, match=f"f.toml.* deep; at most {DEEPEST} are allowed")
    with counted() as calls, refused:
        toml_of(text.encode(), "file", "f.toml")
    assert calls < 2_000, "the key took 70 s"


@pytest.mark.parametrize(
    ("part", "length"), [('"""\\', 50_000), ('"\\"', 75_000), ("a \t", 75_000), ("'", 225_001)]
)
def test_the_time_to_find_depth_grows_with_the_length_alone(part: str, length: int) -> None:
    assert growth(lambda length: check_depth(part * length), length) < 8


def test_brackets_and_dots_in_texts_and_remarks_do_not_count() -> None:
    deep = "[" * 60 + "a." * 60
    text = (
        f'a = "{deep}\\"{deep}"\nb = """\n{deep}"\n"""\nc = \'{deep}\'  # {deep}\nd = [[1.5, 2.5]]'
    )
    assert toml_of(text.encode(), "file", "f.toml")["d"] == [[1.5, 2.5]]
    keys = ".".join("a" * DEEPEST) + " = 1"
    assert toml_of(keys.encode(), "file", "f.toml").keys() == {"a"}
