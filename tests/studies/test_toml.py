"""Texts of TOML and JSON that a parser would take minutes for, or fail in, are refused before."""

from __future__ import annotations

import time

import pytest

from studies import StudyError
from studies.toml import DEEPEST, check_depth, toml_of


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
def test_what_is_nested_too_deep_is_refused(text: str) -> None:
    with pytest.raises(StudyError, match=f"f.toml.* deep; at most {DEEPEST} are allowed"):
        toml_of(text.encode(), "file", "f.toml")


@pytest.mark.parametrize(
    "text", ['"""\\' * 50_000, '"\\"' * 75_000, "a \t" * 75_000, "'" * 225_001]
)
def test_the_time_to_find_depth_grows_with_the_length_alone(text: str) -> None:
    """Sixteen times the time for four times the length is growth with its square."""

    def seconds(text: str) -> float:
        began = time.process_time()
        check_depth(text)
        return time.process_time() - began

    assert min(seconds(4 * text) for _ in range(3)) < 8 * min(seconds(text) for _ in range(3))


def test_brackets_and_dots_in_texts_and_remarks_do_not_count() -> None:
    deep = "[" * 60 + "a." * 60
    text = (
        f'a = "{deep}\\"{deep}"\nb = """\n{deep}"\n"""\nc = \'{deep}\'  # {deep}\nd = [[1.5, 2.5]]'
    )
    assert toml_of(text.encode(), "file", "f.toml")["d"] == [[1.5, 2.5]]
    keys = ".".join("a" * DEEPEST) + " = 1"
    assert toml_of(keys.encode(), "file", "f.toml").keys() == {"a"}
