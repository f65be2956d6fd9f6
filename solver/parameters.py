"""How a parameter is declared: default, range, unit and meaning; how its value is checked."""

from __future__ import annotations

import math
import operator
import typing
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cache, lru_cache
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, TypeGuard, Union

from annotated_types import Ge, Gt, Interval, Le, Lt, Unit

from solver.errors import ModelError, plain


@dataclass(frozen=True, slots=True)
class Other:
    """Any value of a parameter but this one."""

    value: Any


Needs = Mapping[str, tuple[Any, ...] | Other]
"""Other parameters, each with values: one of them must have one of its values."""


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


Modulus = Annotated[float, Interval(gt=0.0), Unit("MPa")]
"""A modulus of a law, which may be one of a parameter times a ratio."""
Thickness = Annotated[float, Interval(gt=0.0), Unit("mm")]
Infinite = Annotated[float, Interval(ge=math.inf)]
"""Inf, where it stands for no limit."""
AtLeastOne = Annotated[int, Interval(ge=1)]
Positive = Annotated[float, Interval(gt=0.0)]
NotNegative = Annotated[float, Interval(ge=0.0)]
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


def is_number(value: object) -> TypeGuard[float]:
    """Whether a value is an integer or a float; true and false are none."""
    return isinstance(value, int | float) and not isinstance(value, bool)


_PLAIN: dict[Any, tuple[Callable[[Any], bool], str]] = {
    float: (lambda value: is_number(value) and abs(value) < math.inf, "a number"),
    Infinite: (lambda value: is_number(value) and value == math.inf, "inf"),
    int: (lambda value: isinstance(value, int) and not isinstance(value, bool), "an integer"),
    bool: (lambda value: isinstance(value, bool), "true or false"),
    str: (lambda value: isinstance(value, str), "text"),
    NoneType: (lambda value: value is None, "None"),
    Any: (lambda value: True, "anything"),
}
_BOUNDS: dict[type, tuple[str, str, Callable[[float, float], bool]]] = {
    Ge: ("ge", "at least", operator.ge),
    Gt: ("gt", "greater than", operator.gt),
    Le: ("le", "at most", operator.le),
    Lt: ("lt", "less than", operator.lt),
}
_REMEMBERED = (float, int, str, bool)
_Wrong = tuple[str, Any, str]
"""Field and value that are wrong, and what is allowed."""


class Checked:
    """Base of frozen dataclasses whose values are checked when they are built: see `check`.

    A subclass that overrides `__post_init__` names the base whose method it calls: zero-argument
    ``super()`` does not see the class that ``dataclass(slots=True)`` makes.
    """

    __slots__ = ()

    def __post_init__(self) -> None:
        """Raise `ModelError` for a value that its field does not allow."""
        check(self)


def check(declared: Any, within: str = "") -> None:
    """Raise `ModelError` for the first value of a dataclass that its field does not allow.

    Numbers are finite and in the declared range; None is allowed where it is the default.

    Parameters
    ----------
    declared : the object
    within : what stands before the name of the field in the message
    """
    kind = declared.__class__
    for name, (hint, default) in _declared(kind).items():
        value = getattr(declared, name)
        if value is None and default is None:
            continue
        if type(value) not in _REMEMBERED or not _accepted(kind, name, value):
            require(within + name, value, hint)


def require(field: str, value: object, hint: Any) -> None:
    """Raise `ModelError` unless the value is allowed; a list or an array is a tuple too."""
    if wrong := _wrong(field, value, hint):
        field, value, allowed = wrong
        raise ModelError(field, value, f"must be {allowed}")


@cache
def _declared(kind: Any) -> dict[str, tuple[Any, Any]]:
    """Return field -> annotation and default."""
    hints = typing.get_type_hints(kind, include_extras=True)
    return {item.name: (hints[item.name], item.default) for item in fields(kind) if item.init}


@lru_cache(maxsize=4096, typed=True)
def _accepted(kind: Any, name: str, value: float | str) -> bool:
    """Whether a field allows a value: the parameters of many runs have the same."""
    return _wrong(name, value, _declared(kind)[name][0]) is None


def _wrong(field: str, value: Any, hint: Any) -> _Wrong | None:
    of, parts = typing.get_origin(hint), typing.get_args(hint)
    if hint in _PLAIN:
        fits, words = _PLAIN[hint]
        infinite = hint is float and is_number(plain(value))
        wrong = field, value, "a finite number" if infinite else words
        return None if fits(plain(value)) else wrong
    if of is Annotated:
        return _wrong(field, value, parts[0]) or _outside(field, plain(value), parts[1:])
    if of in (Union, UnionType):
        each = [_wrong(field, value, part) for part in parts]
        if not all(each):
            return None
        every = [one for one in each if one]
        entry = next((one for one in every if one[0] != field), None)
        return entry or (field, value, " or ".join(allowed for *_, allowed in every))
    if of is Literal:
        known = any(isinstance(value, type(each)) and value == each for each in parts)
        return None if known else (field, value, _words(hint))
    if of is tuple:
        several = getattr(value, "ndim", 0) or isinstance(value, Sequence)
        if not several or isinstance(value, str):
            return field, value, _words(hint)
        own = parts[:1] * len(value) if parts[-1] is Ellipsis else parts
        if len(value) != len(own):
            return field, value, _words(hint)
        entries = [(f"{field}[{k}]", *each) for k, each in enumerate(zip(value, own, strict=True))]
    elif of is Mapping and isinstance(value, Mapping):
        entries = [(field, key, parts[0]) for key in value]
        entries += [(f"{field}.{key}", each, parts[1]) for key, each in value.items()]
    else:
        return None if isinstance(value, of or hint) else (field, value, _words(hint))
    return next((found for entry in entries if (found := _wrong(*entry))), None)


def _outside(field: str, value: Any, marks: tuple[Any, ...]) -> _Wrong | None:
    """Return what is wrong with a number that the marks of its type do not allow."""
    limits = [part for mark in marks for part in (mark if isinstance(mark, Interval) else [mark])]
    bounds = [(getattr(part, _BOUNDS[type(part)][0]), *_BOUNDS[type(part)][1:])
              for part in limits if type(part) in _BOUNDS]  # fmt: skip
    if not is_number(value) or all(test(value, limit) for limit, _, test in bounds):
        return None
    units = [f" [{mark.unit}]" for mark in marks if isinstance(mark, Unit) and mark.unit != "1"]
    allowed = " and ".join(f"{words} {limit:g}" for limit, words, _ in bounds)
    return field, value, "".join([allowed, *units])


def _words(hint: Any) -> str:
    """Return a kind in words."""
    of, parts = typing.get_origin(hint), typing.get_args(hint)
    if hint in _PLAIN:
        return _PLAIN[hint][1]
    if of is Annotated:
        return _words(parts[0])
    if of is Literal:
        return ("one of " if len(parts) > 1 else "") + ", ".join(map(str, parts))
    if of not in (Union, UnionType, tuple, Mapping):
        return "a function" if of is Callable else str(hint.__name__)
    words = [_words(part) for part in parts if part is not Ellipsis]
    if of is tuple:
        return f"a tuple of {words[0]}" if Ellipsis in parts else f"a tuple ({', '.join(words)})"
    return "a dict of " + " to ".join(words) if of is Mapping else " or ".join(words)
