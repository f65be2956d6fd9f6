"""The numbers of a study's runs as columns: sorted, filtered, written.

A service makes the table from its catalogue, while the study runs; `studies.views.best` makes
that of a data set.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from solver.results.quantities import QUANTITIES
from solver.scenes import Scene
from studies.definition.quantity import CONDITION
from studies.definition.vocabulary import STATUSES
from studies.errors import StudyError, nearest, one_of
from studies.storage.dataset import attributes_of
from studies.views.columns import unit_text

Compare = Callable[[Any, Any], Any]
_COMPARED: Mapping[str, Compare] = {
    "<=": operator.le, ">=": operator.ge, "!=": operator.ne, "<": operator.lt, ">": operator.gt,
    "=": operator.eq,
}  # fmt: skip

SAME = 1e-9
"""Relative difference below which a number is the one that a query names."""

MOST_VALUES = 100
"""Largest number of numbers that a query names of a column."""

RANGE = re.compile(r"(?P<low>[^.]*(?:\.\d[^.]*)?)\.\.(?P<high>.*)", re.DOTALL)

NUMBERS = ("result", "effort", "audit")
"""Groups of columns with the numbers of runs, the main ones first."""

STATUS, RUN, MESSAGE = "status", "run", "message"


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """One column of a table.

    Attributes
    ----------
    name, words, unit : name, meaning and unit
    group : ``sweep``, ``run``, or one of `NUMBERS`
    flags : meanings of its numbers, if they stand for words
    values : numbers, NaN where there is none, or texts, for each run
    """

    name: str
    words: str
    unit: str
    group: str
    flags: Mapping[int, str]
    values: np.ndarray

    @property
    def number(self) -> bool:
        """Whether it has numbers."""
        return self.values.dtype.kind == "f"

    @property
    def said(self) -> list[Any]:
        """Its values in words."""
        words = {float(code): word for code, word in self.flags.items()}
        return [words.get(each, each) for each in self.values.tolist()]

    def parts(self, condition: str) -> list[str]:
        """Return the values that a condition names: one, also with a comma in it, or several."""
        several = "," in condition and condition not in self.said
        return [each.strip() for each in (condition.split(",") if several else [condition])]

    @property
    def whole(self) -> bool:
        """Whether its numbers are counts."""
        quantity = QUANTITIES.get(self.name)
        return quantity is not None and quantity.count and not self.flags


@dataclass(frozen=True, slots=True, kw_only=True)
class RunTable:
    """The runs of a study in the order of its cases.

    Attributes
    ----------
    axes : name of each axis of the sweep, with its values or labels; the last runs fastest
    columns : all columns by name: the sweep, status, numbers, audit, id, message
    wide : dimensions of each variable with more than a number a run, which is no column
    """

    axes: Mapping[str, Sequence[Any]]
    columns: Mapping[str, Column]
    wide: Mapping[str, Sequence[str]] = field(default_factory=dict)

    @property
    def size(self) -> int:
        """Number of runs."""
        return len(next(iter(self.columns.values())).values)

    @property
    def numbers(self) -> list[Column]:
        """The columns of results that are numbers."""
        every = self.columns.values()
        return [each for each in every if each.number and each.group in NUMBERS]

    def column(self, name: str, field: str = "columns") -> Column:
        """Return a column; raise `StudyError` if there is none of this name."""
        if name not in self.columns:
            raise StudyError(field, name, one_number(name, self.columns, self.wide))
        return self.columns[name]

    def chosen(self, sort: str = "", where: Mapping[str, str] | None = None) -> np.ndarray:
        """Return the positions of the runs that meet all conditions, in order.

        Parameters
        ----------
        sort : name of a column; with a minus before it, the largest first. Runs without a value
            come last
        where : a condition by column: a value, several with commas between, or a range ``0.1..0.4``

        Raises
        ------
        StudyError
            if there is no such column, or it has numbers and the condition none
        """
        keep = np.ones(self.size, dtype=bool)
        for name, condition in (where or {}).items():
            keep &= _meets(self.column(name, name), "=", condition)
        found = np.flatnonzero(keep)
        if not sort:
            return found
        column = self.column(sort.removeprefix("-"), "sort")
        values = column.values[found]
        if not column.number:
            _, values = np.unique(values.astype(str), return_inverse=True)
            values = values.astype(float)
        return found[np.argsort(-values if sort.startswith("-") else values, kind="stable")]

    def meeting(self, condition: str) -> np.ndarray:
        """Return which runs meet a condition such as ``"friction<0.3"`` or ``"hardening=none"``.

        Raises
        ------
        StudyError
            if it is no condition, there is no such column, the two cannot be compared, or it names
            a word that no run has; a status that no run has is one all the same
        """
        match = CONDITION.fullmatch(condition)
        if match is None:
            allowed = "must be NAME<VALUE, with <, <=, >, >=, = or !="
            raise StudyError("where", condition, allowed)
        if match["name"] not in self.columns:
            allowed = one_number(match["name"], self.columns, self.wide)
            raise StudyError("where", condition, allowed)
        column, sign, value = self.columns[match["name"]], match["sign"], match["value"]
        if not (column.number or sign in {"=", "!="}):
            allowed = f"{column.name} has words: compare them by = or !="
            raise StudyError("where", condition, allowed)
        known = dict.fromkeys([*column.said, *(STATUSES if column.name == STATUS else ())])
        if not column.number and (missing := [e for e in column.parts(value) if e not in known]):
            raise StudyError("where", condition, f"{missing[0]!r} {one_of(missing[0], known)}")
        try:
            return _meets(column, sign, value)
        except StudyError as error:
            raise StudyError("where", condition, f"{value!r} {error.allowed}") from None


def one_number(name: str, known: Iterable[str], wide: Mapping[str, Sequence[str]]) -> str:
    """Return what is allowed in place of a variable that is none of the ``known``.

    Those of ``wide`` have more than a number a run: then it tells their dimensions.
    """
    if name not in wide:
        return one_of(name, known, "residua table lists all")
    over = f"{name} is over {', '.join(wide[name])}"
    return f"{over}: must be a variable with one number a run{nearest(name, known)}"


def varied(table: RunTable) -> list[Column]:
    """Return the columns of the sweep that are not the same in all runs."""
    sweep = [each for each in table.columns.values() if each.group == "sweep"]
    several = [each for each in sweep if len(set(each.values.tolist())) > 1]
    return several or sweep


def column_of(
    name: str,
    values: np.ndarray,
    group: str,
    scene: Scene | None = None,
    words: Mapping[str, Any] | None = None,
) -> Column:
    """Return a column of a variable, with its meaning and unit as a data set has them.

    Parameters
    ----------
    scene : declares quantities of its own
    words : attributes, in place of those of the variable
    """
    attributes = attributes_of(name, scene) if words is None else words
    quantity = QUANTITIES.get(name)
    meanings = quantity.flags if quantity else None
    return Column(
        name=name,
        words=str(attributes.get("long_name", name.replace("_", " "))),
        unit=unit_text(attributes.get("units")),
        group=group,
        flags={flag.value: flag.name.lower() for flag in meanings} if meanings else {},
        values=values,
    )


def _meets(column: Column, sign: str, condition: str) -> np.ndarray:
    """Return which runs meet a condition: one of several values, or the range ``low..high``."""
    codes = {word: code for code, word in column.flags.items()}
    compared, parts = _COMPARED[sign], column.parts(condition)
    if not column.number or (codes and sign in {"=", "!="} and not codes.keys().isdisjoint(parts)):
        met = np.array([each in parts for each in column.said], dtype=bool)
        return met if sign == "=" else ~met
    if sign not in {"=", "!="}:
        return _against(column, compared, condition, condition)
    if match := RANGE.fullmatch(condition):
        met = ~np.isnan(column.values)
        for end, ends in (("low", operator.ge), ("high", operator.le)):
            if match[end].strip():
                met &= _against(column, ends, match[end], condition)
    elif len(parts) > MOST_VALUES:
        allowed = f"must be at most {MOST_VALUES} numbers, or a range such as 0.1..0.4"
        raise StudyError(column.name, f"{len(parts)} numbers", allowed)
    else:
        every = [_against(column, operator.eq, each, condition) for each in parts]
        met = np.any(every, axis=0)
    return met if sign == "=" else ~met


def _against(column: Column, compared: Compare, text: str, condition: str) -> np.ndarray:
    """Return which numbers of a column compare so with that of a text, up to `SAME`."""
    codes = {word: float(code) for code, word in column.flags.items()}
    try:
        value = codes[text] if text in codes else float(text)
    except ValueError:
        numbers = "must be a number, several with commas between, or a range such as 0.1..0.4"
        allowed = one_of(text, codes) if codes else numbers
        raise StudyError(column.name, condition, allowed) from None
    same = np.isclose(column.values, value, rtol=SAME, atol=0.0)
    return np.asarray(compared(np.where(same, value, column.values), value))
