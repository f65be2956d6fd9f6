"""Parameters that a kind of study searches within bounds."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, PlainValidator, ValidationInfo

from studies.definition.schema import Context, Ends, Range, known_name, rounded
from studies.errors import Mistakes, StudyError, one_of
from studies.kinds.kind import Kind, Trial

DIGITS = 6
"""Digits of a share of a range: runs are asked for at these places."""


def _ranges(content: Any, info: ValidationInfo) -> dict[str, Range]:
    if not isinstance(content, Mapping) or not content:
        raise StudyError("", content, "must be a table: the bounds of each parameter")
    known, found, wrong = Context.of(info).known, dict[str, Range](), Mistakes()
    for name, each in content.items():
        with wrong.at(str(name)):
            known_name(name, known, each)
            found[name] = Range.read(each, known[name])
            if known[name].whole:
                raise StudyError("", each, "takes whole numbers only: sweep it")
    wrong.report()
    return {name: found[name] for name in known if name in found}


def _first(content: Any, info: ValidationInfo) -> dict[str, float]:
    """Return the first value of each parameter, by default the middle of its range."""
    ranges = info.data.get("ranges", {})
    if not isinstance(content, Mapping):
        raise StudyError("", content, "must be a table: values of parameters of ranges")
    found = {name: rounded(each.value(0.5)) for name, each in ranges.items()}
    wrong = Mistakes()
    for name, given in content.items() if ranges else ():
        with wrong.at(str(name)):
            if name not in ranges:
                raise StudyError("", given, one_of(name, ranges))
            low, high = ranges[name].start, ranges[name].stop
            found[name] = float(Context.of(info).known[name].number(given, ""))
            if not low <= found[name] <= high:
                raise StudyError("", given, f"must be >= {low:g} and <= {high:g}")
    wrong.report()
    return found


class Ranged(Kind):
    """A kind of study that searches parameters within bounds.

    Attributes
    ----------
    ranges : the bounds of each parameter that is searched
    first : the values with which it begins
    """

    ranges: Annotated[
        dict[str, Range], BeforeValidator(_ranges, json_schema_input_type=dict[str, Range | Ends])
    ]
    first: Annotated[
        dict[str, float], PlainValidator(_first, json_schema_input_type=dict[str, float | str])
    ] = Field(default_factory=dict, validate_default=True)

    @classmethod
    def searched(cls, content: Mapping[str, Any]) -> Mapping[str, str]:
        """Return the parameters that are searched, with their fields."""
        return {name: f"{cls.name}.ranges.{name}" for name in content["ranges"]}

    @property
    def begins(self) -> Mapping[str, float]:
        """The first values."""
        return self.first

    @property
    def trial(self) -> Trial:
        """The runs with the first values."""
        names = {f"parameters.{name}": f"{self.name}.first.{name}" for name in self.ranges}
        return Trial(self.first, {}, names)

    @property
    def first_shares(self) -> list[float]:
        """The first values as shares of their ranges."""
        return [each.share(self.first[name]) for name, each in self.ranges.items()]

    def values_at(self, shares: Iterable[float]) -> tuple[float, ...]:
        """Return the values at shares of the ranges."""
        pairs = zip(self.ranges.values(), shares, strict=True)
        return tuple(each.inside(round(float(share), DIGITS)) for each, share in pairs)
