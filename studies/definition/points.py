"""An axis of points: each has a number, from 0 on, and sets several parameters.

Points are a list of tables. A file of points and a sample are other ways to write this list. Those
of the entries ``points`` and ``sample`` of a study are the axis ``point``; an axis of points in the
sweep has any name that is no parameter.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from contextlib import suppress
from typing import Any, TypeGuard

from solver.parameters import is_number
from studies.definition.parameters import Parameter, of_material
from studies.definition.sampling import METHOD, Sample
from studies.definition.schema import Context, filled, is_finite, known_name, parsed
from studies.errors import Mistakes, StudyError
from studies.toml import CASE
from studies.units import UnitError, number_in, under

POINT = "point"
"""Name of the axis of the entries ``points`` and ``sample``."""

Points = list[dict[str, Any]]

ENTRIES = ("points", "sample")
"""Entries of a study that say what its axis `POINT` is."""
_HEADING = re.compile(r"(?P<name>[^\[\]]+?)\s*\[(?P<unit>[^\[\]]*)\]")
_NUMBER = re.compile(
    r"[+-]?(?:[0-9]+(?P<part>\.[0-9]*)?|(?P<dot>\.[0-9]+))(?P<power>[eE][+-]?[0-9]+)?"
)
_LONGEST_CASE = 80
_TRUTH = {"true": True, "false": False}
_LONGEST_NUMBER = 1000
"""Largest length of a text that is an integer: Python takes none of many thousand digits."""


def is_points(axis: Any) -> TypeGuard[Points]:
    """Whether a normalised axis has points: no parameter has tables as values."""
    return isinstance(axis, list) and isinstance(axis[0], dict)


def describes_points(name: Any, content: Any) -> bool:
    """Whether an axis that is no parameter is one of points: a list of tables, a file, a sample."""
    if isinstance(content, Mapping):
        return any(isinstance(content.get(key), str) for key in ("file", METHOD))
    tables = isinstance(content, list | tuple) and any(
        isinstance(each, Mapping) for each in content
    )
    return name == POINT or tables


def field_of(axis: str) -> str:
    """Return the field of a study that has the points of an axis."""
    return "points" if axis == POINT else f"sweep.{axis}"


def checked_points(content: Any, context: Context) -> Points:
    """Return the points of an axis, normalised: all with the same parameters, in their order.

    A parameter that one point sets and another leaves out has the scene's default there. The key of
    numbers may tell their unit, as in ``"radius [mm]"``: they are converted. A table
    may have a `CASE`, if all have one.

    Raises
    ------
    StudyError
        for any mistake except in combinations of parameters, which are checked run by run
    """
    known = context.known
    if isinstance(content, Mapping) and METHOD in content:
        content = parsed(Sample, content, context).points
    if isinstance(content, Mapping) and "file" in content:
        allowed = "names a file, which only a study file can: give the points themselves"
        raise StudyError("", dict(content), allowed)
    if not isinstance(content, list | tuple) or not content:
        raise StudyError("", content, "must be a list of points, each a table of parameters")
    headings: dict[Any, tuple[str, str]] = {}
    given, wrong = list[dict[str, Any]](), Mistakes()
    for k, each in enumerate(content):
        with wrong.at(f"[{k}]"):
            given.append(_point(each, known, headings))
    wrong.report()
    if not any(point.keys() - {CASE} for point in given):
        raise StudyError("", content[0], f"must set a parameter: one of {', '.join(known)}")
    points = filled(dict(enumerate(given)), known)
    if not any(CASE in point for point in given):
        return [*points.values()]
    cases: dict[Any, int] = {}
    for k, point in enumerate(given):
        first = cases.setdefault(point.get(CASE), k)
        if CASE not in point or first != k:
            what = f"names point {first} too" if CASE in point else "must be given for all points"
            wrong.add("", StudyError(f"[{k}].{CASE}", point.get(CASE), what))
    wrong.report()
    return [{CASE: given[k][CASE]} | point for k, point in points.items()]


def _point(
    content: Any, known: Mapping[str, Parameter], headings: dict[Any, tuple[str, str]]
) -> dict[str, Any]:
    """Return the parameters that a point sets, normalised, and its case."""
    if not isinstance(content, Mapping):
        raise StudyError("", content, "must be a table of parameters")
    point, wrong = dict[str, Any](), Mistakes()
    material, content = of_material(content, known, wrong)
    for key, value in content.items():
        with wrong.at():
            if key not in headings:
                headings[key] = _heading(key, known)
            name, unit = headings[key]
            if name in point:
                raise StudyError(str(key), value, f"{name} is given twice")
            if name == CASE:
                point[name] = _case(value)
            else:
                point[name] = _value(name, value, known[name], unit)
    wrong.report()
    return material | point


def _value(field: str, value: Any, parameter: Parameter, unit: str) -> Any:
    """Return the value of a parameter, normalised; a cell of a file is a text.

    A number is one in `unit`.

    A text is a number or a truth value if it is written so and the parameter takes it. Other texts
    are words: ``60e1`` is one of ``rail_profile``, and no number.
    """
    plain = _plain(value) if isinstance(value, str) else value
    if unit != parameter.unit and is_finite(plain):
        return parameter.normalise(under(unit, plain, parameter.unit), field)
    if isinstance(value, str) and plain is not None:
        if parameter.whole and isinstance(plain, float) and plain.is_integer():
            plain = int(plain)  # as a spreadsheet writes it: 2.0
        with suppress(StudyError):
            return parameter.normalise(plain, field)
    return parameter.normalise(value, field)


def _plain(text: str) -> float | bool | None:
    """Return the number or truth value that a text is; None if it is a word."""
    if text in _TRUTH:
        return _TRUTH[text]
    if not (number := _NUMBER.fullmatch(text)):
        return None
    whole = not any(number.groups()) and len(text) <= _LONGEST_NUMBER
    return int(text) if whole else float(text)


def _heading(key: Any, known: Mapping[str, Parameter]) -> tuple[str, str]:
    """Return the parameter of a key such as ``"radius [mm]"``, and the unit of its numbers."""
    heading = _HEADING.fullmatch(key) if isinstance(key, str) else None
    name = heading["name"] if heading else key
    if name == CASE and not heading:
        return CASE, ""
    wrong = Mistakes()
    with wrong.at(str(name)):
        known_name(name, known, key)
        own = known[name].unit
        unit = heading["unit"].strip() if heading else own
        try:
            under(unit, 1.0, own)
        except UnitError as error:
            raise StudyError("", key, f"must be {number_in(own)}; {error}") from None
    wrong.report()
    return name, unit


def _case(value: Any) -> str:
    """Return the name of a point; a number is text."""
    text = str(value) if is_number(value) else value
    if isinstance(text, str) and text.isprintable() and 0 < len(text) <= _LONGEST_CASE:
        return text
    raise StudyError(CASE, value, f"must be a text of 1 to {_LONGEST_CASE} letters")
