"""Parameters that a kind of study searches within bounds."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from solver.scenes import Scene
from studies.definition.parameters import Parameter, parameters_of
from studies.definition.spaced import SPACINGS, between, rounded
from studies.errors import StudyError, one_of
from studies.kinds.kind import Kind, Trial

DIGITS = 6
"""Digits of a share of a range: runs are asked for at these places."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Free:
    """A parameter that is searched: its bounds, how it is spaced between them, its first value."""

    low: float
    high: float
    spacing: str
    first: float

    def value(self, share: float) -> float:
        """Return the value at a share of the range."""
        return min(
            max(rounded(between(self.low, self.high, self.spacing, share)), self.low), self.high
        )

    def share(self, value: float) -> float:
        """Return the share of the range at a value."""
        if self.spacing == "log":
            return math.log(value / self.low) / math.log(self.high / self.low)
        return (value - self.low) / (self.high - self.low)

    def slope(self, value: float) -> float:
        """Return how much the value grows by the share."""
        if self.spacing == "log":
            return value * math.log(self.high / self.low)
        return self.high - self.low

    @property
    def content(self) -> dict[str, Any]:
        """The range, as `checked_ranges` reads it."""
        return {"start": self.low, "stop": self.high, "spacing": self.spacing}


@dataclass(frozen=True, kw_only=True)
class Ranged(Kind):
    """A kind of study that searches parameters within bounds.

    Attributes
    ----------
    free : the parameters that are searched, by name
    """

    free: Mapping[str, Free]

    @classmethod
    def searched(cls, content: Mapping[str, Any]) -> Mapping[str, str]:
        """Return the parameters that are searched, with their fields."""
        return {name: f"{cls.name}.ranges.{name}" for name in content["ranges"]}

    @property
    def first(self) -> dict[str, float]:
        """The first values."""
        return {name: each.first for name, each in self.free.items()}

    @property
    def trial(self) -> Trial:
        """The runs with the first values."""
        names = {f"parameters.{name}": f"{self.name}.first.{name}" for name in self.free}
        return Trial(self.first, {}, names)

    def values_at(self, shares: Iterable[float]) -> tuple[float, ...]:
        """Return the values at shares of the ranges."""
        pairs = zip(self.free.values(), shares, strict=True)
        return tuple(each.value(round(float(share), DIGITS)) for each, share in pairs)

    @property
    def content(self) -> dict[str, Any]:
        """What `checked_ranges` reads."""
        ranges = {name: each.content for name, each in self.free.items()}
        return {"ranges": ranges, "first": self.first}


def checked_ranges(entry: str, content: Mapping[str, Any], scene: Scene) -> dict[str, Free]:
    """Return the parameters of the ``ranges`` of an entry, with their ``first`` values.

    Raises
    ------
    StudyError
        naming the entry, its value and what is allowed
    """
    known, ranges = parameters_of(scene), content.get("ranges")
    if not isinstance(ranges, Mapping) or not ranges:
        raise StudyError(f"{entry}.ranges", ranges, "must be a table: the bounds of each parameter")
    for name in ranges:
        if name not in known:
            raise StudyError(f"{entry}.ranges.{name}", ranges[name], one_of(name, known))
    first = content.get("first", {})
    if not isinstance(first, Mapping):
        allowed = f"must be a table: values of parameters of {entry}.ranges"
        raise StudyError(f"{entry}.first", first, allowed)
    for name in first:
        if name not in ranges:
            raise StudyError(f"{entry}.first.{name}", first[name], one_of(name, ranges))
    return {
        name: _free(entry, ranges[name], first.get(name), known[name])
        for name in known
        if name in ranges
    }


def check_whole(field: str, value: Any, most: int) -> None:
    """Raise `StudyError` if a value is no integer from 1 to ``most``."""
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= most:
        raise StudyError(field, value, f"must be an integer >= 1 and <= {most}")


def _free(entry: str, content: Any, first: Any, parameter: Parameter) -> Free:
    """Return a parameter that is searched."""
    own, spacing = f"{entry}.ranges.{parameter.name}", "linear"
    if isinstance(content, Mapping) and content.keys() <= {"start", "stop", "spacing"}:
        spacing = content.get("spacing", "linear")
        content = [content.get("start"), content.get("stop")]
    if not isinstance(content, list | tuple) or len(content) != 2:
        allowed = "must be [lowest, highest], or {start, stop, spacing = linear or log}"
        raise StudyError(own, content, allowed)
    if spacing not in SPACINGS:
        raise StudyError(f"{own}.spacing", spacing, one_of(spacing, SPACINGS))
    low, high = (float(parameter.number(each, own)) for each in content)
    if parameter.whole:
        raise StudyError(own, list(content), "takes whole numbers only: sweep it")
    if not low < high or (spacing == "log" and low <= 0.0):
        allowed = "must begin with its lowest value" + (", > 0" if spacing == "log" else "")
        raise StudyError(own, list(content), allowed)
    if first is None:
        first = rounded(between(low, high, spacing, 0.5))
    value = float(parameter.number(first, f"{entry}.first.{parameter.name}"))
    if not low <= value <= high:
        raise StudyError(
            f"{entry}.first.{parameter.name}", first, f"must be >= {low:g} and <= {high:g}"
        )
    return Free(low=low, high=high, spacing=spacing, first=value)
