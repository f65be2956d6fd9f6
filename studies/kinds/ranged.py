"""Kinds of study that search parameters within bounds, by a method of a library that asks for runs.

After each answer the method begins anew with what is known, up to the first run that lacks. What it
asks for depends only on the runs that it has asked for, so that one that is taken up after a crash
asks for the same runs.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, NamedTuple

from pydantic import BeforeValidator, Field, PlainValidator, ValidationInfo

from studies.definition.identity import canonical
from studies.definition.place import Chooser
from studies.definition.schema import Context, Limits, Range, known_name, rounded
from studies.definition.sweep import Standing
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
        dict[str, Range], BeforeValidator(_ranges, json_schema_input_type=dict[str, Range | Limits])
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


FOUND, MOST, FAILED = "found", "most", "failed"
"""Reasons for the end of a method."""


class Lacking(Exception):
    """The method needs runs that are not known yet."""

    def __init__(self, keys: list[Evaluation]) -> None:
        super().__init__()
        self.keys = keys


class Ends(Exception):
    """The method cannot go on; without a text, for want of runs."""


class Evaluation(NamedTuple):
    """A run: values of the parameters, and the position on the axes of the study."""

    values: tuple[float, ...]
    position: int


@dataclass(slots=True)
class Replayed(Chooser):
    """A program that begins anew after each answer.

    Attributes
    ----------
    asked : what the study asks for
    positions : the combinations of positions on the axes of the study
    rows : the rows of the runs, in the order in which they were asked for; None while one lacks
    known : what `seen` has returned of them; None of those that failed
    refusals : what the scene says of runs that it refuses, and why others have no result
    reason, message : why it has ended
    """

    asked: Any
    positions: list[Standing]
    rows: dict[Evaluation, Mapping[str, Any] | None] = field(default_factory=dict, kw_only=True)
    known: dict[Evaluation, Any] = field(default_factory=dict, kw_only=True)
    refusals: dict[Evaluation, str] = field(default_factory=dict, kw_only=True)
    reason: str = field(default="", kw_only=True)
    message: str = field(default="", kw_only=True)
    _wants: list[Evaluation] = field(default_factory=list, kw_only=True)
    _numbers: dict[str, int] = field(default_factory=dict, kw_only=True)

    def __post_init__(self) -> None:
        self.replay()

    @abstractmethod
    def search(self) -> None:
        """Begin anew: `ask` for runs, and take them from ``known``."""

    @abstractmethod
    def seen(self, key: Evaluation, row: Mapping[str, Any]) -> Any:
        """Return the result of a run; None if it failed."""

    @property
    def most(self) -> int:
        """Largest number of runs."""
        return int(self.asked.most_runs(len(self.positions)))

    def sets(self, key: Evaluation) -> dict[str, Any]:
        """Return the parameters that a run sets."""
        own = dict(zip(self.asked.ranges, key.values, strict=True))
        return {**self.positions[key.position].sets, **own}

    def key(self, parameters: Mapping[str, Any]) -> Evaluation:
        """Return the key of a run with these parameters."""
        if not self._numbers:
            self._numbers = {_position(each.sets): k for k, each in enumerate(self.positions)}
        own = {name: parameters[name] for name in self.positions[0].sets}
        values = tuple(parameters[name] for name in self.asked.ranges)
        return Evaluation(values, self._numbers[_position(own)])

    @property
    def wants(self) -> list[Evaluation]:
        """The runs that it lacks."""
        return [] if self.reason else [key for key in self._wants if key not in self.known]

    @property
    def progress(self) -> float:
        """Share of the largest number of runs that is done."""
        return 1.0 if self.reason else len(self.known) / max(self.most, len(self.known) + 1)

    @property
    def told(self) -> str:
        """How far it is, as text."""
        return f"run {len(self.known) + 1} of at most {self.most}"

    def tell(self, key: Evaluation, row: Mapping[str, Any]) -> None:
        """Tell it of a run that it lacked."""
        self.rows[key] = row
        self.known[key] = self.seen(key, row)
        if not self.wants:
            self.replay()

    def refuse(self, key: Evaluation, refusal: str) -> bool:
        """Tell it that the scene refuses a run, which counts as one that failed."""
        self.known[key], self.refusals[key] = None, refusal
        if not self.wants:
            self.replay()
        return True

    def ask(self, keys: Iterable[Evaluation]) -> None:
        """Ask for some runs together."""
        lacking = list(dict.fromkeys(key for key in keys if key not in self.known))
        if lacking and len(self.known) + len(lacking) > self.most:
            raise Ends
        if lacking:
            for key in lacking:
                self.rows.setdefault(key, None)
            raise Lacking(lacking)

    def replay(self) -> None:
        """Begin anew with what is known, to the first run that lacks or to the end."""
        self._wants = []
        try:
            self.search()
            self.reason = FOUND
        except Lacking as lacking:
            self._wants = lacking.keys
        except Ends as error:
            self.reason, self.message = FAILED, str(error)
            if not self.message:
                self.reason = MOST
                self.message = f"needs more than {self.most} runs: this is the best so far"


def _position(sets: Mapping[str, Any]) -> str:
    return canonical(list(sets.items()))
