"""A method of a library as a program that asks for runs.

After each answer the method begins anew with what is known, up to the first run that lacks. What it
asks for depends only on the runs that it has asked for, so that one that is taken up after a crash
asks for the same runs.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from studies.definition.identity import canonical
from studies.definition.place import Chooser
from studies.definition.sweep import Standing

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
