"""Goals: the value of a parameter at which a number of the runs passes a threshold.

A goal asks, at each place of the other axes, for the smallest value of its parameter **beyond**
the goal: a run is beyond if its number has passed the threshold, or if it found no equilibrium. A
search brackets this value and narrows the bracket. What it asks for next depends only on the runs
that it has asked for: a search that begins anew asks for the same runs, which are in the store.

A round is one run: the middle of the bracket, or, for ``at``, the point of the method ITP
(interpolate, truncate, project), which needs at most one run more than bisection. If the runs have
the derivative of the number by the parameter (`solver.derivatives`), it is beside the point of
Newton's method. Where the bracket is halved, its first ends are taken on trust: one of them is
computed only if the search comes to it. Where the goal at other places lets expect it
(`studies.definition.neighbours`), such a search begins there, with a bracket that is narrow enough,
and makes steps of doubled width if it missed; with slopes one step.

Where the parameter is the branch of its scene, one loading path serves several values: it rises
through a few values to the first one beyond. Where the path can go on from any of its states, it is
one path to the end of the search; otherwise each round is a path through a few values in the
bracket.

References
----------
Oliveira, I. F. D. and Takahashi, R. H. C. (2020), An enhancement of the bisection method average
performance preserving minmax optimality, ACM Trans. Math. Softw. 47(1), 5: ITP.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal, NamedTuple, Self

from annotated_types import Interval
from pydantic import Field, PlainValidator, ValidationInfo, model_validator

from solver.derivatives.asked import named
from solver.late import Late
from solver.results.shakedown import ShakedownState
from studies.definition.cases import Case
from studies.definition.parameters import in_unit
from studies.definition.place import Chooser
from studies.definition.quantity import OneNumber, number_of_a_run
from studies.definition.schema import Context, Limits, Number, Range, is_finite, rounded
from studies.definition.sweep import Axes, standings
from studies.definition.vocabulary import NO_EQUILIBRIUM, SOLVED
from studies.errors import StudyError, Unchecked, one_of
from studies.kinds.kind import Kind, Placed, Reading, Trial

FOUND: Mapping[str, Mapping[str, Any]] = {
    "first_yield": {"of": "max_plastic_strain", "first_above": 0.0},
    "limit_load": {},
    "shakedown_limit": {"of": "shakedown_state", "first_above": "elastic_shakedown"},
}
"""Goals that have a name, ``find``."""

_EQUILIBRIUM = (*SOLVED, "audit_failed")
"""Statuses of runs that are before the limit load, also where their numbers are not good enough."""

PASSED, NEVER, ALREADY = "passed", "never", "already"
FAILED, REFUSED = "failed", "refused"
"""Reasons for the end of a search, besides `NO_EQUILIBRIUM`: the number passed the threshold; not
even the last value is beyond; the first value is beyond; a run has no number; the scene refuses a
value inside the bracket."""

_KINDS = ("at", "first_above", "first_below")
_PARTS = 4
"""Parts into which a round of a loading path divides the bracket."""
_STEPS = 3
"""Steps of a search that began where its goal was expected, before it halves what is left; runs
that slopes may take beyond those of bisection."""
_ALONE, _NEAR = 3, 3
"""Number of searches that are expected to halve their whole bracket; runs of each of the others,
which begin where their neighbours let expect the goal, and of interpolation besides both ends."""
_ROUNDING = 1.0001
"""Factor on the width of a narrow bracket, whose ends are rounded."""
_SLACK = 1
"""Runs that ITP may take beyond those of bisection (n0 of the reference)."""
_FASTER = 0.25
"""Distance of the number from the threshold over that before a step of Newton's method: above this
ratio the next step is one without slopes, unless the bracket was halved."""
_SHAKEN = FOUND["shakedown_limit"]["of"], float(ShakedownState.ELASTIC_SHAKEDOWN), "first_above"
"""The goal that is where numbers become 0 that have slopes: the steady increments of strain."""


def _parameter(name: Any, info: ValidationInfo) -> str:
    """Return the parameter that is varied, by default the branch of the scene."""
    name, known = Context.of(info).scene.branch if name is None else name, Context.of(info).known
    if not isinstance(name, str) or name not in known:
        raise StudyError("", name, one_of(name, known))
    return name


def _threshold(value: Any, info: ValidationInfo) -> float:
    """Return the threshold of a number; of flags it may be a word."""
    if "of" not in info.data:
        raise Unchecked
    if not info.data["of"]:
        return math.nan  # of nothing: the goal is refused
    unit, flags = number_of_a_run(info.data["of"], Context.of(info).scene)
    if isinstance(value, str) and flags is not None:
        words = {each.name.lower(): float(each) for each in flags}
        if value not in words:
            raise StudyError("", value, one_of(value, words))
        return words[value]
    number = in_unit(unit, value, "")
    if not is_finite(number):
        raise StudyError("", value, "must be a finite number")
    return float(number)


def _between(content: Any, info: ValidationInfo) -> list[float]:
    if "parameter" not in info.data:
        raise Unchecked
    if not isinstance(content, list | tuple):
        raise StudyError("", content, "must be [lowest, highest], the first bracket")
    name = info.data["parameter"]
    try:
        ends = Range.read(content, Context.of(info).known[name])
    except StudyError as error:
        if name != Context.of(info).scene.branch:
            raise
        allowed = f"{error.allowed}, of {name}, which varies unless goal.parameter is another"
        raise StudyError(error.field, error.value, allowed) from None
    return [ends.start, ends.stop]


_Threshold = Annotated[float | None, PlainValidator(_threshold, json_schema_input_type=float | str)]


class Goal(Kind):
    """What is searched at each place of the axes.

    Attributes
    ----------
    parameter : the parameter that is varied, by default the branch of the scene
    find : name of a goal, instead of the entries that it stands for
    of : number of the runs; empty if only equilibrium counts
    at, first_above, first_below : the threshold: one of them; with ``at`` the number rises or falls
    within : largest ratio of the last bracket to its upper end; if the parameter may be 0 or
        negative, to the larger end of `between`
    between : the ends of the first bracket
    """

    name = "goal"
    everywhere = True
    rows = "answers"
    counted = "searches"
    example = "run_high"
    answers = Late("studies.kinds.goal.answer:answers")
    found = Late("studies.kinds.goal.shown:found")

    parameter: Annotated[str, PlainValidator(_parameter, json_schema_input_type=str)] = Field(
        default=None, validate_default=True
    )
    find: Literal["first_yield", "limit_load", "shakedown_limit"] | None = None
    of: OneNumber = ""
    at: _Threshold = None
    first_above: _Threshold = None
    first_below: _Threshold = None
    within: Annotated[Number, Interval(ge=1e-6, le=0.5)] = 0.01
    between: Annotated[list[float], PlainValidator(_between, json_schema_input_type=Limits)]
    _branch: str = ""
    _goes_on: bool = False
    _sloped: bool = False

    @model_validator(mode="before")
    @classmethod
    def _named(cls, content: Any) -> Any:
        """Return the content with what the name of a goal stands for."""
        if not isinstance(content, Mapping):
            return content
        if not content:
            allowed = "is empty: needs between, and find or of with a threshold; or take it out"
            raise StudyError("", {}, allowed)
        named = content.get("find")
        if not isinstance(named, str) or named not in FOUND:
            return content
        for key in content.keys() & {"of", *_KINDS}:
            raise StudyError(key, content[key], f"is what find = {named} says: keep one")
        return {**content, **FOUND[named], "find": None}

    @model_validator(mode="after")
    def _check(self, info: ValidationInfo) -> Self:
        given = [kind for kind in _KINDS if getattr(self, kind) is not None]
        if len(given) > 1 or bool(given) != bool(self.of):
            allowed = f"needs of and one of {', '.join(_KINDS)}; or neither, for the limit load"
            raise StudyError("", self.content, allowed)
        scene = Context.of(info).scene
        self._branch, self._goes_on = scene.branch, scene.goes_on
        self._sloped = any(self.slope(of) in scene.known_quantities for of in self.leading[0])
        return self

    @property
    def leading(self) -> tuple[tuple[str, ...], float]:
        """The numbers of which the first with a slope leads to the goal, and their value there."""
        if (self.of, self.threshold, self.kind) == _SHAKEN:
            return ("steady_plastic_increment", "steady_net_increment"), 0.0
        return (self.of,), self.threshold

    @property
    def sloped(self) -> bool:
        """Whether the runs have such a slope."""
        return self._sloped

    def slope(self, of: str) -> str:
        """Return the name of the derivative of a number by the parameter."""
        return named(of, self.parameter)

    @property
    def kind(self) -> str:
        """Which threshold it has; empty if only equilibrium counts."""
        return next((kind for kind in _KINDS if getattr(self, kind) is not None), "")

    @property
    def threshold(self) -> float:
        """The threshold."""
        return float(getattr(self, self.kind)) if self.kind else math.nan

    @property
    def whole(self) -> bool:
        """Whether the parameter is an integer."""
        return all(isinstance(each, int) for each in self.between)

    @property
    def branch(self) -> bool:
        """Whether the parameter is the branch of its scene."""
        return self.parameter == self._branch

    @property
    def goes_on(self) -> bool:
        """Whether a path of the scene goes on from any of its states (`Scene.goes_on`)."""
        return self.branch and self._goes_on

    @property
    def halves(self) -> bool:
        """Whether a search halves its bracket by single runs."""
        return not self.branch and self.kind != "at"

    @property
    def parts(self) -> int:
        """Parts into which a round divides the bracket."""
        return _PARTS if self.branch and not self.goes_on else 2

    def seen(self, row: Mapping[str, Any], rising: bool | None) -> Look:
        """Return what a run says.

        Parameters
        ----------
        row : of the run, as the catalogue has it
        rising : of ``at``, whether the number rises; None if the run is the first, which decides
        """
        status = str(row["status"])
        if status in NO_EQUILIBRIUM:
            return Look(True, None, status, row["id"])
        if not self.of:
            return Look(False if status in _EQUILIBRIUM else None, None, status, row["id"])
        value = row["scalars"].get(self.of)
        if status not in SOLVED or value is None:
            return Look(None, None, status, row["id"])
        over = value - self.threshold
        if self.kind == "at":
            over = 0.0 if rising is None else (over if rising else -over)
            return Look(over >= 0.0 and rising is not None, value, status, row["id"])
        return Look(
            over > 0.0 if self.kind == "first_above" else over < 0.0, value, status, row["id"]
        )

    @property
    def most(self) -> tuple[int, int]:
        """Largest number of rounds of a search, and of its runs."""
        low, high = self.between
        if self.halves:
            parts = (self.scaled(high) - self.scaled(low)) / self.tolerance
            runs = 1 + _STEPS + math.ceil(max(0.0, math.log2(parts) - 1e-9)) + 1
            return runs, runs
        first = _PARTS if self.branch else 1
        width = (self.scaled(high) - self.scaled(low)) / first
        more = math.ceil(max(0.0, math.log(width / self.tolerance, self.parts) - 1e-9))
        slack = _SLACK if self.kind == "at" and self.parts == 2 else 0
        more += _STEPS if self._sloped else slack
        return 1 + more, first + 1 + more * (self.parts - 1)

    @classmethod
    def searched(cls, content: Mapping[str, Any]) -> Mapping[str, str]:
        """Return the parameter that is searched, with its field."""
        return {content["parameter"]: "goal.parameter"}

    @property
    def trial(self) -> Trial:
        """The runs at the ends of the bracket."""
        ends: Axes = {self.parameter: self.between}
        return Trial({}, ends, {f"sweep.{self.parameter}": "goal.between"})

    @property
    def value(self) -> str:
        """The parameter that is searched."""
        return self.parameter

    @property
    def expects(self) -> bool:
        """Whether a search begins where its neighbours let expect the goal."""
        return self.halves

    def most_runs(self, places: int) -> int:
        """Return the most runs of the searches at so many places."""
        return places * self.most[1]

    def usual_runs(self, places: int) -> int:
        """Return the runs that are expected: few where neighbours or interpolation say where."""
        most = self.most[1]
        if self.halves:
            each = most - _STEPS - 1
            return places * each if places <= _ALONE else _ALONE * each + (places - _ALONE) * _NEAR
        return places * (min(most, _NEAR + 2) if self.kind == "at" and self.parts == 2 else most)

    def stage(self, places: int, ended: int, told: str) -> str:
        """Return how many searches have ended."""
        return f"{ended} of {places} searches ended"

    def programs(self, axes: Axes, read: Reading, allow: Sequence[str]) -> Iterator[Placed]:
        """Yield a search for each place of the axes."""
        for each in standings(axes):
            yield each, Search(self)

    def longest(
        self, cases: Iterable[Case], branch: str
    ) -> Iterator[tuple[Case, Mapping[str, Any], list[Any]]]:
        """Yield the paths of the longest searches, each to the largest value."""
        rounds, runs = self.most
        low, high = self.between
        first, later, count = [high], [high], runs
        if self.branch:
            each = runs - rounds if self.goes_on else (runs - 2) // rounds + 1
            later = [high] * (1 if self.goes_on else each - 1)
            first, count = [low, *self.split(low, high, each), high], rounds
        for case in cases:
            for values in (first, *itertools.repeat(later, count - 1)):
                yield case, {self.parameter: high}, values

    @property
    def content(self) -> dict[str, Any]:
        """What is read, normalised; without what is left out."""
        given = self.model_dump(exclude_none=True)
        return {name: each for name, each in given.items() if each != ""}

    def narrow(self, low: float, high: float) -> bool:
        """Whether a bracket is narrow enough, or cannot be divided."""
        width = self.scaled(high) - self.scaled(low)
        return width <= self.tolerance * _ROUNDING or not self.split(low, high, 2)

    def middle(self, low: float, high: float) -> float:
        """Return the middle of a bracket."""
        return self._value((self.scaled(low) + self.scaled(high)) / 2.0)

    def split(self, low: float, high: float, parts: int) -> list[float]:
        """Return the values that divide a bracket into parts, of equal ratios if they can be."""
        a, b = self.scaled(low), self.scaled(high)
        return self.inside(low, high, [a + (b - a) * k / parts for k in range(1, parts)])

    def inside(self, low: float, high: float, scaled: list[float]) -> list[float]:
        """Return the values of the parameter at places on the scale, if between two others."""
        values = map(self._value, scaled)
        found = [round(each) if self.whole else rounded(each) for each in values]
        return sorted({each for each in found if low < each < high})

    @property
    def tolerance(self) -> float:
        """Width of a narrow bracket on the scale."""
        if self._ratios:
            return -math.log1p(-self.within)
        return self.within * max(map(abs, self.between))

    def scaled(self, value: float) -> float:
        """Return the place of a value on the scale on which brackets are divided."""
        return math.log(value) if self._ratios else value

    def _value(self, scaled: float) -> float:
        return math.exp(scaled) if self._ratios else scaled

    @property
    def _ratios(self) -> bool:
        return self.between[0] > 0.0


class Look(NamedTuple):
    """What a run says: whether it is beyond (None: unknown), its number, its status and id."""

    beyond: bool | None
    value: float | None
    status: str
    run: str


@dataclass(slots=True)
class PathLimit:
    """Tells, on a loading path, the run behind which no other is needed.

    Attributes
    ----------
    goal : what is searched
    rising : of ``at``, whether the number rises; None if the first run of the path decides
    """

    goal: Goal
    rising: bool | None = None

    def __call__(self, row: Mapping[str, Any]) -> bool:
        """Whether a run is beyond the goal, or has failed; the runs come in increasing order."""
        look = self.goal.seen(row, self.rising)
        if self.rising is None and self.goal.kind == "at" and look.value is not None:
            self.rising = look.value < self.goal.threshold
        return look.beyond is not False


@dataclass(slots=True)
class Search(Chooser):
    """The search for the goal at one place of the other axes.

    Attributes
    ----------
    goal : what is searched
    expected : where it is expected, if that is known
    rows : the rows of the runs that it has asked for, by value of the parameter
    reason : why the search has ended; empty until then
    low, high : the bracket; NaN where there is no end yet
    rounds : number of complete rounds
    refusal : what the scene says of a value that it refuses, which is `high`
    """

    goal: Goal
    expected: float | None = None
    rows: dict[float, Mapping[str, Any]] = field(default_factory=dict)
    reason: str = ""
    low: float = math.nan
    high: float = math.nan
    rounds: int = 0
    refusal: str = ""
    _rising: bool | None = None
    _round: list[float] = field(default_factory=list)
    _led_from: tuple[float, float] = math.inf, math.inf

    def __post_init__(self) -> None:
        low, high = self.goal.between
        if self.goal.halves:
            self._round = self._halved()
            return
        inner = self.goal.split(low, high, _PARTS) if self.goal.branch else []
        self._round = [low, *inner, high]

    @property
    def wants(self) -> list[float]:
        """The values whose runs this round lacks, in increasing order; none at the end."""
        wanted: list[float] = []
        for value in [] if self.reason else self._round:
            if value not in self.rows:
                wanted.append(value)
            elif self.look(value).beyond:
                break
        return wanted

    def tell(self, value: float, row: Mapping[str, Any]) -> None:
        """Tell the search of a run that it lacked."""
        self.rows[value] = row
        while not self.reason and self._round_ends():
            self.rounds += 1

    def refuse(self, value: float, refusal: str) -> bool:
        """End the search, because the scene refuses a value, if it wants no other one before."""
        if value != self.wants[0]:
            return False
        self.high, self.reason, self.refusal = value, REFUSED, refusal
        return True

    def sets(self, value: float) -> dict[str, Any]:
        """Return the parameter that a run sets."""
        return {self.goal.parameter: value}

    def key(self, parameters: Mapping[str, Any]) -> Any:
        """Return the value of a run with these parameters."""
        return parameters[self.goal.parameter]

    @property
    def decided(self) -> tuple[str, ...]:
        """Statuses without results that are not computed again."""
        return NO_EQUILIBRIUM if self.goal.of else (*NO_EQUILIBRIUM, *_EQUILIBRIUM)

    @property
    def goes_on(self) -> bool:
        """Whether one loading path serves it to its end."""
        return self.goal.goes_on

    @property
    def found(self) -> float:
        """The value that was searched; NaN if there is none.

        For ``at`` it is interpolated in the last bracket, else the middle of the bracket.
        """
        if self.reason not in (PASSED, *NO_EQUILIBRIUM):
            return math.nan
        ends = self._over(self.low), self._over(self.high)
        if self.goal.kind == "at" and None not in ends:
            below, above = (float(each) for each in ends if each is not None)
            return self.low + (self.high - self.low) * below / (below - above)
        return self.goal.middle(self.low, self.high)

    @property
    def progress(self) -> float:
        """Share of the longest possible search that is done."""
        return 1.0 if self.reason else self.rounds / self.goal.most[0]

    @property
    def told(self) -> str:
        """The round, and the largest number of rounds, as text."""
        return f"round {self.rounds + 1} of at most {self.goal.most[0]}"

    @property
    def limit(self) -> PathLimit:
        """What ends a loading path of this round."""
        return PathLimit(self.goal, self._rising)

    @property
    def largest(self) -> float:
        """The upper end of the first bracket."""
        return self.goal.between[1]

    def look(self, value: float) -> Look:
        """Return what the run of a value says."""
        return self.goal.seen(self.rows[value], self._rising)

    def _round_ends(self) -> bool:
        """Move the ends of the bracket; return whether the round is complete."""
        for k, value in enumerate(self._round):
            if value not in self.rows:
                return False
            look = self.look(value)
            if self._rising is None and self.goal.kind == "at" and look.value is not None:
                self._rising = look.value < self.goal.threshold
                look = self.look(value)
            if look.beyond is None:
                self.high, self.reason = value, FAILED
                return True
            if look.beyond:
                self.high = value
                for above in self._round[k + 1 :]:  # not needed, but another study has stored it
                    self.rows.pop(above, None)
                break
            self.low = value
        if self.goal.halves and (values := self._halved()):
            self._round = values
        elif math.isnan(self.high):
            self.reason = NEVER
        elif math.isnan(self.low):
            self.reason = ALREADY
        elif self.goal.narrow(self.low, self.high):
            status = self.look(self.high).status
            self.reason = status if status in NO_EQUILIBRIUM else PASSED
        else:
            split = self.goal.split(self.low, self.high, self.goal.parts)
            self._round = self._led(self.low, self.high) or self._interpolated() or split
        return True

    def _halved(self) -> list[float]:
        """Return the next value of a search that halves its bracket; none at its end."""
        goal, (first, last) = self.goal, self.goal.between
        low = first if math.isnan(self.low) else self.low
        high = last if math.isnan(self.high) else self.high
        if not goal.narrow(low, high):
            led = self._led(low, high)
            return led or self._stepped(low, high) or goal.split(low, high, 2)
        ends = ((first, self.low), (last, self.high))
        return [end for end, known in ends if math.isnan(known) and end not in self.rows][:1]

    def _stepped(self, low: float, high: float) -> list[float]:
        """Return the first value where a goal is expected, or that of the next step from there."""
        goal, steps = self.goal, len(self.rows)
        if self.expected is None or steps > (1 if goal.sloped else _STEPS):
            return []
        if not steps:
            inside = min(max(self.expected, low), high)
            return goal.inside(low, high, [goal.scaled(inside) - goal.tolerance / 2])
        width = goal.tolerance * 2 ** (steps - 1)
        if math.isnan(self.high):
            return goal.inside(low, high, [goal.scaled(low) + width])
        return goal.inside(low, high, [goal.scaled(high) - width]) if math.isnan(self.low) else []

    def _led(self, low: float, high: float) -> list[float]:
        """Return the next value beside the point of Newton's method; none where it is not used.

        It is below this point by half of the tolerance, and an end of a narrow bracket if the point
        is in it: if it is exact, two runs are enough. Steps that hardly come nearer are left to the
        other methods, and those after which there might not be enough rounds.
        """
        goal, (names, aim), points = self.goal, self.goal.leading, []
        for value in (self.low, self.high):
            scalars = self.rows[value]["scalars"] if value in self.rows else {}
            for number, slope in ((scalars.get(of), scalars.get(goal.slope(of))) for of in names):
                if number is not None and slope and number != aim:
                    points.append((abs(number - aim), value - (number - aim) / slope))
                    break
        a, b, width = goal.scaled(low), goal.scaled(high), goal.tolerance
        (off, wide), self._led_from = self._led_from, (math.inf, math.inf)
        inside = [each for each in points if low < each[1] < high]
        if not inside or (min(inside)[0] > _FASTER * off and b - a > wide / 2.0):
            return []
        self._led_from, point = (min(inside)[0], b - a), goal.scaled(min(inside)[1])
        beside = a + width if point < a + width else point - width / 2.0
        value = b - width if point > b - width else beside
        left = goal.most[0] - self.rounds - 2 - int(goal.halves)
        fits = math.log(max(value - a, b - value) / width, goal.parts) <= left + 1e-9
        return goal.inside(low, high, [value]) if fits else []

    def _over(self, value: float) -> float | None:
        """Return how far the number of a run is from the threshold, positive beyond it."""
        number = self.look(value).value
        if number is None:
            return None
        over = number - self.goal.threshold
        return over if self._rising else -over

    def _interpolated(self) -> list[float]:
        """Return the next value by ITP, with the reference's names; none where it is not used."""
        if self.goal.parts > 2 or self.goal.kind != "at":
            return []
        fa, fb = self._over(self.low), self._over(self.high)
        if fa is None or fb is None or fb == fa:
            return []
        a, b = self.goal.scaled(self.low), self.goal.scaled(self.high)
        first, last = map(self.goal.scaled, self.goal.between)
        middle, left = (a + b) / 2, self.goal.most[0] - 1 - self.rounds
        radius = self.goal.tolerance / 2 * 2.0**left - (b - a) / 2
        xf = (fb * a - fa * b) / (fb - fa)
        sigma = math.copysign(1.0, middle - xf)
        xt = xf + sigma * min(0.2 / (last - first) * (b - a) ** 2, abs(middle - xf))
        x = xt if abs(xt - middle) <= radius else middle - sigma * max(radius, 0.0)
        return self.goal.inside(self.low, self.high, [x])
