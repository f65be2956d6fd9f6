"""Parameters that scenes share, and how a parameter is described."""

from __future__ import annotations

import math
import operator
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import lru_cache
from typing import Annotated, Any, Literal, TypeGuard

from annotated_types import Ge, Gt, Interval, Le, Lt, Unit

from solver.errors import ModelError


@dataclass(frozen=True, slots=True)
class Other:
    """Any value of a parameter but this one."""

    value: Any


Needs = Mapping[str, tuple[Any, ...] | Other]
"""Other parameters with values; a parameter needs that one of them has one of these values."""


def described(default: Any, description: str, *, needs: Needs | None = None) -> Any:
    """Return a dataclass field with its default, its description, and what it needs.

    A parameter has an effect only if its needs are met; without any it always has one.
    """
    return field(default=default, metadata={"description": description, "needs": needs or {}})


def by_accuracy(description: str, *, needs: Needs | None = None) -> Any:
    """Return the field of a number that ``accuracy`` sets if the user gives none.

    Its default is None; when the object is built, the number of `usual` of its class takes its
    place.
    """
    return described(None, f"{description}; left out, `accuracy` sets it", needs=needs)


def unmet(parameters: Any, name: str) -> str:
    """Return what a parameter needs to have an effect, as text; empty if it has one.

    If the class has a property ``block``, the parameters of each pass, an effect in one is enough;
    the entries of its ``sequence`` give those of their passes.
    """
    several = isinstance(getattr(type(parameters), "block", None), property)
    if several and parameters.sequence and all(name in entry for entry in parameters.sequence):
        return "needs an entry of sequence without it"
    each = [_unmet(own, name) for own in (parameters.block if several else (parameters,))]
    return each[0] if all(each) else ""


def _unmet(parameters: Any, name: str) -> str:
    for needs in _needs(parameters.__class__).get(name, ()):
        known = {other: of for other, of in needs.items() if hasattr(parameters, other)}
        if known and not any(_met(getattr(parameters, other), of) for other, of in known.items()):
            return "needs " + " or ".join(_needed(other, of) for other, of in known.items())
    return ""


@lru_cache(maxsize=128)
def _needs(kind: Any) -> Mapping[str, tuple[Needs, ...]]:
    """Return what each field needs: by its declaration, and by the parts that use it."""
    found: dict[str, tuple[Needs, ...]] = {}
    declared = {item.name: item.metadata.get("needs") for item in fields(kind)}
    for each in (*(parts.needs() for parts in getattr(kind, "PARTS", ())), declared):
        for name, needs in each.items():
            found[name] = (*found.get(name, ()), *([needs] if needs else []))
    return found


def _met(value: Any, of: tuple[Any, ...] | Other) -> bool:
    return bool(value != of.value) if isinstance(of, Other) else value in of


def _needed(name: str, of: tuple[Any, ...] | Other) -> str:
    if isinstance(of, Other):
        return f"{name} other than {of.value}".removesuffix(".0")
    return f"{name} = {' or '.join(map(str, of))}"


Ratio = Annotated[float, Interval(gt=0.0, le=10.0), Unit("1")]
Friction = Annotated[float, Interval(ge=0.0, le=10.0), Unit("1")]
HardeningRatio = Annotated[float, Interval(ge=0.0, le=0.9), Unit("1")]
Fraction = Annotated[float, Interval(ge=0.0, le=1.0), Unit("1")]
Stress = Annotated[float, Interval(gt=0.0, le=1e7), Unit("MPa")]
Coordinate = Annotated[float, Unit("mm")]
Length = Annotated[float, Interval(gt=0.0, le=1e6), Unit("mm")]
Accuracy = Literal["draft", "standard", "fine"]
Poisson = Annotated[float, Interval(ge=0.0, le=0.4999), Unit("1")]
Pairs = tuple[tuple[float, float], ...]


def check(parameters: Any) -> None:
    """Raise `ModelError` for the first field that breaks its annotation."""
    for name, kinds, wanted, choices, bounds in _rules(parameters.__class__):
        value = getattr(parameters, name)
        if isinstance(value, str) and value in choices:
            continue
        if kinds is tuple and choices and isinstance(value, str):
            raise ModelError(name, value, f"must be {wanted}")
        if kinds is tuple or (value is None and name in _left_out(parameters.__class__)):
            continue
        if kinds is str and not choices and isinstance(value, str):  # a name
            continue
        if kinds is str:
            raise ModelError(name, value, "must be one of " + ", ".join(choices))
        if kinds is bool:
            if not isinstance(value, bool):
                raise ModelError(name, value, "must be true or false")
            continue
        if isinstance(value, bool) or not isinstance(value, kinds) or not math.isfinite(value):
            raise ModelError(name, value, f"must be {wanted}")
        for test, limit, _ in bounds:
            if not test(value, limit):
                allowed = " and ".join(f"{words} {limit:g}" for _, limit, words in bounds)
                raise ModelError(name, value, "must be " + " or ".join([allowed, *choices]))


def pairs(name: str, value: Pairs) -> Pairs:
    """Return the value if it is pairs of finite numbers, as the parameter must be."""
    known = isinstance(value, tuple) and all(
        isinstance(pair, Sequence) and len(pair) == 2 and all(map(_finite, pair)) for pair in value
    )
    if not known:
        raise ModelError(name, value, "must be pairs of finite numbers")
    return value


def is_number(value: object) -> TypeGuard[float]:
    """Whether a value is an integer or a float; true and false are none."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def _finite(value: object) -> bool:
    return is_number(value) and math.isfinite(value)


_Bound = tuple[Callable[[float, float], bool], float, str]
_Rule = tuple[str, Any, str, tuple[str, ...], tuple[_Bound, ...]]


@lru_cache(maxsize=128)
def _rules(kind: Any) -> tuple[_Rule, ...]:
    """Return name, types, what it must be, permitted words and bounds of every field."""
    rules = []
    hints = typing.get_type_hints(kind, include_extras=True)
    for item in fields(kind):
        of, choices, limits = _taken_apart(hints[item.name])
        bounds = tuple(bound for limit in limits for bound in _bounds(limit))
        kinds, wanted = {
            str: (str, ""), bool: (bool, ""), tuple: (tuple, "a list"), int: (int, "an integer")
        }.get(of, ((int, float), "a number"))  # fmt: skip
        wanted = " or ".join([wanted, *choices])
        rules.append((item.name, kinds, wanted, choices, bounds))
    return tuple(rules)


@lru_cache(maxsize=128)
def _left_out(kind: Any) -> frozenset[str]:
    """Return the fields whose default is None: they may be left out."""
    return frozenset(item.name for item in fields(kind) if item.default is None)


def _taken_apart(hint: Any) -> tuple[Any, tuple[str, ...], tuple[Any, ...]]:
    """Return the type, the permitted words and the limits of ``hint``: a number, words, or both."""
    of, arguments = typing.get_origin(hint), typing.get_args(hint)
    if of is tuple:  # the class with the field checks the entries
        return tuple, (), ()
    if of is Literal:
        return str, arguments, ()
    if of is Annotated:
        kind, choices, limits = _taken_apart(arguments[0])
        return kind, choices, (*limits, *arguments[1:])
    if of in (typing.Union, types.UnionType):
        each = [_taken_apart(part) for part in arguments]
        kind = next((kind for kind, _, _ in each if kind is not str), str)
        return kind, sum((words for _, words, _ in each), ()), sum((own for *_, own in each), ())
    return hint, (), ()


def _bounds(limit: Any) -> list[_Bound]:
    parts = limit if isinstance(limit, Interval) else [limit]
    known = (part for part in parts if isinstance(part, (Ge, Gt, Le, Lt)))
    return [(test, getattr(part, name), words) for part in known
            for name, words, test in [_TESTS[type(part)]]]  # fmt: skip


_TESTS: dict[type, tuple[str, str, Callable[[float, float], bool]]] = {
    Ge: ("ge", "at least", operator.ge),
    Gt: ("gt", "greater than", operator.gt),
    Le: ("le", "at most", operator.le),
    Lt: ("lt", "less than", operator.lt),
}
