"""What chooses runs by the outcomes of others, and the runs that it asks for in a study."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

from solver.errors import ModelError
from solver.scenes import Scene
from studies.definition.expansion import Expansion
from studies.definition.parameters import build
from studies.definition.points import POINT
from studies.definition.sweep import Axes
from studies.definition.vocabulary import KEEP, NO_EQUILIBRIUM, SOLVED

Limit = Callable[[Mapping[str, Any]], bool]
"""Whether a run is the last one of its path that is needed; they come in increasing order."""


class Chooser(Protocol):
    """What asks for runs until it ends, such as a search.

    What it asks for depends only on the runs that it has asked for, and not on the order in which
    they end. One that begins anew therefore asks for the same runs, which are in the store.

    Where a class does not say otherwise, it asks for runs in rounds: no loading path serves it to
    its end, and all runs of a path are needed.
    """

    __slots__ = ()

    @property
    def wants(self) -> list[Any]:
        """The runs that it lacks now, by a key of its own; none at the end."""

    def lacking(self, known: Collection[Any]) -> list[Any]:
        """Return the runs that it lacks, without some of them that are known."""
        return [key for key in self.wants if key not in known]

    @property
    def reason(self) -> str:
        """Why it has ended; empty until then."""

    @property
    def progress(self) -> float:
        """Share that is done, 0 to 1."""

    @property
    def told(self) -> str:
        """How far it is, as text."""

    @property
    def decided(self) -> tuple[str, ...]:
        """Statuses without results that are not computed again."""
        return NO_EQUILIBRIUM

    @property
    def goes_on(self) -> bool:
        """Whether one loading path serves it to its end, see `Scene.goes_on`."""
        return False

    @property
    def largest(self) -> float:
        """A bound on the values that it asks for on a path that goes on."""
        return math.inf

    @property
    def limit(self) -> Limit | None:
        """What tells the last run that is needed on a loading path; None if all are."""
        return None

    def lacks(self, key: Any) -> bool:
        """Whether it lacks a run now."""
        return key in self.wants

    def sets(self, key: Any) -> dict[str, Any]:
        """Return the parameters that a run sets."""

    def key(self, parameters: Mapping[str, Any]) -> Any:
        """Return the key of a run with these parameters."""

    def tell(self, key: Any, row: Mapping[str, Any]) -> None:
        """Tell it of a run that it lacked."""

    def refuse(self, key: Any, refusal: str) -> bool:
        """Tell it that the scene refuses a run; return whether it needs to know this now."""


Asks = TypeVar("Asks", bound=Chooser)


@dataclass(slots=True, kw_only=True)
class Place(Generic[Asks]):
    """A program, and the runs of a study that it asks for.

    Attributes
    ----------
    scene, fixed : the scene, and the parameters of all runs here, as JSON values
    program : what asks for the runs
    keep : what is kept in addition to the results of the scene
    resume, since : as in `studies.run_study`: which failed runs are taken as they are
    """

    scene: Scene
    fixed: Mapping[str, Any]
    program: Asks
    keep: str = ""
    resume: bool = False
    since: int = 0

    def runs(self, keys: list[Any]) -> Expansion:
        """Return the runs of these keys."""
        axes: Axes = {POINT: [self.program.sets(key) for key in keys]}
        return Expansion(self.scene, self.fixed, axes)

    def refusal(self, key: Any) -> str:
        """Return what the scene says of a run that it refuses; empty if it accepts it."""
        (case,) = self.runs([key]).cases()
        try:
            build(case.scene, case.values)
        except ModelError as error:
            return str(error)
        return ""

    def stands(self, row: Mapping[str, Any]) -> bool:
        """Whether a run in the store is taken as it is."""
        if row["status"] in SOLVED:
            return self.keep in ("", row[KEEP])
        failed = self.resume and row["modified"] >= self.since
        return row["status"] in self.program.decided or failed

    def hear(self, row: Mapping[str, Any]) -> bool:
        """Tell the program of a run; return whether it had asked for it."""
        key = self.program.key(row["parameters"])
        asked = self.program.lacks(key)
        if asked:
            self.program.tell(key, row)
        return asked
