"""Refinement: runs only where the numbers of a study change in a way that was not foreseen.

The values of the axes that are numbers divide their ranges into cells; each combination of values
on the other axes is a branch, which has cells of its own. In the first round the runs at the
corners of all cells, at the middles of their edges and at their centres are computed. A cell is
halved along the axis on whose edges a run in the middle missed most what the two ends predict, if
by more than is allowed; a cell of the sweep along all axes if the run at its centre did so. The
parts ask for the runs at the middles of their edges, and so on. A cell is halved along an axis only
so often: kinks, jumps and edges of regions of failed runs are resolved to this size.

Where some runs of a cell failed and others did not, it is halved along the axes on whose edges this
changes. Its parts are bare at first: along these axes they ask for no runs in the middles of their
edges. A part whose runs failed asks for no more. One whose runs did not asks for the middles too;
if it is as small as is allowed, only where the slopes around it tell that it misses more.

What becomes of a cell depends on its own runs, and on the range of the numbers in the first round.
It is therefore divided as soon as its runs are known, if even the most runs that others may ask for
up to this round are within the largest number of runs. Otherwise it waits for the end of its round:
then those that missed most are divided first, as far as runs are left. In whichever order runs
end, the same ones are asked for.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, NamedTuple, Self

from annotated_types import Interval
from pydantic import (
    BeforeValidator,
    Field,
    PlainValidator,
    PrivateAttr,
    ValidationInfo,
    model_validator,
)

from solver.late import Late
from solver.parameters import is_number
from studies.definition.cases import Case
from studies.definition.parameters import in_unit
from studies.definition.place import Chooser
from studies.definition.quantity import OneOf, Read
from studies.definition.schema import MAXIMUM_RUNS, Context, Whole, is_finite, listed
from studies.definition.sweep import Axes, standings
from studies.definition.vocabulary import OK, taken
from studies.errors import StudyError, Unchecked
from studies.kinds.kind import EVERYWHERE, Kind, Placed, Reading
from studies.kinds.refine.cells import KINK, Around, Cell, Point, edges

STATES = SETTLED, FAILED, SMALLEST, MOST, OPEN = "settled", "failed", "smallest", "most", "open"
"""What became of a cell: its runs are as foreseen; all failed; it would be divided, but is as small
as is allowed; or no runs were left; or the refinement was stopped."""

_MOST_AXES = 4
_ROUNDING = 1e-12
"""Part of a number that is rounding: it is the same in all runs if it varies by no more."""


def _until(until: Any, info: ValidationInfo) -> float | dict[str, float]:
    """Return the largest misses: a share, or a number in its own unit for each that is refined."""
    if "of" not in info.data:
        raise Unchecked
    if is_number(until) and 1e-6 <= until <= 1.0:
        return float(until)
    known = Context.of(info).scene.known_quantities
    units = {each.name: known[each.of].units for each in info.data["of"]}
    own = until if isinstance(until, Mapping) and until.keys() == units.keys() else {}
    own = {name: in_unit(units[name], own[name], name) for name in own}
    if own and all(is_finite(each) and each > 0.0 for each in own.values()):
        return {name: float(own[name]) for name in units}
    allowed = "must be a share of the range, >= 1e-06 and <= 1, or a number > 0 for each of `of`"
    raise StudyError("", until, allowed)


class Refine(Kind):
    """Numbers of the runs, between which others are added.

    Attributes
    ----------
    of : the numbers
    until : largest miss that is allowed, as a share of the range of the numbers in the first round;
        or, by number, in its unit
    most : largest number of runs
    halvings : how often a cell of the sweep may be halved along each axis
    """

    name = "refine"
    of_runs = True
    work = "refinement"
    ends = ("cell_state", OPEN, "run")
    answers = Late("studies.kinds.refine.answer:answers")
    found = Late("studies.kinds.refine.shown:found")

    of: Annotated[
        list[OneOf],
        BeforeValidator(listed, json_schema_input_type=OneOf | list[OneOf]),
        Field(min_length=1, max_length=100),
    ]
    until: Annotated[
        float | dict[str, float],
        PlainValidator(_until, json_schema_input_type=float | dict[str, float | str]),
    ] = 0.02
    most: Annotated[Whole, Interval(ge=1, le=MAXIMUM_RUNS)] = 200
    halvings: Annotated[Whole, Interval(ge=1, le=20)] = 5
    _axes: dict[str, list[float]] = PrivateAttr()

    @model_validator(mode="after")
    def _check(self, info: ValidationInfo) -> Self:
        names = [each.name for each in self.of]
        if len(set(names)) < len(names):
            raise StudyError("of", names, "must have each number once")
        axes, known = Context.of(info).axes, Context.of(info).known
        self._axes = {
            name: sorted(values)
            for name, values in axes.items()
            if isinstance(values, list) and name in known and all(map(is_number, values))
        }
        if not 1 <= len(self.axes) <= _MOST_AXES or any(len(x) < 2 for x in self.axes.values()):
            allowed = (
                f"needs 1 to {_MOST_AXES} axes of two numbers or more: the ends of their ranges"
            )
            raise StudyError("", self.content, allowed)
        others = math.prod(len(values) for name, values in axes.items() if name not in self.axes)
        if (first := self.first_round(others)) > self.most:
            allowed = f"must be at least {first}, the runs of the first round"
            raise StudyError("most", self.most, allowed)
        return self

    @property
    def axes(self) -> Mapping[str, Sequence[float]]:
        """Values of the axes that are numbers, in increasing order."""
        return self._axes

    @property
    def value(self) -> str:
        """The first number that is refined."""
        return self.of[0].name

    def most_runs(self, places: int) -> int:
        """Return the largest number of runs."""
        del places
        return self.most

    def programs(self, axes: Axes, read: Reading, allow: Sequence[str]) -> Iterator[Placed]:
        """Yield the refinement."""
        branches = {
            tuple(each.at[axis] for axis in axes if axis not in self.axes):
            {name: value for name, value in each.sets.items() if name not in self.axes}
            for each in standings(axes)
        }  # fmt: skip
        reading = read({each.of for each in self.of})
        yield EVERYWHERE, Refinement(self, list(branches.values()), reading, allow)

    def longest(
        self, cases: Iterable[Case], branch: str
    ) -> Iterator[tuple[Case, Mapping[str, Any], list[Any]]]:
        """Yield as many paths as there may be runs, each to the largest values of the axes."""
        last = {name: values[-1] for name, values in self.axes.items()}
        places = [case for case in cases if case.values == {**case.values, **last}]
        return Kind.longest(self, places, branch)

    def cells(self, branches: int) -> Iterator[Cell]:
        """Yield the cells of the sweep."""
        intervals = [list(itertools.pairwise(values)) for values in self.axes.values()]
        for branch in range(branches):
            for box in itertools.product(*intervals):
                low, high = zip(*box, strict=True)
                yield Cell(low, high, branch, (0,) * len(box))

    def first_round(self, branches: int) -> int:
        """Return the number of runs of the first round."""
        cells = self.cells(branches)
        return len({(cell.branch, point) for cell in cells for point in cell.points})


class Wanted(NamedTuple):
    """A run: the number of its branch, and its values on the axes that are numbers."""

    branch: int
    point: Point


class RefinedCell(NamedTuple):
    """A cell that is not divided.

    Attributes
    ----------
    cell, state : the cell, and what became of it
    left : of each number the error that is left in it; empty if it has failed runs
    """

    cell: Cell
    state: str
    left: tuple[float, ...] = ()


class _Halving(NamedTuple):
    """A cell to be divided.

    Attributes
    ----------
    cell : the cell
    asks : the runs that each of its parts asks for; or the cell itself, for more runs
    miss : how far it missed what is allowed
    left : the errors that are left if it is not divided
    """

    cell: Cell
    asks: Mapping[Cell, Sequence[Point]]
    miss: float
    left: tuple[float, ...]

    @property
    def order(self) -> tuple[Any, ...]:
        """The place in its round, if not all of this can be divided."""
        return -self.miss, self.cell


def _unread(row: Mapping[str, Any]) -> Read:
    """Give no variable of a run: what its row has is enough."""
    return lambda name: None


@dataclass(slots=True)
class Refinement(Chooser):
    """The runs that a refinement asks for.

    Attributes
    ----------
    refine : what is asked for
    branches : parameters that the other axes set, for each combination of their positions
    read : gives the variables of a run, by its row
    allow : what the study allows, see `taken`
    rows : the rows of the runs it has asked for; of one that the scene refuses, the reason
    asked : the runs it has asked for, with their rounds
    settled : the cells that are not divided
    """

    refine: Refine
    branches: Sequence[Mapping[str, Any]]
    read: Callable[[Mapping[str, Any]], Read] = _unread
    allow: Sequence[str] = ()
    rows: dict[Wanted, Mapping[str, Any] | str] = field(default_factory=dict)
    asked: dict[Wanted, int] = field(default_factory=dict)
    settled: list[RefinedCell] = field(default_factory=list)
    _numbers: dict[Wanted, tuple[float, ...] | None] = field(default_factory=dict)
    _lacks: dict[Cell, int] = field(default_factory=dict)
    _waits: dict[Wanted, list[Cell]] = field(default_factory=dict)
    _known: list[Cell] = field(default_factory=list)
    _halvings: dict[int, list[_Halving]] = field(default_factory=dict)
    _rounds: Counter[int] = field(default_factory=Counter)
    _share: float = 0.0
    _allowed: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        for cell in self.refine.cells(len(self.branches)):
            self._open(cell)

    @property
    def wants(self) -> list[Wanted]:
        """The runs that it lacks."""
        return list(self._waits)

    def lacking(self, known: Collection[Wanted]) -> list[Wanted]:
        """Return the runs that it lacks, without some of them that are known."""
        some = len(known) < len(self._waits)  # at most runs nothing new is asked for
        return [wanted for wanted in self._waits if wanted not in known] if some else []

    def lacks(self, key: Wanted) -> bool:
        """Whether it lacks a run now."""
        return key in self._waits

    @property
    def reason(self) -> str:
        """Why it has ended; empty until then."""
        if self._lacks or self._halvings:
            return ""
        return MOST if MOST in {each.state for each in self.settled} else SETTLED

    @property
    def share(self) -> float:
        """Share of the ranges that is settled."""
        cells = math.prod(len(values) - 1 for values in self.refine.axes.values())
        return self._share / (cells * len(self.branches))

    @property
    def progress(self) -> float:
        """Share that is done: of the ranges, or of the runs, whichever is more."""
        return 1.0 if self.reason else max(0.99 * self.share, len(self.rows) / self.refine.most)

    @property
    def told(self) -> str:
        """The round, and how far it is from its end, as text."""
        stage = 1 + max(self._rounds, default=0)
        runs = f"run {len(self.rows)} of at most {self.refine.most}"
        return f"round {stage}, {runs}, {100 * self.share:.0f} % of the ranges settled"

    @property
    def cells(self) -> list[RefinedCell]:
        """The cells that are not divided, those included of which something is still open."""
        halvings = itertools.chain(*self._halvings.values())
        halved = (RefinedCell(each.cell, OPEN, each.left) for each in halvings)
        settled = (
            each._replace(state=OPEN) if any(map(math.isnan, each.left)) else each
            for each in self.settled
        )
        every = [*settled, *halved, *(RefinedCell(cell, OPEN) for cell in self._lacks)]
        return sorted(every, key=lambda each: (each.cell.branch, each.cell))

    def sets(self, wanted: Wanted) -> dict[str, Any]:
        """Return the parameters that a run sets."""
        return {
            **self.branches[wanted.branch],
            **dict(zip(self.refine.axes, wanted.point, strict=True)),
        }

    def tell(self, wanted: Wanted, row: Mapping[str, Any] | str) -> None:
        """Tell it of a run that it lacked, or why the scene refuses it."""
        self.rows[wanted] = row
        self._numbers[wanted] = self._numbers_of(row)
        for cell in self._waits.pop(wanted, []):
            self._lacks[cell] -= 1
            if not self._lacks[cell]:
                self._known.append(cell)
        if not self._allowed and not self._waits:
            self._allowed = self._largest_misses()
        while self._allowed and self._known:
            while self._known:
                self._decide(self._known.pop())
            self._divide()
            if not self._lacks and not self._halvings:
                self._look_around()
                self._divide()

    def key(self, parameters: Mapping[str, Any]) -> Wanted:
        """Return the key of a run with these parameters."""
        own = {name: parameters[name] for name in self.branches[0]}
        point = tuple(parameters[name] for name in self.refine.axes)
        return Wanted(list(self.branches).index(own), point)

    def refuse(self, wanted: Wanted, refusal: str) -> bool:
        """Take a run that the scene refuses as one that failed."""
        self.tell(wanted, refusal)
        return True

    def number(self, wanted: Wanted) -> tuple[float, ...] | None:
        """Return the numbers of a run; None if it failed, lacks one, or is not known yet."""
        return self._numbers.get(wanted)

    def _numbers_of(self, row: Mapping[str, Any] | str) -> tuple[float, ...] | None:
        """Return the numbers of a row; raise `StudyError` if a variable has not the place."""
        if isinstance(row, str) or taken(str(row["status"]), self.allow) != OK:
            return None
        found, read = [], None
        for k, each in enumerate(self.refine.of):
            if each.whole:
                found.append(row["scalars"].get(each.of))
                continue
            read = read or self.read(row)
            try:
                found.append(each.seen(read))
            except ValueError as error:
                raise StudyError(f"refine.of[{k}]", each.content, str(error)) from None
        return None if None in found else tuple(map(float, found))

    def _open(self, cell: Cell, points: Sequence[Point] = ()) -> None:
        """Ask for some runs of a cell: by default those that it must have."""
        stage, lacks = _round(cell), 0
        for wanted in (Wanted(cell.branch, point) for point in points or cell.points):
            self.asked[wanted] = min(self.asked.get(wanted, stage), stage)
            if wanted not in self.rows:
                self._waits.setdefault(wanted, []).append(cell)
                lacks += 1
        self._lacks[cell] = lacks
        self._rounds[stage] += 1
        if not lacks:
            self._known.append(cell)

    def _largest_misses(self) -> tuple[float, ...]:
        """Return the largest misses that are allowed, by the runs of the first round."""
        until, found = self.refine.until, [each for each in map(self.number, self.asked) if each]
        if isinstance(until, Mapping):
            return tuple(until[each.name] for each in self.refine.of)
        ends = [(min(each), max(each)) for each in zip(*found, strict=True)]
        least = [_ROUNDING * max(map(abs, each)) for each in ends]
        most = [until * (high - low) for low, high in ends]
        return tuple(map(max, most, least)) or (0.0,) * len(self.refine.of)

    def _decide(self, cell: Cell) -> None:
        """Settle a cell whose runs are known, or keep it to be divided."""
        del self._lacks[cell]
        self._rounds -= Counter([_round(cell)])
        known = {at: self.number(Wanted(cell.branch, at)) for at in cell.points}
        there = {at: each for at, each in known.items() if each is not None}
        every: set[int] = set(range(len(cell.low)))
        left: tuple[float, ...] = ()
        if not there:
            self._settle(RefinedCell(cell, FAILED))
            return
        if cell.bare and len(there) == len(known):
            least, left = cell.bared(self.refine.halvings), (math.nan,) * len(self.refine.of)
            if cell == least:
                self._settle(RefinedCell(cell, SETTLED, left))  # its neighbours tell the error
            else:
                self._keep(_Halving(cell, {least: least.points}, math.inf, left))
            return
        if len(there) < len(known):
            changes = {
                axis
                for axis, *runs in edges(cell.low, cell.high)
                if len({at in there for at in runs if at in known}) > 1
            }
            miss, axes = math.inf, changes or every
        else:
            misses = cell.misses(there)
            ratios = [self._ratio(each) for each in misses]
            worst = sorted(every, key=lambda axis: -ratios[axis])
            free = [k for k in worst if ratios[k] > 1.0 and cell.divisible(k, self.refine.halvings)]
            miss, axes = max(ratios), set(free[:1]) or {k for k in worst if ratios[k] > 1.0}
            left = tuple(KINK * sum(each) for each in zip(*misses, strict=True))
            twist = self._ratio(cell.twists(there))
            if axes and not free and twist > 1.0:
                axes = self._across(cell)  # a slanting kink is resolved along any axis
            if not axes:
                centre = Wanted(cell.branch, cell.centre)
                if centre in self.rows:
                    number = self.number(centre)
                    missed = cell.off(there, centre.point, number) if number else None
                    miss = self._ratio(missed) if missed else math.inf
                    axes = self._across(cell) if miss > 1.0 else axes
                elif twist > 1.0:
                    self._keep(_Halving(cell, {cell: [cell.centre]}, twist, left))
                    return
        self._halve(cell, axes, miss, left)

    def _across(self, cell: Cell) -> set[int]:
        """Return the axes along which a cell is halved that misses the run at its centre."""
        every = range(len(cell.low))
        can = [axis for axis in every if cell.divisible(axis, self.refine.halvings)]
        least = sorted(can or every, key=lambda axis: cell.halved[axis])
        return set(least[:1] if any(cell.halved) else every)

    def _settle(self, found: RefinedCell) -> None:
        """Keep a cell that is not divided."""
        self.settled.append(found)
        self._share += 0.5 ** sum(found.cell.halved)  # of its cell of the sweep

    def _halve(self, cell: Cell, axes: set[int], miss: float, left: tuple[float, ...]) -> None:
        """Keep a cell to be divided along those of some axes along which it can be."""
        can = [axis for axis in sorted(axes) if cell.divisible(axis, self.refine.halvings)]
        parts = cell.parts(can)
        if not left:  # some of its runs failed: what is failed needs no runs between
            parts = [each.bared(self.refine.halvings, can) for each in parts]
        if can:
            self._keep(_Halving(cell, {each: each.points for each in parts}, miss, left))
        else:
            self._settle(RefinedCell(cell, SMALLEST if axes else SETTLED, left))

    def _keep(self, halving: _Halving) -> None:
        """Keep a cell to be divided as soon as the runs that are left allow it."""
        self._halvings.setdefault(_round(halving.cell), []).append(halving)

    def _look_around(self) -> None:
        """Find the errors that are left in the cells by the runs of their neighbours.

        Cells that miss more than is allowed are to be divided after all.
        """
        settled, self.settled, self._share = self.settled, [], 0.0
        span = [values[-1] - values[0] for values in self.refine.axes.values()]
        around = Around(span, {wanted: self._numbers[wanted] for wanted in self.asked})
        for cell, state, left in settled:
            numbers = around.of(cell)
            known = {at: each for at, each in numbers.items() if each is not None}
            changes = [at for at in numbers if (at in known) != bool(left)]
            if changes and state in (SETTLED, FAILED):
                self._halve(cell, _within(cell, changes), math.inf, ())
                continue
            if changes or not left:
                self._settle(RefinedCell(cell, state))
                continue
            along, turns = around.left(cell, known)
            misses = [tuple(float(sum(each)) for each in zip(*along, strict=True))]
            if Wanted(cell.branch, cell.centre) not in self.rows:
                misses.append(tuple(map(min, zip(cell.twists(known), turns, strict=True))))
            axes: set[int] = set()
            if self._ratio(misses[0]) > 1.0:
                worst = sorted(range(len(along)), key=lambda axis: -self._ratio(along[axis]))
                can = [each for each in worst if cell.divisible(each, self.refine.halvings)]
                axes = set((can or worst)[:1])
            for at in known.keys() - {*cell.corners, *(each.middle for each in cell.edges)}:
                misses.append(cell.off(known, at, known[at]))
                if self._ratio(misses[-1]) > 1.0:
                    axes |= _within(cell, [at])
            most = tuple(map(max, zip(*misses, strict=True)))
            miss, whole = self._ratio(most), cell._replace(bare=())
            if state != SETTLED:
                self._settle(RefinedCell(cell, state, most))
            elif cell.bare and miss > 1.0:
                self._keep(_Halving(cell, {whole: whole.points}, miss, most))
            else:
                self._halve(cell, axes, miss, most)

    def _ratio(self, misses: tuple[float, ...]) -> float:
        """Return how far misses are beyond what is allowed: above 1 if they are."""
        pairs = zip(misses, self._allowed, strict=True)
        return max(
            miss / most if most else math.inf * miss if miss else 0.0 for miss, most in pairs
        )

    def _divide(self) -> None:
        """Divide the cells that may be divided now."""
        while self._halvings:
            stage = min(self._halvings)
            if (
                min(self._rounds, default=math.inf) <= stage
                and self._at_most(stage) > self.refine.most
            ):
                return
            full = False
            for cell, asks, _, left in sorted(
                self._halvings.pop(stage), key=lambda each: each.order
            ):
                new = {Wanted(cell.branch, at) for points in asks.values() for at in points}
                more = sum(each not in self.asked for each in new)
                full = full or len(self.asked) + more > self.refine.most
                if full:
                    self._settle(RefinedCell(cell, MOST, left))
                    continue
                for part, points in asks.items():
                    self._open(part, points)

    def _at_most(self, stage: int) -> int:
        """Return the most runs, if all cells up to a round are divided: those not yet known too.

        A halving asks for the middles of the new edges, and each cell may ask for its centre; one
        that is bare for the middles that it left out.
        """
        axes = len(self.refine.axes)
        each = axes * 2**axes if axes == 1 else 2**axes + (axes - 1) * 2 ** (axes - 2)
        bare = axes * 2 ** (axes - 1)
        cells = self._rounds + Counter({k: len(some) for k, some in self._halvings.items()})
        rounds = {k: stage + axes - k for k in cells if k <= stage}
        return len(self.asked) + sum(
            ((each + 1) * (2**n - 1) + bare) * cells[k] for k, n in rounds.items()
        )


def _round(cell: Cell) -> int:
    """Return the round in which a cell asks for its runs, from 0 on."""
    return sum(cell.halved)


def _within(cell: Cell, points: Sequence[Point]) -> set[int]:
    """Return the axes along which points are between the ends of a cell."""
    ends = (zip(cell.low, at, cell.high, strict=True) for at in points)
    return {k for each in ends for k, (low, x, high) in enumerate(each) if low < x < high}
