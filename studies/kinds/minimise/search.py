"""The smallest value of a number within bounds and under conditions, from several starts.

By COBYQA (Ragonneau and Zhang 2024): quadratic models without slopes, which go around failed runs.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Self

import numpy as np
from annotated_types import Interval
from pydantic import BeforeValidator, Field, model_validator

from solver.late import Late
from studies.definition.quantity import OneCondition, OneNumber
from studies.definition.schema import Whole, listed
from studies.definition.sweep import Axes, standings
from studies.definition.vocabulary import OK, taken
from studies.errors import StudyError
from studies.kinds.kind import EVERYWHERE, Placed, Reading
from studies.kinds.ranged import Evaluation, Lacking, Ranged, Replayed

_RADII = {"initial_tr_radius": 0.2, "final_tr_radius": 0.01}  # of trust: shares of the ranges


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

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.most < self.starts:
            raise StudyError("most", self.most, f"must be at least {self.starts}, that of starts")
        return self

    @property
    def value(self) -> str:
        """The number that is minimised."""
        return self.of

    def most_runs(self, places: int) -> int:
        """Return the most runs at so many places."""
        return places * self.most

    def programs(self, axes: Axes, read: Reading, allow: Sequence[str]) -> Iterator[Placed]:
        """Yield the searches from all starts, at all places of the axes."""
        yield EVERYWHERE, Minimising(self, standings(axes), allow)


@dataclass(slots=True)
class Minimising(Replayed):
    """The searches for the smallest value."""

    asked: Minimise
    allow: Sequence[str]

    def seen(self, key: Evaluation, row: Mapping[str, Any]) -> list[float] | None:
        """Return the number, and how far each condition is broken; None of a run that failed."""
        names = [self.asked.of, *(each.name for each in self.asked.where)]
        numbers = [row["scalars"].get(name) for name in names]
        if taken(row["status"], self.allow) != OK or None in numbers:
            return None
        pairs = zip(self.asked.where, numbers[1:], strict=True)
        return [numbers[0], *(each.over(value) for each, value in pairs)]

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

    def _search(self, start: np.ndarray, position: int) -> None:
        from scipy.optimize import NonlinearConstraint, minimize

        def at(shares: np.ndarray) -> np.ndarray:
            key = Evaluation(self.asked.values_at(shares), position)
            if key not in self.known:
                raise Lacking([key])
            return np.array(self.known[key] or [np.nan] * (1 + len(self.asked.where)))

        inside = NonlinearConstraint(lambda shares: at(shares)[1:], -np.inf, 0.0)
        minimize(
            lambda shares: at(shares)[0], start, method="COBYQA", options=_RADII,
            bounds=[(0.0, 1.0)] * len(start), constraints=[inside] if self.asked.where else [],
        )  # fmt: skip
