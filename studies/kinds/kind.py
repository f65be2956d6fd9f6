"""What a kind of study is: what it asks for, the programs that choose its runs, what it has found.

A `SweepStudy` has the runs of its axes. All other kinds have an entry of their own in a study, a
table whose model is a subclass of `Kind`, and programs (`studies.definition.place.Chooser`) that
ask for runs. Run, estimate, task, store, views and service know no more of a kind than this. A kind
imports nothing that reads or draws results: its functions of results may be `Late`.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, Self

from solver.late import Late
from solver.scenes import Scene
from studies.definition.cases import Case
from studies.definition.place import Chooser
from studies.definition.points import Points
from studies.definition.quantity import Read
from studies.definition.schema import Context, StudyTable, parsed
from studies.definition.sweep import Axes, Standing
from studies.definition.vocabulary import STOPPED

Reading = Callable[[Collection[str]], Callable[[Mapping[str, Any]], Read]]
"""Returns what gives some variables of a run, by its row."""


Placed = tuple[Standing, Chooser]
"""Where on the axes a program asks for runs, and the program."""
EVERYWHERE = Standing({}, {})
"""The place of a program that sets the parameters of the axes itself."""


class Trial(NamedTuple):
    """Runs of a study that are checked before it begins: what they set besides the sweep.

    ``fields`` has the entries of the study that mistakes name, by those of the runs.
    """

    fixed: Mapping[str, Any]
    axes: Axes
    fields: Mapping[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Answers:
    """What a study has found, of which its data set is made.

    Attributes
    ----------
    content : the variables of the data set, besides those of its runs and their ids
    points : the runs that the data set holds; None if it holds answers
    outcomes : of each answer a run, the status and the message
    of : what the answers were made of
    """

    content: Callable[[], Mapping[str, Any]]
    points: Points | None = None
    outcomes: Sequence[tuple[str, str, str]] = ()
    of: str = ""


Mark = Mapping[str, tuple[Any, Any, Any]]
"""A place by parameter: value, and lower and upper end of what is known of it, or None."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """What was found.

    Attributes
    ----------
    about : what was asked for, and how the work ended, a sentence each
    warning : what makes it doubtful; empty if nothing does
    headings, units, rows : a table; its texts for each column
    words : number of the first columns that are words
    marks : a place for each answer that has one
    """

    about: Sequence[str]
    headings: Sequence[str]
    units: Sequence[str]
    rows: Sequence[Sequence[str]]
    words: int
    marks: Sequence[Mark] = ()
    warning: str = ""


class Kind(StudyTable):
    """A kind of study, and of a study what its entry says: its fields.

    Attributes
    ----------
    name : the entry of studies
    chooses : whether programs choose its runs by the outcomes of others
    everywhere : whether each place of its axes has runs of its own
    of_runs : whether its data set holds runs, not answers; if it chooses them, over ``point``
    rows, counted, work : what a report, the numbers by status and a message call its results, these
        by status, and its work
    example : the variable of its data set that has the id of a run worth opening
    ends : the variable of its data set that says whether it has ended, the word of what has not,
        and the variable of the ids of runs
    answers : (study, its choosers) -> `Answers`
    found : (data set, entry) -> `Found`
    table, figure : (data set) -> text, or figure, of its report; None for those of runs
    """

    name: ClassVar[str]
    chooses: ClassVar[bool] = True
    everywhere: ClassVar[bool] = False
    of_runs: ClassVar[bool] = False
    rows: ClassVar[str] = "runs"
    counted: ClassVar[str] = "runs"
    work: ClassVar[str] = "search"
    example: ClassVar[str] = "tried_run"
    ends: ClassVar[tuple[str, str, str]] = ("message", STOPPED, "tried_run")
    answers: ClassVar[Late]
    found: ClassVar[Late]
    table: ClassVar[Late | None] = None
    figure: ClassVar[Late | None] = None

    @classmethod
    def read(cls, content: Any, scene: Scene | None, axes: Axes | None) -> Self:
        """Return what the entry of a study says; a scene or axes with mistakes are None.

        Raises
        ------
        StudyError
            naming the entry, its value and what is allowed
        """
        return parsed(cls, content, Context(scene, axes))

    @classmethod
    def with_files(cls, content: Any, folder: Path, given: Sequence[Path]) -> Any:
        """Return the entry with what is in files beside the study, or in those that are given."""
        return content

    @classmethod
    def searched(cls, content: Mapping[str, Any]) -> Mapping[str, str]:
        """Return the parameters that programs set besides the axes, with their fields."""
        return {}

    @property
    def content(self) -> dict[str, Any]:
        """What is read, normalised."""
        return self.model_dump()

    @property
    def begins(self) -> Mapping[str, Any]:
        """The parameters with which it begins at a place of the axes."""
        return {}

    @property
    def trial(self) -> Trial:
        """The runs that are checked."""
        return Trial({}, {}, {})

    @property
    def value(self) -> str:
        """A number that its data set has for each place or run, to be drawn; empty if none."""
        return ""

    @property
    def expects(self) -> bool:
        """Whether programs begin where their neighbours' ``found`` lets `expected` be."""
        return False

    def most_runs(self, places: int) -> int:
        """Return the largest number of runs, with so many places on the axes."""
        raise NotImplementedError

    def usual_runs(self, places: int) -> int:
        """Return the number of runs that are expected, at most that of `most_runs`."""
        return self.most_runs(places)

    def stage(self, places: int, ended: int, told: str) -> str:
        """Return how far it is, as text: see `Study.stage`."""
        return "ended" if ended else told or f"at most {self.most_runs(places)} runs"

    def programs(self, axes: Axes, read: Reading, allow: Sequence[str]) -> Iterator[Placed]:
        """Yield what asks for the runs of a study with these axes, and entry ``allow``."""
        raise NotImplementedError

    def longest(
        self, cases: Iterable[Case], branch: str
    ) -> Iterator[tuple[Case, Mapping[str, Any], list[Any]]]:
        """Yield the loading paths that cost most.

        Parameters
        ----------
        cases, branch : the places of the axes, and the branch parameter of the scene

        Yields
        ------
        a place, the parameters that differ there, and the values of the branch
        """
        places = list(cases)
        for case in itertools.islice(itertools.cycle(places), self.most_runs(len(places))):
            yield case, self.begins, [{**case.values, **self.begins}.get(branch)]


class SweepStudy(Kind):
    """A study without an entry of another kind."""

    name = "sweep"
    chooses = False
    everywhere = True
    of_runs = True

    def most_runs(self, places: int) -> int:
        """Return the number of places."""
        return places

    def stage(self, places: int, ended: int, told: str) -> str:
        """Return nothing: its progress says all."""
        return ""
