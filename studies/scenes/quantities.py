"""Numbers with a unit in the tables of a scene file: ``"195 GPa"``.

The type of an entry declares its unit (`annotated_types.Unit`); an entry without one takes plain
numbers only.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from types import UnionType
from typing import Annotated, Any, TypeAlias, Union, get_args, get_origin

from solver.parameters import is_number
from studies.errors import StudyError
from studies.scenes.refusals import Where, dotted
from studies.scenes.table import SceneTable, unit_in
from studies.scenes.tables import SceneFile
from studies.units import COHERENT, UnitError, converted, is_quantity, number_in, words_of

Visit: TypeAlias = Callable[[Where, str, str], Any]
"""Place, text and unit of an entry -> its new value."""
Options: TypeAlias = Sequence[tuple[Any, str | None]]
"""Types that a value may have, each with the unit of its numbers."""


def in_own_units(content: Mapping[str, Any]) -> Any:
    """Return a scene file with numbers in place of those with a unit, if it can be converted."""
    named = _named(content)

    def convert(where: Where, text: str, unit: str) -> Any:
        del where
        try:
            return _number(text, unit, named)
        except UnitError:
            return text

    return _visited((), content, [(SceneFile, None)], convert)


def wrong_units(content: Mapping[str, Any]) -> dict[Where, StudyError]:
    """Return the mistakes of numbers whose unit is not one of their entry, by place."""
    found: dict[Where, StudyError] = {}
    named = _named(content)

    def check(where: Where, text: str, unit: str) -> None:
        try:
            _number(text, unit, named)
        except UnitError as error:
            allowed = f"must be {number_in(unit)}; {error}"
            found[where] = StudyError(dotted(where), text, allowed)

    _visited((), content, [(SceneFile, None)], check)
    return found


def _named(content: Mapping[str, Any]) -> set[str]:
    """Return the names of parameters and of derived numbers."""
    tables = (content.get(key) for key in ("parameters", "derived"))
    return {str(name) for table in tables if isinstance(table, Mapping) for name in table}


def _number(text: str, unit: str, named: set[str]) -> float:
    """Return the number of a quantity; where any unit may stand, no name may be taken for one."""
    if unit == COHERENT and (both := sorted(words_of(text) & named)):
        raise UnitError(f"{both[0]} is the name of a number too: write ${both[0]} if it is meant")
    return converted(text, unit)


def _visited(where: Where, value: Any, options: Options, visit: Visit) -> Any:
    """Return a part of the file with what `visit` returns in place of numbers with a unit."""
    if not options:  # not known here
        return value
    if isinstance(value, str):
        unit = next((unit for _, unit in options if unit is not None), None)
        return visit(where, value, unit) if unit is not None and is_quantity(value) else value
    if isinstance(value, Mapping):
        return {
            key: each  # nothing is looked up for most entries
            if is_number(each)
            else _visited((*where, str(key)), each, _entry(options, value, key), visit)
            for key, each in value.items()
        }
    if isinstance(value, list | tuple) and not all(map(is_number, value)):
        return [
            _visited((*where, k), each, _item(options, k), visit) for k, each in enumerate(value)
        ]
    return value


def _entry(options: Options, table: Mapping[str, Any], key: str) -> Options:
    """Return what an entry of a table may be."""
    found: list[tuple[Any, str | None]] = []
    for option, _ in options:
        origin: Any = get_origin(option)
        if origin is dict:
            found += _options(get_args(option)[1], None)
        elif inspect.isclass(option) and issubclass(option, SceneTable):
            fields = option.model_fields
            kinds = get_args(fields["kind"].annotation) if "kind" in fields else ()
            if key in fields and (not kinds or table.get("kind") in kinds):
                hint: Any = fields[key].annotation
                found += _options(hint, option.unit_of(key, table))
    return found


def _item(options: Options, k: int) -> Options:
    """Return what an item of a list may be."""
    found: list[tuple[Any, str | None]] = []
    for option, unit in options:
        origin: Any = get_origin(option)
        if origin is tuple:
            first, *rest = get_args(option)
            each = first if rest == [...] else [first, *rest][min(k, len(rest))]
            found += _options(each, unit)
    return found


@cache
def _options(hint: Any, unit: str | None) -> Options:
    """Return the types that a value may have, each with the unit of its numbers."""
    if get_origin(hint) is Annotated:
        inner, *marks = get_args(hint)
        return _options(inner, unit_in(marks, unit))
    if get_origin(hint) in (Union, UnionType):
        return tuple(option for each in get_args(hint) for option in _options(each, unit))
    return ((hint, unit),)
