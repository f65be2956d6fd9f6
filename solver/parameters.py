"""Parameters that scenes share, and how a parameter is described."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import lru_cache
from typing import Annotated, Any, Literal, TypeGuard

from annotated_types import Interval, Unit


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
