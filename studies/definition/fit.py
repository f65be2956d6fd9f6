"""Calibration: the values of parameters with which runs come closest to what was measured.

The sum of squared differences over standard deviations is made smallest by a trust region method
within bounds. Each evaluation is a run, or one for each position on the axes of the study; those of
the differences for the Jacobian matrix are asked for together. After each answer the method begins
anew with what is known: what it asks for next depends only on the runs that it has asked for, so
that one that is taken up after a crash asks for the same runs.

References
----------
Branch, M. A., Coleman, T. F. and Li, Y. (1999), A subspace, interior, and conjugate gradient method
for large-scale bound-constrained minimization problems, SIAM J. Sci. Comput. 21: the method of
`scipy.optimize.least_squares`.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from solver.parameters import is_number
from solver.scenes import Scene
from studies.definition.identity import canonical
from studies.definition.line import Read
from studies.definition.measured import MeasuredLine, Numbers, checked_measured, content_of
from studies.definition.parameters import Parameter, parameters_of
from studies.definition.place import Chooser
from studies.definition.spaced import SPACINGS, between, rounded
from studies.definition.sweep import Axes, positions
from studies.definition.vocabulary import SOLVED
from studies.errors import StudyError, check_entries, one_of
from studies.toml import CASE

FOUND, MOST, FAILED = "found", "most", "failed"
"""Reasons for the end of a fit."""
NO_FIT = "is missing: tell what was measured, and the ranges"
"""What a command of fits says of a study without one."""

_KEYS = ("measured", "ranges", "first", "step", "most")
_DIGITS = 6
"""Digits of a share of the range: runs are asked for at these places."""
_TOLERANCE = 1e-3
"""Least change of the sum of squares, as a share of it, and of the shares of the ranges."""
_WIDEST = 0.2
"""Widest difference to either side for the standard deviations, as a share of the range."""


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


@dataclass(frozen=True, kw_only=True)
class Fit:
    """What is fitted.

    Attributes
    ----------
    free : the parameters that are searched, by name
    measured : the measured lines
    step : step of the differences, as a share of the range
    most : largest number of runs
    """

    free: Mapping[str, Free]
    measured: list[MeasuredLine]
    step: float = 0.05
    most: int = 100

    @property
    def first(self) -> dict[str, float]:
        """The first values."""
        return {name: each.first for name, each in self.free.items()}

    @cached_property
    def values(self) -> Numbers:
        """Measured values of all lines."""
        return np.concatenate([each.values for each in self.measured])

    @cached_property
    def sigma(self) -> Numbers:
        """Their standard deviations."""
        return np.concatenate([each.sigma for each in self.measured])

    def spread(self, seen: Numbers) -> float:
        """Return the variance of differences over sigma if some sigma were not given; else 1."""
        freedom = len(self.values) - len(self.free)
        if freedom <= 0 or all(each.told for each in self.measured):
            return 1.0
        return float(np.sum(((seen - self.values) / self.sigma) ** 2)) / freedom

    @property
    def names(self) -> tuple[str, ...]:
        """Names that the data set of the answer has for the parameters."""
        ends = ("", "_sigma", "_low", "_high")
        return tuple(f"{name}{end}" for name in self.free for end in ends)

    @property
    def content(self) -> dict[str, Any]:
        """What `checked_fit` reads."""
        ranges = {
            name: {"start": each.low, "stop": each.high, "spacing": each.spacing}
            for name, each in self.free.items()
        }
        return {
            "measured": [content_of(each) for each in self.measured], "ranges": ranges,
            "first": self.first, "step": self.step, "most": self.most,
        }  # fmt: skip


class Evaluation(NamedTuple):
    """A run of a fit: values of the parameters, and the position on the axes of the study."""

    values: tuple[float, ...]
    position: int


class Standing(NamedTuple):
    """A combination of positions on the axes of a study.

    Attributes
    ----------
    sets : the parameters that it sets
    at : the positions by axis, what they set, and the name of a point
    """

    sets: Mapping[str, Any]
    at: Mapping[str, Any]

    def has(self, at: Mapping[str, Any]) -> bool:
        """Whether it is at these positions; those of other dimensions do not count."""
        return all(self.at[name] == value for name, value in at.items() if name in self.at)


def standings(axes: Axes) -> list[Standing]:
    """Return all combinations of positions, the last axis fastest."""
    found = []
    for every in itertools.product(*(positions(name, axis) for name, axis in axes.items())):
        sets = {name: value for each in every for name, value in each.sets.items()}
        at = {name: each.at for name, each in zip(axes, every, strict=True)}
        named = [{CASE: each.case} for each in every if each.case is not None]
        found.append(Standing(sets, {**sets, **at, **(named[0] if named else {})}))
    return found


class Fitted(NamedTuple):
    """What a fit has found.

    Attributes
    ----------
    values, shares : (n_parameters,) of the parameters, and of their ranges
    seen : (n_values,) what the runs say at the measured places
    jacobian : (n_values, n_parameters) of what the runs say over sigma, by the shares, here or
        where the last step began; None if it is not known
    """

    values: Numbers
    shares: Numbers
    seen: Numbers
    jacobian: Numbers | None


class _Lacking(Exception):
    """The method needs runs that are not known yet."""

    def __init__(self, keys: list[Evaluation]) -> None:
        super().__init__()
        self.keys = keys


class _Ends(Exception):
    """The fit cannot go on."""


@dataclass(slots=True)
class Fitting(Chooser):
    """The program of a fit; see `studies.definition.place.Chooser`.

    Attributes
    ----------
    fit : what is fitted
    positions : the combinations of positions on the axes of the study
    read : gives the variables of a run, by its row
    rows : the rows of the runs, in the order in which they were asked for; None while one lacks
    refusals : what the scene says of runs that it refuses, and why others have no line
    reason, message : why it has ended
    answer : what it has found, or the best so far
    """

    fit: Fit
    positions: list[Standing]
    read: Callable[[Mapping[str, Any]], Read]
    rows: dict[Evaluation, Mapping[str, Any] | None] = field(default_factory=dict)
    refusals: dict[Evaluation, str] = field(default_factory=dict)
    reason: str = ""
    message: str = ""
    answer: Fitted | None = None
    _wants: list[Evaluation] = field(default_factory=list)
    _seen: dict[Evaluation, list[Numbers] | None] = field(default_factory=dict)
    _numbers: dict[str, int] = field(default_factory=dict)
    _of: list[list[int]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._numbers = {_position(each.sets): k for k, each in enumerate(self.positions)}
        self._of = [
            [k for k, line in enumerate(self.fit.measured) if each.has(line.at)]
            for each in self.positions
        ]
        self._go_on()

    @property
    def wants(self) -> list[Evaluation]:
        """The runs that it lacks."""
        return [] if self.reason else [key for key in self._wants if key not in self._seen]

    @property
    def progress(self) -> float:
        """Share of the largest number of runs that is done."""
        return 1.0 if self.reason else len(self._seen) / max(self.fit.most, len(self._seen) + 1)

    @property
    def told(self) -> str:
        """How far it is, as text."""
        return f"run {len(self._seen) + 1} of at most {self.fit.most}"

    def sets(self, key: Evaluation) -> dict[str, Any]:
        """Return the parameters that a run sets."""
        own = dict(zip(self.fit.free, key.values, strict=True))
        return {**self.positions[key.position].sets, **own}

    def key(self, parameters: Mapping[str, Any]) -> Evaluation:
        """Return the key of a run with these parameters."""
        own = {name: parameters[name] for name in self.positions[0].sets}
        return Evaluation(
            tuple(parameters[name] for name in self.fit.free), self._numbers[_position(own)]
        )

    def tell(self, key: Evaluation, row: Mapping[str, Any]) -> None:
        """Tell it of a run that it lacked."""
        self.rows[key] = row
        self._seen[key] = self._lines(key, row)
        if not self.wants:
            self._go_on()

    def refuse(self, key: Evaluation, refusal: str) -> bool:
        """Tell it that the scene refuses a run, which counts as one that failed."""
        self._seen[key], self.refusals[key] = None, refusal
        if not self.wants:
            self._go_on()
        return True

    def misfit(self, values: tuple[float, ...]) -> float:
        """Return the mean of the squared differences over sigma; NaN if it is not known."""
        try:
            seen = self._all(values)
        except (_Lacking, _Ends):
            return math.nan
        return math.nan if seen is None else float(np.mean(self._over_sigma(seen) ** 2))

    def _lines(self, key: Evaluation, row: Mapping[str, Any]) -> list[Numbers] | None:
        """Return what a run says at the measured places of its lines; None if it failed."""
        if row["status"] not in SOLVED:
            self.refusals[key] = ": ".join(filter(None, (row["status"], row["message"])))
            return None
        read = self.read(row)
        try:
            return [self.fit.measured[k].seen(read) for k in self._of[key.position]]
        except ValueError as error:
            self.refusals[key] = str(error)
            return None

    def _go_on(self) -> None:
        """Begin anew with what is known, to the first run that lacks or to the end."""
        from scipy.optimize import least_squares

        free = list(self.fit.free.values())
        first = np.array([each.share(each.first) for each in free]).round(_DIGITS)
        self.answer, self._wants = None, []
        try:
            self._ask([self._values(first), *(self._values(each) for each in self._stepped(first))])
            found = least_squares(
                self._differences, first, self._jacobian, bounds=(0.0, 1.0), x_scale=1.0,
                ftol=_TOLERANCE, xtol=_TOLERANCE, gtol=1e-10, max_nfev=10 * self.fit.most,
            )  # fmt: skip
            values = self._values(found.x)
            seen = self._all(values)
            assert seen is not None
            self.answer = Fitted(np.array(values), found.x.round(_DIGITS), seen, found.jac)
            with suppress(_Ends):  # no runs are left: narrow differences tell less well
                self.answer = self.answer._replace(jacobian=self._wide(self.answer))
            self.reason = FOUND
        except _Lacking as lacking:
            self._wants = lacking.keys
        except _Ends as error:
            self.reason, self.message = (MOST, "") if not str(error) else (FAILED, str(error))
        if self.reason == MOST:
            self.message = f"needs more than {self.fit.most} runs: this is the best so far"

    def _differences(self, shares: Numbers) -> Numbers:
        values = self._values(shares)
        seen = self._all(values)
        if seen is None:
            if self.answer is None:
                keys = (Evaluation(values, k) for k in range(len(self.positions)))
                why = next(self.refusals[key] for key in keys if key in self.refusals)
                raise _Ends(f"the run of the first values has no line: {why}")
            return np.full(len(self.fit.values), np.nan)  # the method goes half as far
        found = self._over_sigma(seen)
        best = self.answer
        if best is None or np.sum(found**2) < np.sum(self._over_sigma(best.seen) ** 2):
            last = best.jacobian if best else None
            self.answer = Fitted(np.array(values), shares.round(_DIGITS), seen, last)
        return found

    def _jacobian(self, shares: Numbers, *_: Any) -> Numbers:
        here = self._all(self._values(shares))
        assert here is not None
        steps = self._stepped(shares)
        self._ask([self._values(step) for step in steps])
        columns = []
        for k, name in enumerate(self.fit.free):
            at = float(shares[k].round(_DIGITS))
            width = steps[k][k] - at
            for side in (1.0, -1.0):
                step = shares.round(_DIGITS)
                step[k] = round(at + side * width, _DIGITS)
                inside = 0.0 <= step[k] <= 1.0
                there = self._all(self._values(step)) if inside else None
                if there is not None:
                    columns.append((there - here) / (step[k] - at) / self.fit.sigma)
                    break
            else:
                raise _Ends(f"runs fail on both sides of {name} = {self._values(shares)[k]:.6g}")
        found = np.column_stack(columns)
        if self.answer is not None and np.array_equal(self.answer.seen, here):
            self.answer = self.answer._replace(jacobian=found)
        return found

    def _wide(self, answer: Fitted) -> Numbers:
        """Return the Jacobian matrix of central differences over what the parameters may be.

        That is two standard deviations to both sides. What a change of the mesh makes turns the
        columns of narrow differences apart: parameters that are nearly alike in what was measured
        would seem to be better known than they are. A column stays where runs fail, or at a bound.
        """
        assert answer.jacobian is not None
        here, found = answer.shares, answer.jacobian.copy()
        sigma = np.sqrt(self.fit.spread(answer.seen) * np.diag(np.linalg.pinv(found.T @ found)))
        room = np.minimum(here, 1.0 - here)
        widths = np.minimum(np.clip(2.0 * sigma, self.fit.step, _WIDEST), room).round(_DIGITS)
        pairs = [
            [(here + side * width * unit).round(_DIGITS) for side in (1.0, -1.0)]
            for width, unit in zip(widths, np.eye(len(here)), strict=True)
        ]
        wide = [k for k, width in enumerate(widths) if width >= self.fit.step / 2.0]
        self._ask([self._values(each) for k in wide for each in pairs[k]])
        for k in wide:
            ends = [self._all(self._values(each)) for each in pairs[k]]
            if ends[0] is not None and ends[1] is not None:
                found[:, k] = (ends[0] - ends[1]) / (2.0 * widths[k]) / self.fit.sigma
        return found

    def _stepped(self, shares: Numbers) -> list[Numbers]:
        """Return the places of the differences: forward, or backward at the upper bounds."""
        found = []
        for k in range(len(shares)):
            step = shares.round(_DIGITS)
            step[k] += self.fit.step if step[k] + self.fit.step <= 1.0 else -self.fit.step
            found.append(step.round(_DIGITS))
        return found

    def _values(self, shares: Numbers) -> tuple[float, ...]:
        free = self.fit.free.values()
        return tuple(
            each.value(round(float(s), _DIGITS)) for each, s in zip(free, shares, strict=True)
        )

    def _ask(self, every: list[tuple[float, ...]]) -> None:
        """Ask for the runs of several places together."""
        keys = [Evaluation(values, k) for values in every for k in range(len(self.positions))]
        lacking = list(dict.fromkeys(key for key in keys if key not in self._seen))
        if lacking and len(self._seen) + len(lacking) > self.fit.most:
            raise _Ends
        if lacking:
            for key in lacking:
                self.rows.setdefault(key, None)
            raise _Lacking(lacking)

    def _all(self, values: tuple[float, ...]) -> Numbers | None:
        """Return what runs say at all measured places; None if one of them failed."""
        self._ask([values])
        found: list[Numbers] = [np.empty(0)] * len(self.fit.measured)
        for k, of in enumerate(self._of):
            seen = self._seen[Evaluation(values, k)]
            if seen is None:
                return None
            for line, own in zip(of, seen, strict=True):
                found[line] = own
        return np.concatenate(found)

    def _over_sigma(self, seen: Numbers) -> Numbers:
        return (seen - self.fit.values) / self.fit.sigma


def _position(sets: Mapping[str, Any]) -> str:
    return canonical(list(sets.items()))


def checked_fit(content: Any, scene: Scene, axes: Axes) -> Fit:
    """Return the fit that a study asks for.

    Parameters
    ----------
    content : ``measured``, see `checked_measured`; ``ranges``, for each parameter ``[lowest,
        highest]`` or ``{start, stop, spacing}``; ``first`` values, by default the middles of the
        ranges; ``step`` and ``most``, see `Fit`
    scene : the scene
    axes : of the sweep of the study

    Raises
    ------
    StudyError
        naming the entry, its value and what is allowed
    """
    if not isinstance(content, Mapping):
        raise StudyError("fit", content, "must be a table")
    check_entries("fit", content, _KEYS)
    known, ranges = parameters_of(scene), content.get("ranges")
    if not isinstance(ranges, Mapping) or not ranges:
        raise StudyError("fit.ranges", ranges, "must be a table: the bounds of each parameter")
    for name in ranges:
        if name not in known:
            raise StudyError(f"fit.ranges.{name}", ranges[name], one_of(name, known))
    first = content.get("first", {})
    if not isinstance(first, Mapping):
        raise StudyError("fit.first", first, "must be a table: values of parameters of fit.ranges")
    for name in first:
        if name not in ranges:
            raise StudyError(f"fit.first.{name}", first[name], one_of(name, ranges))
    step, most = content.get("step", Fit.step), content.get("most", Fit.most)
    if not is_number(step) or not 1e-4 <= step <= 0.5:
        raise StudyError("fit.step", step, "must be a number >= 0.0001 and <= 0.5")
    if isinstance(most, bool) or not isinstance(most, int) or not 1 <= most <= 10_000:
        raise StudyError("fit.most", most, "must be an integer >= 1 and <= 10000")
    if "measured" not in content:
        allowed = "is missing: name files of measured lines here, or with --measured"
        raise StudyError("fit.measured", None, allowed)
    free = {
        name: _free(ranges[name], first.get(name), known[name]) for name in known if name in ranges
    }
    every = standings(axes)
    if (count := len(every) * (1 + len(free))) > most:
        raise StudyError("fit.most", most, f"must be at least {count}, the runs of the first round")
    lines = checked_measured(content["measured"], scene, {n for each in every for n in each.at})
    for k, line in enumerate(lines):
        if len(there := [each for each in every if each.has(line.at)]) != 1:
            some = "; ".join(str(dict(each.at)) for each in (there or every)[:3])
            allowed = f"must tell one run, and fits {len(there)}: {some}"
            raise StudyError(f"fit.measured[{k}].at", dict(line.at), allowed)
    if sum(len(each.values) for each in lines) < len(free):
        allowed = f"must have as many values as there are parameters: {len(free)} at least"
        raise StudyError("fit.measured", f"{len(lines)} lines", allowed)
    return Fit(free=free, measured=lines, step=float(step), most=most)


def _free(content: Any, first: Any, parameter: Parameter) -> Free:
    """Return a parameter that is searched."""
    own, spacing = f"fit.ranges.{parameter.name}", "linear"
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
    value = float(parameter.number(first, f"fit.first.{parameter.name}"))
    if not low <= value <= high:
        raise StudyError(
            f"fit.first.{parameter.name}", first, f"must be >= {low:g} and <= {high:g}"
        )
    return Free(low=low, high=high, spacing=spacing, first=value)
