"""The smallest value of a number within bounds and under conditions, from several starts.

By SLSQP (Kraft 1988) if runs have the derivatives. Else, and from a run on that failed or lacks
one, by COBYQA (Ragonneau and Zhang 2024): quadratic models that go around failed runs.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Annotated, Any, Self

import numpy as np
from annotated_types import Interval
from pydantic import BeforeValidator, Field, ValidationInfo, model_validator

from solver.derivatives.asked import named
from solver.late import Late
from solver.typing import Array
from studies.definition.quantity import OneCondition, OneNumber
from studies.definition.schema import Context, Whole, listed
from studies.definition.sweep import Axes, standings
from studies.definition.vocabulary import OK, taken
from studies.errors import StudyError
from studies.kinds.kind import Placed, Reading
from studies.kinds.ranged import Evaluation, Lacking, Ranged, Replayed

_RADII = {"initial_tr_radius": 0.2, "final_tr_radius": 0.01}  # of trust: shares of the ranges
_ENDS = {"ftol": 1e-3}  # change of the number in a step with slopes, over its first value


class _Lost(Exception):
    """A run failed or has no slope."""


class Minimise(Ranged):
    """A minimum of a number within bounds, where conditions hold.

    Attributes
    ----------
    of : the number
    where : conditions, such as ``peak_residual_tension < 200``
    starts : number of first places
    most : largest number of runs at a place of the axes
    """

    name = "minimise"
    everywhere = True
    of_runs = True
    ends = ("search_state", "open", "run")
    answers = Late("studies.kinds.minimise.answer:answers")
    found = Late("studies.kinds.minimise.shown:found")

    of: OneNumber
    where: Annotated[
        list[OneCondition],
        BeforeValidator(listed, json_schema_input_type=str | list[str]),
        Field(max_length=100),
    ] = Field(default_factory=list)
    starts: Annotated[Whole, Interval(ge=1, le=100)] = 3
    most: Annotated[Whole, Interval(ge=1, le=10_000)] = 60

    _derived: bool = False

    @model_validator(mode="after")
    def _check(self, info: ValidationInfo) -> Self:
        known = Context.of(info).scene.known_quantities
        names = [self.of, *(each.name for each in self.where)]
        self._derived = all(named(of, by) in known for of in names for by in self.ranges)
        if self.most < self.starts:
            raise StudyError("most", self.most, f"must be at least {self.starts}, that of starts")
        return self

    @property
    def derived(self) -> bool:
        """Whether runs have the derivatives of the number and the conditions."""
        return self._derived

    @property
    def value(self) -> str:
        """The number that is minimised."""
        return self.of

    def most_runs(self, places: int) -> int:
        """Return the most runs at so many places."""
        return places * self.most

    def programs(self, axes: Axes, read: Reading, allow: Sequence[str]) -> Iterator[Placed]:
        """Yield the searches from all starts, at all places of the axes."""
        yield Placed([], {}, Minimising(self, standings(axes), allow))


@dataclass(slots=True)
class Minimising(Replayed):
    """The searches for the smallest value."""

    asked: Minimise
    allow: Sequence[str]

    def seen(self, key: Evaluation, row: Mapping[str, Any]) -> Array | None:
        """Return the number, and how far each condition is broken; None of a run that failed.

        They are in the first column; behind it are their derivatives by the shares of the ranges,
        if runs have them.
        """
        free = list(self.asked.ranges) if self.asked.derived else []
        names = [self.asked.of, *(each.name for each in self.asked.where)]
        every = [[name, *(named(name, by) for by in free)] for name in names]
        found = np.array([[row["scalars"].get(each) for each in own] for own in every], dtype=float)
        if taken(row["status"], self.allow) != OK or np.isnan(found[:, 0]).any():
            return None
        if free:
            each = zip(self.asked.ranges.values(), key.values, strict=True)
            found[:, 1:] *= [of.slope(at) for of, at in each]
        for own, condition in zip(found[1:], self.asked.where, strict=True):
            own[1:] *= condition.over(1.0) - condition.over(0.0)
            own[0] = condition.over(own[0])
        return found

    def search(self) -> None:
        """Carry out all searches to the first runs that lack, and ask for these together."""
        from scipy.stats import qmc

        first = np.array(self.asked.first_shares)
        spread = qmc.Halton(len(first), scramble=False).random(self.asked.starts + 1)[2:]
        lacking: list[Evaluation] = []
        for position in range(len(self.positions)):
            for start in (first, *spread):
                try:
                    self._search(start, position)
                except Lacking as more:
                    lacking += more.keys
        self.ask(lacking)

    def _search(self, start: Array, position: int) -> None:
        from scipy.optimize import NonlinearConstraint, minimize

        def at(shares: Array) -> Array:
            key = Evaluation(self.asked.values_at(shares), position)
            if key not in self.known:
                raise Lacking([key])
            found = self.known[key]
            return np.full((1 + len(self.asked.where), 1), np.nan) if found is None else found

        bounds = [(0.0, 1.0)] * len(start)
        if self.asked.derived:
            last, scale = start, abs(float(at(start)[0, 0])) or 1.0

            def known(shares: Array) -> Array:
                nonlocal last
                found = at(shares)
                if not np.isfinite(found).all():
                    raise _Lost
                last = shares.copy()
                return found

            within = {
                "type": "ineq",
                "fun": lambda shares: -known(shares)[1:, 0],
                "jac": lambda shares: -known(shares)[1:, 1:],
            }
            with suppress(_Lost):
                minimize(
                    lambda shares: known(shares)[0, 0] / scale, start, method="SLSQP",
                    jac=lambda shares: known(shares)[0, 1:] / scale, options=_ENDS,
                    bounds=bounds, constraints=[within] if self.asked.where else [],
                )  # fmt: skip
                return
            start = last
        inside = NonlinearConstraint(lambda shares: at(shares)[1:, 0], -np.inf, 0.0)
        minimize(
            lambda shares: at(shares)[0, 0], start, method="COBYQA", options=_RADII,
            bounds=bounds, constraints=[inside] if self.asked.where else [],
        )  # fmt: skip
