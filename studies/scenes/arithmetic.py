"""Arithmetic in scene files: ``"2*$radius"`` is a number once the parameters are known.

An expression has numbers, words (``'ball'``), parameters (``$name``), ``pi``, ``+ - * / ^``,
parentheses and the functions of `FUNCTIONS`. Two numbers compared, ``"$gap < 2*$radius"``, or two
words, ``"$yielding == 'ball'"``, are true or false; such conditions are joined by ``and``, ``or``
and ``not``, and ``if(condition, one, other)`` chooses between two values. An expression with ``x``
or ``y``, the position, is a `Field`: ``"$p*(1 - (x/$a)^2)"``. Python's own parser reads it; nothing
else of Python is evaluated.
"""

from __future__ import annotations

import ast
import copy
import math
import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solver.parameters import is_number

LONGEST = 200
"""Largest number of characters of an expression."""

LONGEST_FIELD = 20 * LONGEST
"""Largest number of characters of a field, which has values in place of the parameters."""

DEEPEST = 50
"""Largest number of operations and parentheses inside one another."""

FUNCTIONS: Mapping[str, tuple[Callable[..., float], int]] = {
    "sqrt": (math.sqrt, 1),
    "exp": (math.exp, 1),
    "log": (math.log, 1),
    "abs": (abs, 1),
    "round": (round, 1),
    "sin": (math.sin, 1),
    "cos": (math.cos, 1),
    "tan": (math.tan, 1),
    "asin": (math.asin, 1),
    "acos": (math.acos, 1),
    "atan": (math.atan, 1),
    "min": (min, 2),
    "max": (max, 2),
}
"""Name -> function and number of its arguments; angles are in radians."""

_ON_FIELDS: Mapping[str, Callable[..., Any]] = {
    name: getattr(np, {"min": "minimum", "max": "maximum"}.get(name, name)) for name in FUNCTIONS
}
"""The same functions for fields; a number that they do not have is nan or infinite."""

POSITION = ("x", "y")
"""Names of the coordinates [mm]."""


def _power(base: Any, exponent: Any) -> Any:
    """Return a power of floats: that of whole numbers could have any number of digits."""
    fields = isinstance(base, np.ndarray) or isinstance(exponent, np.ndarray)
    return np.float_power(base, exponent) if fields else math.pow(base, exponent)


_OPERATORS: Mapping[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: _power,
    ast.UAdd: operator.pos,
    ast.USub: operator.neg,
}
_COMPARISONS: Mapping[type[ast.AST], Callable[[Any, Any], bool]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}
_EQUALITY = (ast.Eq, ast.NotEq)
_PARAMETER = re.compile(r"\$([A-Za-z_]\w*)", re.ASCII)
_WORD = re.compile(r"'[A-Za-z0-9_ .-]*'", re.ASCII)
_CHOICE = re.compile(r"\bif\s*\(", re.ASCII)
_MARK, _IF = "parameter__", "if__"
"""Names that replace ``$`` and ``if`` in the text that Python parses."""
_FOREIGN = re.compile(rf"\*\*|//|{_MARK}|{_IF}|[^\w\s$.,()*/^+<>=!-]", re.ASCII)
"""What an expression must not contain outside of words."""


class ExpressionError(ValueError):
    """An expression that has no value; the message says why."""


@dataclass(frozen=True, slots=True)
class Field:
    """A function of position (2, n) [mm] -> (n,), written as an expression of ``x`` and ``y``.

    Attributes
    ----------
    text : the expression, without parameters

    Raises
    ------
    ExpressionError
        if the text cannot be read, or is no number
    """

    text: str

    def __post_init__(self) -> None:
        if len(self.text) > LONGEST_FIELD:
            raise ExpressionError(f"must be at most {LONGEST_FIELD} characters long")
        self(np.zeros((2, 1)))

    def __call__(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the values (n,) at positions (2, n)."""
        with np.errstate(all="ignore"):  # what has no value somewhere is refused where it is used
            try:
                value = _operand(_read(self.text), dict(enumerate(x)))
            except ExpressionError:
                raise
            except (ArithmeticError, ValueError) as error:
                raise ExpressionError(f"has no value: {error}") from None
        return np.broadcast_to(np.asarray(value, dtype=float), x.shape[1:])


def is_expression(value: object) -> bool:
    """Tell whether a value of a table is an expression: a text with a ``$``."""
    return isinstance(value, str) and "$" in value


def names(text: str) -> set[str]:
    """Return the parameters that an expression names."""
    return set(_PARAMETER.findall(text))


def evaluated(text: str, values: Mapping[str, Any]) -> Any:
    """Return the value of an expression: a number, a word, or true or false.

    The value of a text that is one parameter, such as ``"$hardening"``, is that of the parameter.
    The value of an expression of the position is a text without parameters, which `Field` reads.

    Parameters
    ----------
    values : values of the parameters

    Raises
    ------
    ExpressionError
        if the text cannot be read, names an unknown parameter, or is no finite number
    """
    if len(text) > LONGEST:
        raise ExpressionError(f"must be at most {LONGEST} characters long")
    if whole := _PARAMETER.fullmatch(text):
        return _known(whole[1], values)
    try:
        tree = _read(text)
        if any(_is_position(node) for node in ast.walk(tree)):
            return Field(_text(_Bound(values).visit(copy.deepcopy(tree)))).text
        value = _value(tree, values)
        if is_number(value) and not math.isfinite(value):
            raise ExpressionError("must be a finite number")
    except ExpressionError:
        raise
    except (ArithmeticError, ValueError) as error:
        raise ExpressionError(f"has no value: {error}") from None
    return value


@lru_cache(maxsize=1024)
def _read(text: str) -> ast.expr:
    """Return the syntax tree of an expression."""
    bare = _WORD.sub(lambda word: " " * len(word[0]), text)
    if found := _FOREIGN.search(bare):
        hint = ": a power is written with ^" if found[0] == "**" else ""
        raise ExpressionError(f"cannot be read from {text[found.start() :]!r} on{hint}")
    python = _PARAMETER.sub(rf" {_MARK}\1 ", text).replace("^", "**")
    python = _CHOICE.sub(f"{_IF}(", python)
    try:
        tree = ast.parse(" ".join(python.split()), mode="eval").body
        if _depth(tree) > DEEPEST:
            raise RecursionError
        return tree
    except (RecursionError, MemoryError):
        raise ExpressionError(
            f"must have at most {DEEPEST} operations inside one another: use derived parameters"
        ) from None
    except SyntaxError:
        allowed = (
            "numbers, 'words', $parameters, pi, + - * / ^ ( ), < <= > >= == !=, and, or, not, "
            f"if(condition, one, other) and {', '.join(FUNCTIONS)}"
        )
        raise ExpressionError(f"cannot be read as arithmetic: {allowed}") from None


def _depth(tree: ast.AST) -> int:
    """Return how many operations are inside one another."""
    found, level = 0, [tree]
    while level := [each for node in level for each in ast.iter_child_nodes(node)]:
        found += 1
    return found


def _value(node: ast.expr, values: Mapping[Any, Any]) -> Any:
    """Return the value of a node: a number, a word, or true or false."""
    match node:
        case ast.Constant(value=str() as word):
            return word
        case ast.Name(id=name) if name.startswith(_MARK):
            return _known(name.removeprefix(_MARK), values)
        case ast.Compare():
            return _compared(node, values)
        case ast.BoolOp(op=sign, values=each):
            both = isinstance(sign, ast.And)
            found: Any = both
            for one in each:
                if found is not both and isinstance(found, bool):
                    break
                other = _condition(one, values)
                found = found & other if both else found | other
            return found
        case ast.UnaryOp(op=ast.Not(), operand=one):
            return True ^ _condition(one, values)
        case ast.Call(func=ast.Name(id=name), args=given, keywords=[]) if name == _IF:
            if len(given) != 3:
                raise ExpressionError(f"if takes a condition and two values, not {len(given)}")
            test, one, other = given
            holds = _condition(test, values)
            if isinstance(holds, np.ndarray):
                return np.where(holds, _operand(one, values), _operand(other, values))
            return _value(one if holds else other, values)
    return _number(node, values)


def _compared(node: ast.Compare, values: Mapping[Any, Any]) -> Any:
    """Tell whether a comparison of two numbers or two words is true."""
    if len(node.ops) != 1 or type(node.ops[0]) not in _COMPARISONS:
        raise ExpressionError(
            "must compare two values by one of <, <=, >, >=, ==, !=; join more by and, or"
        )
    one, other = (_value(each, values) for each in (node.left, node.comparators[0]))
    alike = isinstance(node.ops[0], _EQUALITY) and type(one) is type(other)
    for each in () if alike else (one, other):
        if not _can_compute(each):
            raise ExpressionError(f"cannot compare {_shown(one)} and {_shown(other)}")
    return _COMPARISONS[type(node.ops[0])](one, other)


def _condition(node: ast.expr, values: Mapping[Any, Any]) -> Any:
    """Return whether a condition holds, for a field at each position."""
    value = _value(node, values)
    if not isinstance(value, bool) and not (isinstance(value, np.ndarray) and value.dtype == bool):
        raise ExpressionError(f"{_text(node)} is {_shown(value)}: must be true or false")
    return value


def _number(node: ast.expr, values: Mapping[Any, Any]) -> Any:
    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return number
        case ast.Name(id="pi"):
            return math.pi
        case ast.Name(id=name) if name in POSITION and POSITION.index(name) in values:
            return values[POSITION.index(name)]
        case ast.UnaryOp(op=sign, operand=one) if type(sign) in _OPERATORS:
            return _OPERATORS[type(sign)](_operand(one, values))
        case ast.BinOp(left=one, op=sign, right=other) if type(sign) in _OPERATORS:
            return _OPERATORS[type(sign)](_operand(one, values), _operand(other, values))
        case ast.Call(func=ast.Name(id=name), args=given, keywords=[]) if name in FUNCTIONS:
            function, count = FUNCTIONS[name]
            if len(given) != count:
                raise ExpressionError(f"{name} takes {count} number(s), not {len(given)}")
            numbers = [_operand(each, values) for each in given]
            fields = any(isinstance(each, np.ndarray) for each in numbers)
            return (_ON_FIELDS[name] if fields else function)(*numbers)
        case ast.Name(id=name) | ast.Call(func=ast.Name(id=name)):
            known = ", ".join(("pi", "if", *FUNCTIONS))
            raise ExpressionError(
                f"{name} is unknown: write ${name} for a parameter, '{name}' for a word; {known}"
            )
    raise ExpressionError(f"{_text(node)} cannot be read as arithmetic")


def _operand(node: ast.expr, values: Mapping[Any, Any]) -> Any:
    """Return the value of an operand, which must be a number."""
    value = _value(node, values)
    if _can_compute(value):
        return value
    allowed = "only numbers can be computed with"
    if isinstance(value, str):
        allowed += ", and a text without a $ is no expression"
    raise ExpressionError(f"{_text(node)} is {_shown(value)}: {allowed}")


def _can_compute(value: object) -> bool:
    """Tell whether a value is a number, or a field of numbers."""
    return is_number(value) or (isinstance(value, np.ndarray) and value.dtype != bool)


def _is_position(node: ast.AST) -> bool:
    return isinstance(node, ast.Name) and node.id in POSITION


class _Bound(ast.NodeTransformer):
    """Puts values in the place of parameters."""

    def __init__(self, values: Mapping[Any, Any]) -> None:
        self._values = values

    def visit_Name(self, node: ast.Name) -> ast.expr:
        """Return the value of a parameter as an expression; other names stay."""
        if not node.id.startswith(_MARK):
            return node
        name = node.id.removeprefix(_MARK)
        value = _known(name, self._values)
        if isinstance(value, str) and not _WORD.fullmatch(repr(value)):
            raise ExpressionError(f"${name} is {value!r}: only numbers can be computed with")
        return ast.parse(f"({1 if value else 0} == 1)" if isinstance(value, bool) else repr(value),
                         mode="eval").body  # fmt: skip


def _shown(value: object) -> str:
    if isinstance(value, np.ndarray):
        return "a field"
    return str(value).lower() if isinstance(value, bool) else repr(value)


def _text(node: ast.expr) -> str:
    """Return an expression as it is written in a file."""
    return ast.unparse(node).replace(_MARK, "$").replace(_IF, "if").replace("**", "^")


def _known(name: str, values: Mapping[Any, Any]) -> Any:
    if name not in values:
        known = ", ".join(f"${each}" for each in values)
        raise ExpressionError(f"${name} is no parameter; the scene has {known or 'none'}")
    return values[name]
