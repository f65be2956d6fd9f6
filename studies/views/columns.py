"""Text in aligned columns, under stacked headings, in blocks that fit a terminal."""

from __future__ import annotations

import json
import math
import re
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from studies.numbers import number_text

_HEADING = 9
"""Largest width of a heading in characters; longer ones continue in the next line."""
_WIDTH = 120
"""Largest width of a table in characters; wider ones continue below, with the axes repeated."""
_GAP = "  "
_PLACE = re.compile(r"(?P<of>peak_\w+)_(?P<axis>[sxyz])")
"""Names of places of largest values."""


def value_text(value: Any) -> str:
    """Return a value as text: numbers with four digits, NaN as "-", lists by `counted`."""
    if isinstance(value, bool):
        return json.dumps(value)
    if isinstance(value, float | np.floating):
        return number_text(float(value))
    return "-" if value is None else counted(value)


COMPUTED = "computed_"
"""Begins the name of a variable that holds what a run was computed with, before its parameter."""


def computed_text(value: Any, own: str) -> Any:
    """Return a parameter as given, with what the run was computed with if that is another."""
    return f"{value}, computed with {own}" if own and own != value else value


def or_none(value: Any) -> Any:
    """Return a value as JSON has it: None for NaN and infinity."""
    value = value.item() if isinstance(value, np.generic) else value
    return None if isinstance(value, float) and not math.isfinite(value) else value


def unit_text(unit: Any) -> str:
    """Return a unit as text: that of a ratio, 1, is empty, and so is None."""
    return "" if unit in (None, "1") else str(unit)


def unit_of(variable: Any) -> str:
    """Return the unit of a variable as text."""
    return unit_text(variable.attrs.get("units"))


def meaning_of(variable: Any) -> str:
    """Return what a variable is; by default its name in words."""
    return str(variable.attrs.get("long_name", str(variable.name).replace("_", " ")))


def with_unit(text: str, unit: str) -> str:
    """Return a text with a unit behind it, if there is one: ``pressure [MPa]``."""
    return f"{text} [{unit}]".lstrip() if unit else text


def placed(place: Mapping[str, Any]) -> str:
    """Return the place of a run in words."""
    return ", ".join(f"{name} = {value_text(value)}" for name, value in place.items())


def counted(value: Any) -> str:
    """Return a list of points or tables, or the JSON of one, as their number; other text as is."""
    text = str(value)
    if text == "[]":
        return "none"
    if text.startswith("[[["):  # points, elements and lines of a section
        return "a mesh"
    if text.startswith("[["):
        return f"{text.count('[') - 1} points"
    return f"{text.count('{')} tables" if text.startswith("[{") else text


def stacked(headings: Sequence[str]) -> list[list[str]]:
    """Return the lines of wrapped headings, which are aligned at the bottom."""
    parts = [textwrap.wrap(text, _HEADING, break_long_words=False) for text in headings]
    deepest = max(map(len, parts))
    return [
        list(line) for line in zip(*([""] * (deepest - len(p)) + p for p in parts), strict=True)
    ]


def in_blocks(lines: Sequence[Sequence[str]], keys: int, right: int) -> str:
    """Return a table in blocks that fit the terminal, each with the first `keys` columns.

    The first `right` columns are set flush left, the others flush right.
    """
    widths = _widths(lines)
    blocks = [list(range(keys))]
    for column in range(keys, len(widths)):
        needed = sum(widths[i] + len(_GAP) for i in blocks[-1]) + widths[column]
        if needed > _WIDTH and len(blocks[-1]) > keys:
            blocks.append(list(range(keys)))
        blocks[-1].append(column)
    return "\n\n".join(
        aligned([[line[i] for i in block] for line in lines], sum(i < right for i in block))
        for block in blocks
    )


def _widths(lines: Sequence[Sequence[str]]) -> list[int]:
    return [max(len(line[i]) for line in lines) for i in range(len(lines[0]))]


def aligned(lines: Sequence[Sequence[str]], right: int | None = None) -> str:
    """Return columns as wide as their widest entry, flush right from column `right` on."""
    widths = _widths(lines)
    first = len(widths) if right is None else right
    return "\n".join(
        _GAP.join(
            cell.rjust(width) if i >= first else cell.ljust(width)
            for i, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in lines
    )


def words(name: str) -> str:
    """Return a name in words; the place of a peak, such as ``peak_pressure_s``, is named first."""
    if place := _PLACE.fullmatch(name):
        name = f"{place['axis']} of {place['of']}"
    return name.replace("_", " ")
