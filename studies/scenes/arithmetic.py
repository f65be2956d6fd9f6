"""Arithmetic in scene files: ``"2*$radius"`` is a number once the parameters are known.

An expression has numbers, parameters (``$name``), ``pi``, ``+ - * / ^``, parentheses and the
functions of `FUNCTIONS`. Two of them compared, ``"$gap < 2*$radius"``, are true or false. Python's
own parser reads it; nothing else of Python is evaluated.
"""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable, Mapping
from typing import Any

LONGEST = 200
"""Characters an expression may have."""

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

_OPERATORS: Mapping[type[ast.AST], Callable[..., float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: math.pow,  # floats: a power of whole numbers could have any number of digits
    ast.UAdd: operator.pos,
    ast.USub: operator.neg,
}
_COMPARISONS: Mapping[type[ast.AST], Callable[[float, float], bool]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}
_PARAMETER = re.compile(r"\$([A-Za-z_]\w*)", re.ASCII)
_MARK = "parameter__"
"""What stands for ``$`` where Python reads the text."""
_FOREIGN = re.compile(rf"\*\*|//|{_MARK}|[^\w\s$.,()*/^+<>=-]", re.ASCII)


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
    may be a word or a truth value; a comparison is true or false; all others are arithmetic.

    Parameters
    ----------
    values : of the parameters

    Raises
    ------
    ExpressionError
        where the text is no arithmetic, names an unknown parameter, or is no finite number
    """
    if len(text) > LONGEST:
        raise ExpressionError(f"must be at most {LONGEST} characters long")
    if whole := _PARAMETER.fullmatch(text):
        return _known(whole[1], values)
    try:
        read = _read(text)
        if isinstance(read, ast.Compare):
            return _compared(read, values)
        number = _value(read, values)
        if not math.isfinite(number):
            raise ExpressionError("must be a finite number")
    except ExpressionError:
        raise
    except (ArithmeticError, ValueError) as error:
        raise ExpressionError(f"has no value: {error}") from None
    return number


def _read(text: str) -> ast.expr:
    if found := _FOREIGN.search(text):
        raise ExpressionError(f"cannot be read from {text[found.start() :]!r} on")
    python = _PARAMETER.sub(rf" {_MARK}\1 ", text).replace("^", "**")
    try:
        return ast.parse(" ".join(python.split()), mode="eval").body
    except SyntaxError:
        allowed = f"numbers, $parameters, pi, + - * / ^ ( ) and {', '.join(FUNCTIONS)}"
        raise ExpressionError(f"cannot be read as arithmetic: {allowed}") from None


def _compared(node: ast.Compare, values: Mapping[str, Any]) -> bool:
    """Return whether a comparison of numbers holds."""
    test = _COMPARISONS.get(type(node.ops[0]))
    if len(node.ops) != 1 or test is None:
        raise ExpressionError("must compare two numbers by one of <, <=, >, >=")
    return test(_value(node.left, values), _value(node.comparators[0], values))


def _value(node: ast.expr, values: Mapping[str, Any]) -> float:
    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return number
        case ast.Name(id="pi"):
            return math.pi
        case ast.Name(id=name) if name.startswith(_MARK):
            name = name.removeprefix(_MARK)
            value = _known(name, values)
            if isinstance(value, bool) or not isinstance(value, int | float):
                raise ExpressionError(f"${name} is {value!r}: only numbers can be computed with")
            return value
        case ast.UnaryOp(op=sign, operand=one) if type(sign) in _OPERATORS:
            return _OPERATORS[type(sign)](_value(one, values))
        case ast.BinOp(left=one, op=sign, right=other) if type(sign) in _OPERATORS:
            return _OPERATORS[type(sign)](_value(one, values), _value(other, values))
        case ast.Call(func=ast.Name(id=name), args=given, keywords=[]) if name in FUNCTIONS:
            function, count = FUNCTIONS[name]
            if len(given) != count:
                raise ExpressionError(f"{name} takes {count} number(s), not {len(given)}")
            return function(*(_value(each, values) for each in given))
        case ast.Name(id=name) | ast.Call(func=ast.Name(id=name)):
            known = ", ".join(("pi", *FUNCTIONS))
            raise ExpressionError(f"{name} is unknown: write ${name} for a parameter; {known}")
    text = ast.unparse(node).replace(_MARK, "$")
    raise ExpressionError(f"{text} cannot be read as arithmetic")


def _known(name: str, values: Mapping[str, Any]) -> Any:
    if name not in values:
        known = ", ".join(f"${each}" for each in values)
        raise ExpressionError(f"${name} is no parameter; the scene has {known or 'none'}")
    return values[name]
