"""Calibration: the values of parameters with which runs come closest to what was measured.

The sum of squared differences over standard deviations is made smallest by a trust region method
within bounds. Each evaluation is a run, or one for each position on the axes of the study. The
Jacobian matrix is that of their derivatives, if the study has them; else that of differences, whose
runs are asked for together. After each answer the method begins
anew with what is known: what it asks for next depends only on the runs that it has asked for, so
that one that is taken up after a crash asks for the same runs.

References
----------
Branch, M. A., Coleman, T. F. and Li, Y. (1999), A subspace, interior, and conjugate gradient method
for large-scale bound-constrained minimization problems, SIAM J. Sci. Comput. 21: the method of
`scipy.optimize.least_squares`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, NamedTuple, Self

import numpy as np
from annotated_types import Interval
from pydantic import Field, ValidationInfo, model_validator

from solver.derivatives.asked import named
from solver.late import Late
from solver.typing import Array
from studies.definition.quantity import Read
from studies.definition.schema import Context, Number, Whole
from studies.definition.sweep import Axes, standings
from studies.definition.vocabulary import SOLVED
from studies.errors import Mistakes, StudyError
from studies.kinds.fit.measured import MeasuredLine, with_files
from studies.kinds.kind import EVERYWHERE, Placed, Reading
from studies.kinds.ranged import DIGITS, Ends, Evaluation, Lacking, Ranged, Replayed

NO_FIT = "is missing: tell what was measured, and the ranges"
"""What a command of fits says of a study without one."""

_TOLERANCE = 1e-3
"""Least change of the sum of squares, as a share of it, and of the shares of the ranges."""
_WIDEST = 0.2
"""Widest difference to either side for the standard deviations, as a share of the range."""


class Fit(Ranged):
    """What was measured, and the parameters that are searched.

    Attributes
    ----------
    measured : the measured lines
    step : step of the differences, as a share of the range
    most : largest number of runs
    derived : whether runs have the derivatives of all lines by all parameters
    """

    name = "fit"
    rows = "answer"
    counted = "fits"
    answers = Late("studies.kinds.fit.answer:answers")
    found = Late("studies.kinds.fit.shown:found")
    table = Late("studies.kinds.fit.shown:fit_table")
    figure = Late("studies.kinds.fit.figure:fit_figure")

    measured: Annotated[list[MeasuredLine], Field(min_length=1, max_length=1000)]
    step: Annotated[Number, Interval(ge=1e-4, le=0.5)] = 0.05
    most: Annotated[Whole, Interval(ge=1, le=10_000)] = 100
    _derived: bool = False

    @model_validator(mode="after")
    def _check(self, info: ValidationInfo) -> Self:
        axes, free, wrong = Context.of(info).axes, len(self.ranges), Mistakes()
        scene = Context.of(info).scene
        self._derived = all(each.derived(by, scene) for each in self.measured for by in self.ranges)
        count = math.prod(map(len, axes.values())) * (1 if self._derived else 1 + free)
        if count > self.most:
            allowed = f"must be at least {count}, the runs of the first round"
            raise StudyError("most", self.most, allowed)
        every = standings(axes)
        for k, line in enumerate(self.measured):
            with wrong.at(f"measured[{k}].at"):
                if len(there := [each for each in every if each.has(line.at)]) != 1:
                    some = "; ".join(str(dict(each.at)) for each in (there or every)[:3])
                    allowed = f"must identify exactly one run; it matches {len(there)}: {some}"
                    raise StudyError("", line.at, allowed)
        wrong.report()
        if sum(len(each.values) for each in self.measured) < free:
            allowed = f"must have as many values as there are parameters: {free} at least"
            raise StudyError("measured", f"{len(self.measured)} lines", allowed)
        return self

    @property
    def derived(self) -> bool:
        """Whether runs have the derivatives of all lines by all parameters."""
        return self._derived

    @property
    def values(self) -> Array:
        """Measured values of all lines."""
        return np.concatenate([each.values for each in self.measured])

    @property
    def sigma(self) -> Array:
        """Their standard deviations."""
        return np.concatenate([each.deviations for each in self.measured])

    def spread(self, seen: Array) -> float:
        """Return the variance of differences over sigma if some sigma were not given; else 1."""
        freedom = len(self.values) - len(self.ranges)
        if freedom <= 0 or all(each.sigma for each in self.measured):
            return 1.0
        return float(np.sum(((seen - self.values) / self.sigma) ** 2)) / freedom

    @classmethod
    def with_files(cls, content: Any, folder: Path, given: Sequence[Path]) -> Any:
        """Return the entry with the rows of measured lines in place of the names of files."""
        return with_files(content, folder, given)

    def most_runs(self, places: int) -> int:
        """Return the largest number of runs."""
        del places
        return self.most

    def programs(self, axes: Axes, read: Reading, allow: Sequence[str]) -> Iterator[Placed]:
        """Yield the program of the fit."""
        names = {name for line in self.measured for name in (line.of, line.over)}
        names |= {named(each, by) for each in names for by in self.ranges if self.derived}
        yield EVERYWHERE, Fitting(self, standings(axes), read(names))

    @property
    def content(self) -> dict[str, Any]:
        """What is read, normalised; of lines without what is left out."""
        lines = [each.model_dump(exclude_defaults=True) for each in self.measured]
        return super().content | {"measured": lines}


class Fitted(NamedTuple):
    """What a fit has found.

    Attributes
    ----------
    values, shares : (n_parameters,) of the parameters, and of their ranges
    seen : (n_values,) what the runs say at the measured places
    jacobian : (n_values, n_parameters) of what the runs say over sigma, by the shares, here or
        where the last step began; None if it is not known
    """

    values: Array
    shares: Array
    seen: Array
    jacobian: Array | None


@dataclass(slots=True)
class Fitting(Replayed):
    """The program of a fit; see `studies.definition.place.Chooser`.

    Attributes
    ----------
    read : gives the variables of a run, by its row
    answer : what it has found, or the best so far
    """

    asked: Fit
    read: Callable[[Mapping[str, Any]], Read]
    answer: Fitted | None = None
    _of: list[list[int]] = field(default_factory=list)
    _exact: bool = False

    def __post_init__(self) -> None:
        self._of = [
            [k for k, line in enumerate(self.asked.measured) if each.has(line.at)]
            for each in self.positions
        ]
        self.replay()

    def misfit(self, values: tuple[float, ...]) -> float:
        """Return the mean of the squared differences over sigma; NaN if it is not known."""
        try:
            seen = self._all(values)
        except (Lacking, Ends):
            return math.nan
        return math.nan if seen is None else float(np.mean(self._over_sigma(seen[:, 0]) ** 2))

    def seen(self, key: Evaluation, row: Mapping[str, Any]) -> list[Array] | None:
        """Return what a run says at the measured places of its lines; None if it failed.

        Behind the values are the columns of their derivatives by the shares of the ranges, if the
        study has them.
        """
        if row["status"] not in SOLVED:
            self.refusals[key] = ": ".join(filter(None, (row["status"], row["message"])))
            return None
        read = self.read(row)
        lines = [self.asked.measured[k] for k in self._of[key.position]]
        each = zip(self.asked.ranges.items(), key.values, strict=True)
        widths = {name: of.slope(at) for (name, of), at in each if self.asked.derived}
        try:
            return [line.with_slopes(read, widths) for line in lines]
        except ValueError as error:
            self.refusals[key] = str(error)
            return None

    def search(self) -> None:
        """Begin anew with what is known."""
        from scipy.optimize import least_squares

        first = np.array(self.asked.first_shares).round(DIGITS)
        self.answer = None
        stepped = [] if self.asked.derived else self._stepped(first)
        self._ask([self.asked.values_at(each) for each in (first, *stepped)])
        found = least_squares(
            self._differences, first, self._jacobian, bounds=(0.0, 1.0), x_scale=1.0,
            ftol=_TOLERANCE, xtol=_TOLERANCE, gtol=1e-10, max_nfev=10 * self.asked.most,
        )  # fmt: skip
        values = self.asked.values_at(found.x)
        seen = self._all(values)
        assert seen is not None
        self.answer = Fitted(np.array(values), found.x.round(DIGITS), seen[:, 0], found.jac)
        if self._exact:
            return
        with suppress(Ends):  # no runs are left: narrow differences tell less well
            self.answer = self.answer._replace(jacobian=self._wide(self.answer))

    def _differences(self, shares: Array) -> Array:
        values = self.asked.values_at(shares)
        seen = self._all(values)
        if seen is None:
            if self.answer is None:
                keys = (Evaluation(values, k) for k in range(len(self.positions)))
                why = next(self.refusals[key] for key in keys if key in self.refusals)
                raise Ends(f"the run of the first values has no line: {why}")
            return np.full(len(self.asked.values), np.nan)  # the method goes half as far
        seen = seen[:, 0]
        found = self._over_sigma(seen)
        best = self.answer
        if best is None or np.sum(found**2) < np.sum(self._over_sigma(best.seen) ** 2):
            last = best.jacobian if best else None
            self.answer = Fitted(np.array(values), shares.round(DIGITS), seen, last)
        return found

    def _jacobian(self, shares: Array, *_: Any) -> Array:
        here = self._all(self.asked.values_at(shares))
        assert here is not None
        self._exact = self.asked.derived and bool(np.isfinite(here).all())
        if self._exact:
            slopes = here[:, 1:]
            return self._told(here[:, 0], slopes / self.asked.sigma[:, None])
        here = here[:, 0]
        steps = self._stepped(shares)
        self._ask([self.asked.values_at(step) for step in steps])
        columns = []
        for k, name in enumerate(self.asked.ranges):
            at = float(shares[k].round(DIGITS))
            width = steps[k][k] - at
            for side in (1.0, -1.0):
                step = shares.round(DIGITS)
                step[k] = round(at + side * width, DIGITS)
                inside = 0.0 <= step[k] <= 1.0
                there = self._all(self.asked.values_at(step)) if inside else None
                if there is not None:
                    columns.append((there[:, 0] - here) / (step[k] - at) / self.asked.sigma)
                    break
            else:
                raise Ends(
                    f"runs fail on both sides of {name} = {self.asked.values_at(shares)[k]:.6g}"
                )
        return self._told(here, np.column_stack(columns))

    def _told(self, here: Array, jacobian: Array) -> Array:
        """Return a Jacobian matrix, and keep that of the best values so far."""
        if self.answer is not None and np.array_equal(self.answer.seen, here):
            self.answer = self.answer._replace(jacobian=jacobian)
        return jacobian

    def _wide(self, answer: Fitted) -> Array:
        """Return the Jacobian matrix of central differences over what the parameters may be.

        That is two standard deviations to both sides. What a change of the mesh makes turns the
        columns of narrow differences apart: parameters that are nearly alike in what was measured
        would seem to be better known than they are. A column stays where runs fail, or at a bound.
        """
        assert answer.jacobian is not None
        here, found = answer.shares, answer.jacobian.copy()
        sigma = np.sqrt(self.asked.spread(answer.seen) * np.diag(np.linalg.pinv(found.T @ found)))
        room = np.minimum(here, 1.0 - here)
        widths = np.minimum(np.clip(2.0 * sigma, self.asked.step, _WIDEST), room).round(DIGITS)
        pairs = [
            [(here + side * width * unit).round(DIGITS) for side in (1.0, -1.0)]
            for width, unit in zip(widths, np.eye(len(here)), strict=True)
        ]
        wide = [k for k, width in enumerate(widths) if width >= self.asked.step / 2.0]
        self._ask([self.asked.values_at(each) for k in wide for each in pairs[k]])
        for k in wide:
            ends = [self._all(self.asked.values_at(each)) for each in pairs[k]]
            if ends[0] is not None and ends[1] is not None:
                found[:, k] = (ends[0] - ends[1])[:, 0] / (2.0 * widths[k]) / self.asked.sigma
        return found

    def _stepped(self, shares: Array) -> list[Array]:
        """Return the places of the differences: forward, or backward at the upper bounds."""
        found = []
        for k in range(len(shares)):
            step = shares.round(DIGITS)
            step[k] += self.asked.step if step[k] + self.asked.step <= 1.0 else -self.asked.step
            found.append(step.round(DIGITS))
        return found

    def _ask(self, every: list[tuple[float, ...]]) -> None:
        """Ask for the runs of several places together."""
        self.ask([Evaluation(values, k) for values in every for k in range(len(self.positions))])

    def _all(self, values: tuple[float, ...]) -> Array | None:
        """Return what runs say at all measured places, as of `seen`; None if one failed."""
        self._ask([values])
        found: list[Array] = [np.empty(0)] * len(self.asked.measured)
        for k, of in enumerate(self._of):
            seen = self.known[Evaluation(values, k)]
            if seen is None:
                return None
            for line, own in zip(of, seen, strict=True):
                found[line] = own
        return np.concatenate(found)

    def _over_sigma(self, seen: Array) -> Array:
        return (seen - self.asked.values) / self.asked.sigma
