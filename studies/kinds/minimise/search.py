"""The smallest value of a number within bounds and under conditions, from several starts.

By COBYQA (Ragonneau and Zhang 2024): quadratic models without slopes, which go around failed runs.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from solver.late import Late
from solver.scenes import Scene
from studies.definition.quantity import Condition, checked_condition, number_of_a_run
from studies.definition.sweep import Axes, standings
from studies.definition.vocabulary import OK, taken
from studies.kinds.kind import Placed, Reading
from studies.kinds.ranges import Ranged, check_whole, checked_ranges
from studies.kinds.replayed import Evaluation, Lacking, Replayed

_RADII = {"initial_tr_radius": 0.2, "final_tr_radius": 0.01}  # of trust: shares of the ranges


@dataclass(frozen=True, kw_only=True)
class Minimise(Ranged):
    """What is minimised: ``of``, where conditions hold, with ``most`` runs times the places."""

    name = "minimise"
    entries = ("of", "where", "ranges", "first", "starts", "most")
    meaning = "a number that is minimised, conditions, and the parameters that are searched"
    everywhere = True
    of_runs = True
    ends = ("search_state", "open", "run")
    answers = Late("studies.kinds.minimise.answer:answers")
    found = Late("studies.kinds.minimise.shown:found")

    of: str
    where: Sequence[Condition]
    starts: int
    most: int

    @classmethod
    def checked(cls, content: Mapping[str, Any], scene: Scene, axes: Axes) -> Minimise:
        """Return what the entry of a study says."""
        number_of_a_run("minimise.of", content.get("of"), scene)
        where = content.get("where", [])
        where = where if isinstance(where, list) else [where]
        starts, most = content.get("starts", 3), content.get("most", 60)
        check_whole("minimise.starts", starts, 100)
        check_whole("minimise.most", most, 10_000)
        return cls(
            of=content["of"], where=[checked_condition("minimise.where", x, scene) for x in where],
            free=checked_ranges("minimise", content, scene), starts=starts, most=most,
        )  # fmt: skip

    @property
    def content(self) -> dict[str, Any]:
        """What `checked` reads."""
        whole = {"of": self.of, "where": [each.text for each in self.where], **super().content}
        return whole | {"starts": self.starts, "most": self.most}

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

        free = self.asked.free.values()
        spread = qmc.Halton(len(free), scramble=False).random(self.asked.starts + 1)[2:]
        lacking: list[Evaluation] = []
        for position in range(len(self.positions)):
            for start in (np.array([each.share(each.first) for each in free]), *spread):
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
