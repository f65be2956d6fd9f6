"""Numbers that are written with a unit, as ``195 GPa``, in the units of the project.

A unit is made of words, ``*`` or a space between them, ``/`` and powers of one digit: ``kN/mm^2``,
``N mm``, ``1/K``. pint knows the words; it computes with fractions, so that a number is the same as
if it were typed in the other unit. The unit radian counts, though an angle has no dimension: a
friction of ``30 deg`` and a speed of ``50 1/s`` in rad/s are refused.
"""

from __future__ import annotations

import math
import re
from fractions import Fraction
from functools import cache, lru_cache
from typing import Any

UNITLESS = ("", "1", "-")
"""Units of a number without one."""
COHERENT = "coherent"
"""In place of a unit: that of N, mm, MPa, t, s, K which has the dimension of what is written."""
LONGEST = 40
"""Largest number of characters of a number with its unit."""
_POWER = r"(?:\^?-?[1-9])?"
_WORD = rf"[A-Za-zµ°%]+{_POWER}"
_QUANTITY = re.compile(
    r"\s*(?P<number>[-+]?(?:[0-9]+\.?[0-9]*+|\.[0-9]++)(?:[eE][-+]?[0-9]{1,3})?+)"
    rf"(?P<unit>\s*+(?:/\s*+|(?<=\s)1\s*+/\s*+)?{_WORD})"
    rf"(?P<more>(?:(?:\s*+[*/]\s*+|\s++){_WORD})*)\s*"
)
"""A number with a unit; its number is as long as it can be: ``60e1`` has no unit."""
_PLAIN = str.maketrans({"²": "^2", "³": "^3", "·": "*", "μ": "µ"})
"""Other ways to write a unit; the last replaces the Greek letter by the sign."""
_WRITTEN_POWER = re.compile(r"(?<=[A-Za-zµ°%])\^?(?=-?[1-9])")
_KINDS = {
    "length": "mm", "area": "mm^2", "force": "N", "moment": "N mm", "stress": "MPa",
    "angle": "rad", "time": "s", "mass": "t", "temperature": "K", "speed": "mm/s",
    "angular speed": "rad/s", "acceleration": "mm/s^2", "density": "t/mm^3",
    "frequency": "1/s", "force per volume": "N/mm^3", "force per length": "N/mm",
    "curvature": "1/mm", "number": "1",
}  # fmt: skip


class UnitError(ValueError):
    """A number with a unit that cannot be converted; the message says why."""


def number_in(unit: str) -> str:
    """Return what an entry with a unit takes, in words."""
    if unit == COHERENT:
        return "a number, or one with a unit that N, mm, MPa, t, s, K have too"
    return "a number without unit" if unit in UNITLESS else f"a number in {unit}"


def is_quantity(value: object) -> bool:
    """Whether a value is a text of a number with a unit, such as ``195 GPa``."""
    return isinstance(value, str) and _matched(value) is not None


def words_of(text: str) -> set[str]:
    """Return the words in the unit of a quantity: N and mm of ``3 N mm``."""
    match = _matched(text)
    return set(re.findall(r"[A-Za-zµ°%]+", match["unit"] + match["more"])) if match else set()


def _matched(text: str) -> re.Match[str] | None:
    return _QUANTITY.fullmatch(text.translate(_PLAIN)) if len(text) <= LONGEST else None


def converted(text: str, unit: str) -> float:
    """Return the number of a quantity in a unit, an integer if it is whole.

    Raises
    ------
    UnitError
        if the text is no quantity, its unit is not known or has another dimension than ``unit``,
        or the number is too large
    """
    match = _matched(text)
    if not match:
        raise UnitError(f"a number with a unit has at most {LONGEST} characters, such as 195 GPa")
    given = (match["unit"] + match["more"]).strip()
    if unit == COHERENT:
        unit = _coherent(given)
    factor = _factor(given, "1" if unit in UNITLESS else unit)
    if isinstance(factor, str):
        raise UnitError(factor)
    try:
        number = float(Fraction(match["number"]) * factor)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise UnitError("it is not finite")
    return int(number) if number.is_integer() and abs(number) < 1e15 else number


def under(heading: str, number: float, unit: str) -> float:
    """Return a number of a column in a unit; the unit of the heading is another one or the same.

    Raises
    ------
    UnitError
        if the unit of the heading is not known or has another dimension
    """
    if heading == unit or {heading, unit} <= {*UNITLESS}:
        return number
    return converted(f"{float(number)!r} {heading}", unit)


@cache
def _registry() -> Any:
    """Return the units that pint knows, with fractions as numbers; loading them takes 0.5 s."""
    import pint

    return pint.UnitRegistry(non_int_type=Fraction)


@lru_cache(maxsize=256)
def _factor(given: str, wanted: str) -> Fraction | str:
    """Return the number that multiplies one in a given unit, or why there is none."""
    try:
        factor, roots = _roots(given)
    except UnitError as error:
        return str(error)
    try:
        own, wanted_roots = _roots(wanted)
    except UnitError as error:
        return f"its own unit cannot be converted: {error}"
    if roots != wanted_roots:
        return f"{given} is {_kind(roots)}"
    if factor is None or own is None:
        return f"{given} has a zero of its own; write a difference of temperature in K"
    return factor / own


def _roots(text: str) -> tuple[Fraction | None, Any]:
    """Return a unit as a multiple of units that others are made of, radian among them.

    A scale with a zero of its own, as of degrees Celsius, is no multiple: None.
    """
    import pint

    if text == "1":
        return Fraction(1), _registry().UnitsContainer()
    if not (match := _matched(f"1 {text}")):
        raise UnitError(f"{text} is no unit")
    plain = (match["unit"] + match["more"]).strip()
    written = re.sub(r"\s*([*/])\s*|\s+", lambda sign: sign[1] or "*", plain)
    written = _WRITTEN_POWER.sub("**", f"1{written}" if written.startswith("/") else written)
    known = _registry()
    try:
        unit = known.parse_units(written)
        factor, roots = known.get_root_units(unit)
    except (pint.PintError, ValueError):  # ValueError for the word nan
        raise UnitError(f"{text} is no known unit") from None
    try:
        multiple = known.convert(Fraction(0), unit, roots) == 0
    except TypeError:  # a logarithm
        multiple = False
    return Fraction(factor) if multiple else None, roots


def _coherent(given: str) -> str:
    """Return the unit of the project for what has a unit.

    An angle has none: it is in degrees in a scene file, and in radians in its functions.
    """
    roots = _roots(given)[1]
    found = (unit for name, unit in _KINDS.items() if _roots(unit)[1] == roots and name != "angle")
    unit = next(found, None)
    if unit is None:
        raise UnitError(f"{given} is {_kind(roots)}")
    return unit


@lru_cache(maxsize=256)
def _kind(roots: Any) -> str:
    """Return what has a unit: ``a length``."""
    for name, usual in _KINDS.items():
        if _roots(usual)[1] == roots:
            return f"{'an' if name[0] in 'aeiou' else 'a'} {name}"
    return "something else"
