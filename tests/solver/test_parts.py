"""Parts named by a word: declared once, refused where they clash, added by files of one's own."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Annotated

import pytest
from annotated_types import Interval, Unit

from solver.errors import ModelError
from solver.parameters import described
from solver.parts import Parts

Size = Annotated[float, Interval(gt=0.0), Unit("mm")]


@dataclass(frozen=True, kw_only=True)
class Round:
    radius: Size = described(1.0, "radius")


@dataclass(frozen=True, kw_only=True)
class Square:
    side: Size = described(2.0, "side")


def shapes() -> Parts[object]:
    parts: Parts[object] = Parts("shape")
    parts.word("round")(Round)
    parts.word("square")(Square)
    return parts


def test_words_and_parameters_come_of_the_declarations() -> None:
    parts = shapes()
    assert list(parts) == ["round", "square"]
    assert {name: hint for name, (hint, _) in parts.parameters().items()} == {
        "radius": Size,
        "side": Size,
    }
    assert parts.used("square") == {"side"}


def test_a_part_is_made_of_its_own_parameters() -> None:
    assert shapes().made("round", SimpleNamespace(radius=3.0, side=7.0)) == Round(radius=3.0)


def test_an_unknown_word_is_refused_with_those_that_are_known() -> None:
    with pytest.raises(ModelError, match="shape = 'oval': must be one of round, square"):
        shapes()["oval"]


def test_a_word_names_one_part() -> None:
    with pytest.raises(ModelError, match="is the word of Round already"):
        shapes().word("round")(Square)


def test_parts_that_share_a_parameter_declare_it_alike() -> None:
    @dataclass(frozen=True, kw_only=True)
    class Wide:
        side: Size = described(5.0, "side")

    allowed = "declares its parameter side differently from another part"
    with pytest.raises(ModelError, match=allowed):
        shapes().word("wide")(Wide)


def test_parts_with_tables_of_their_own_declare_what_they_like() -> None:
    parts: Parts[object] = Parts("shape", alike=False)

    @dataclass(frozen=True, kw_only=True)
    class Wide:
        side: Size = described(5.0, "side")

    parts.word("square")(Square)
    parts.word("wide")(Wide)
    assert parts.made("wide", SimpleNamespace(side=1.0)) == Wide(side=1.0)


ASKED = """
from solver.parts import Parts, own_files
import solver.parts
parts = solver.parts.SHAPES = Parts("shape")
print(*parts, *(path.name for path in own_files()))
"""
OWN = """
from dataclasses import dataclass
from solver.parts import SHAPES

assert not list(SHAPES)  # it may ask for parts while it runs

@SHAPES.word("oval")
@dataclass(frozen=True)
class Oval: ...
"""


def run(own: str) -> subprocess.CompletedProcess[str]:
    setting = os.environ | {"RESIDUA_PARTS": own}
    return subprocess.run(
        [sys.executable, "-c", ASKED], env=setting, capture_output=True, text=True, check=False
    )


@pytest.mark.processes
def test_a_file_of_ones_own_adds_its_parts(tmp_path: Path) -> None:
    own = tmp_path / "own.py"
    own.write_text(OWN)
    found = run(str(own))
    assert found.stdout.split() == ["oval", "own.py"], found.stderr


@pytest.mark.processes
@pytest.mark.parametrize(("text", "words"), [(None, "must name Python files"),
                                             ("1 / 0", "must run: division by zero")])  # fmt: skip
def test_a_file_that_cannot_be_run_is_named(tmp_path: Path, text: str | None, words: str) -> None:
    own = tmp_path / "own.py"
    if text is not None:
        own.write_text(text)
    found = run(str(own))
    assert f"RESIDUA_PARTS = '{own}': {words}" in found.stderr
