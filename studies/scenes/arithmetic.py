"""Arithmetic in scene files: ``"2*$radius"`` is a number once the parameters are known.

The grammar, from the loosest binding to the tightest; nothing else is evaluated::

    sum      = product (("+" | "-") product)*
    product  = signed (("*" | "/") signed)*
    signed   = ("+" | "-")* power
    power    = atom ("^" signed)?
    atom     = number | "$" name | "pi" | function "(" sum ("," sum)* ")" | "(" sum ")"
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from typing import Any, NoReturn

LONGEST = 200
"""Characters an expression may have."""
_DEEPEST = 20
"""Parentheses within each other."""

FUNCTIONS: Mapping[str, tuple[Callable[..., float], int]] = {
    "sqrt": (math.sqrt, 1),
    "exp": (math.exp, 1),
    "log": (math.log, 1),
    "abs": (abs, 1),
    "sin": (math.sin, 1),
    "cos": (math.cos, 1),
    "tan": (math.tan, 1),
    "asin": (math.asin, 1),
    "acos": (math.acos, 1),
    "atan": (math.atan, 1),
    "min": (min, 2),
    "max": (max, 2),
}
"""Name -> function, number of its arguments; angles are in radians."""

_TOKEN = re.compile(
    r"\s*(?:(?P<number>\d+(?:\.\d*)?(?:[eE][+-]?\d+)?|\.\d+(?:[eE][+-]?\d+)?)"
    r"|\$(?P<parameter>[A-Za-z_]\w*)|(?P<word>[A-Za-z_]\w*)|(?P<sign>[-+*/^(),]))",
    re.ASCII,
)
_PARAMETER = re.compile(r"\$([A-Za-z_]\w*)", re.ASCII)


class ExpressionError(ValueError):
    """An expression that makes no sense; the message says what is wrong with it."""


def is_expression(value: object) -> bool:
    """Tell whether a value of a table is to be evaluated: a text with a ``$``."""
    return isinstance(value, str) and "$" in value


def names(text: str) -> set[str]:
    """Return the parameters that an expression names."""
    return set(_PARAMETER.findall(text))


def evaluated(text: str, values: Mapping[str, Any]) -> Any:
    """Return the value of an expression.

    A text that is one parameter and nothing else, such as ``"$hardening"``, has its value, which
    may be a word or a truth value; all others are arithmetic.

    Parameters
    ----------
    values : of the parameters

    Raises
    ------
    ExpressionError
        where the text breaks the grammar, names an unknown parameter, or is no finite number
    """
    if len(text) > LONGEST:
        raise ExpressionError(f"must be at most {LONGEST} characters long")
    if whole := _PARAMETER.fullmatch(text):
        return _known(whole[1], values)
    try:
        number = _Reader(text, values).whole()
        if not math.isfinite(number):
            raise ExpressionError("must be a finite number")
    except ExpressionError:
        raise
    except (ArithmeticError, ValueError) as error:
        raise ExpressionError(f"has no value: {error}") from None
    return number


def _known(name: str, values: Mapping[str, Any]) -> Any:
    if name not in values:
        known = ", ".join(f"${each}" for each in values)
        raise ExpressionError(f"${name} is no parameter; the scene has {known or 'none'}")
    return values[name]


class _Reader:
    """Reads one expression from left to right, evaluating as it goes."""

    def __init__(self, text: str, values: Mapping[str, Any]) -> None:
        self._values = values
        self._tokens = list(_tokens(text))
        self._depth = 0

    def whole(self) -> float:
        number = self._sum()
        if self._tokens:
            self._refuse()
        return number

    def _refuse(self) -> NoReturn:
        if not self._tokens:
            raise ExpressionError("ends too early")
        raise ExpressionError(f"cannot be read from {self._tokens[0][1]!r} on")

    def _take(self, signs: str) -> str:
        """Return the next sign and go on, if it is one of these; else nothing."""
        if self._tokens and self._tokens[0][0] == "sign" and self._tokens[0][1] in signs:
            return self._tokens.pop(0)[1]
        return ""

    def _expect(self, sign: str) -> None:
        if not self._take(sign):
            self._refuse()

    def _sum(self) -> float:
        self._depth += 1
        if self._depth > _DEEPEST:
            raise ExpressionError(f"must have at most {_DEEPEST} parentheses within each other")
        number = self._product()
        while sign := self._take("+-"):
            other = self._product()
            number = number + other if sign == "+" else number - other
        self._depth -= 1
        return number

    def _product(self) -> float:
        number = self._signed()
        while sign := self._take("*/"):
            other = self._signed()
            number = number * other if sign == "*" else number / other
        return number

    def _signed(self) -> float:
        negative = False
        while sign := self._take("+-"):
            negative ^= sign == "-"
        number = self._power()
        return -number if negative else number

    def _power(self) -> float:
        number = self._atom()
        if self._take("^"):
            # floats: a power of whole numbers could have any number of digits
            return math.pow(number, self._signed())
        return number

    def _atom(self) -> float:
        if self._take("("):
            number = self._sum()
            self._expect(")")
            return number
        if not self._tokens or self._tokens[0][0] == "sign":
            self._refuse()
        kind, text = self._tokens[0]
        if kind == "word" and text != "pi" and text not in FUNCTIONS:
            known = ", ".join(("pi", *FUNCTIONS))
            raise ExpressionError(f"{text} is unknown: write ${text} for a parameter; {known}")
        del self._tokens[0]
        if kind == "number":
            return float(text) if set(text) & set(".eE") else int(text)
        if kind == "parameter":
            value = _known(text, self._values)
            if isinstance(value, bool) or not isinstance(value, int | float):
                raise ExpressionError(f"${text} is {value!r}: only numbers can be computed with")
            return value
        return math.pi if text == "pi" else self._call(text)

    def _call(self, name: str) -> float:
        function, count = FUNCTIONS[name]
        self._expect("(")
        given = [self._sum()]
        while self._take(","):
            given.append(self._sum())
        self._expect(")")
        if len(given) != count:
            raise ExpressionError(f"{name} takes {count} number(s), not {len(given)}")
        return function(*given)


def _tokens(text: str) -> list[tuple[str, str]]:
    found, at = [], 0
    while rest := text[at:].strip():
        token = _TOKEN.match(text, at)
        if token is None:
            raise ExpressionError(f"cannot be read from {rest!r} on")
        kind = str(token.lastgroup)
        found.append((kind, token[kind]))
        at = token.end()
    return found
