"""A scene is data; one driver runs every scene."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, NoReturn

from solver.derivatives.asked import Derivatives
from solver.errors import NotConverged, TooLong
from solver.late import late
from solver.loading.program import INCREMENT_ERROR, Program, StepRefinement
from solver.results.quantities import QUANTITIES, Quantity
from solver.results.record import Record, Status
from solver.results.view import View

_FIRST, _PER_UNKNOWN, _EXPONENT = 4e7, 3500.0, 1.15
"""Memory of a path in two dimensions [bytes]: a constant, and a factor and a power of the number of
unknowns. Measured on endless tracks of 14 000 to 81 000 unknowns; a punch needs half as much."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """The work of one loading path.

    Attributes
    ----------
    elements : number in all bodies, also in those condensed to their surface
    unknowns : displacement unknowns that no support holds, as `System.n_unknowns` counts them; the
        most, as the memory is, if smaller elements may be tried
    increments : number in all runs, shared ones counted once, if none is cut; the smallest number
        if passes end when the shakedown state is decided
    most_increments : the same with all halvings of `Scene.refinement`, or if the shakedown state is
        never decided
    divided : number of increments that yielding may add, since those with a large error are divided
    slow : ratio of the processor time of an increment to that of one with as many unknowns under
        small strain
    seconds : processor time of the increments; None if it follows from unknowns and increments
    set_up : processor time of the set-up that paths with equal `Scene.setup` share [s]
    memory : largest memory of the path without libraries [bytes]; by default it follows from the
        unknowns
    """

    elements: int
    unknowns: int
    increments: int
    most_increments: int
    divided: int = 0
    slow: float = 1.0
    seconds: float | None = None
    set_up: float = 0.0
    memory: float = 0.0

    def __post_init__(self) -> None:
        if not self.memory:
            object.__setattr__(self, "memory", _FIRST + _PER_UNKNOWN * self.unknowns**_EXPONENT)

    def without(self, other: Effort) -> Effort:
        """Return the work of a path that begins where another one has ended."""
        known = None if self.seconds is None else self.seconds - (other.seconds or 0.0)
        return replace(
            self,
            increments=self.increments - other.increments,
            most_increments=self.most_increments - other.increments,
            seconds=known,
        )


Monitor = Callable[[float], None]
"""Called after every increment with the fraction of the work done (0-1).
An exception it raises stops the work and reaches the caller unchanged."""

Advice = Mapping[Status | type[NotConverged] | str, str]
"""What the user can do, by status, by error, or by the figure of the audit that is violated."""

Method = Callable[..., Iterator[Any]]
"""(scene, parameters of the runs, monitor) -> their `FinishedRun`s, in the order of the branch
parameter; with ``begun`` of `Scene.path` too, if they have a ``state``."""

Output = Callable[[Any], Mapping[Quantity, Any]]
"""Computes some quantities of a `FinishedRun`."""

_by_increments, _record = late("scenes.driver", "by_increments", "record")


def _no_increments(parameters: Any) -> NoReturn:
    """Raise: neither model nor program of increments is known."""
    raise NotImplementedError("this scene is computed by its own method alone, not by increments")


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """A named problem. It imports nothing that computes: its functions may be `Late`.

    Attributes
    ----------
    name : as written in study files
    summary : one line
    parameters : frozen, keyword-only dataclass; every field has a default, an
        ``annotated_types`` constraint where it has a range, an ``annotated_types.Unit`` and a
        ``description`` in the field's metadata. Building it checks it (``ModelError``).
    branch : name of the branch parameter: runs that differ only in it share increments. The run of
        a larger value continues that of a smaller one, or leaves it later. Empty if there is none
    model : (parameters) -> `Model`; the same for all values of ``branch``. A scene whose ``method``
        needs no increments has neither model nor program
    program : (parameters) -> loading history; a stage ``unloaded`` ends every lap
    view : (parameters) -> positions of results
    sketch : (parameters) -> `Sketch`, where its model is not what is computed, else None
    places : (parameters) -> `NamedPlaces` and the numbers requested at them
    outputs : functions that compute quantities of a complete `FinishedRun`
    costs : functions that compute quantities of every run, also of one that failed
    method : (parameters) -> method that computes runs that differ in ``branch``; without it
        `by_increments`
    trace : (samples, states of a lap) -> data stored for each lap in ``outcome.traces``
    until : (parameters) -> whether repeated stages end when their shakedown state is decided
    watch : (parameters, samples, converged increment) -> data stored for it in ``outcome.history``
    refinement : (parameters) -> how increments are halved, or None for those of the program
    increment_error : largest error of stress, over the yield stress, that the length of an
        increment may add before it is divided: see `Control`
    effort : (parameters, values of ``branch``) -> work of the loading path. It must answer in
        microseconds; if it needs a mesh, once for each `setup`. Without it a study is estimated
        from its runs alone
    setup : (parameters) -> what an expensive set-up depends on, which a process keeps for its next
        run; a study gives runs with an equal one to the same worker. It must take milliseconds, as
        it is asked for every path before the first is computed
    warnings : (run) -> texts for the user, added to the message of its record
    advice : status, or the class of the error that ended a run, which comes before it -> the one
        thing that the user can do; or (parameters) -> such a table
    quantities : quantities that only this scene declares
    source : digest of the data it was made from, if any; it counts in the ids of runs
    derivatives : what its runs derive by which parameters; none by default
    derives : time of a neighbouring run over that of a run, if its own ``method`` computes
        derivatives; 0 if it has none
    allow : what all its studies allow: with ``large_strain`` runs outside small-strain theory are
        ok
    """

    name: str
    summary: str
    parameters: type[Any]
    branch: str
    model: Callable[[Any], Any] = _no_increments
    program: Callable[[Any], Program] = _no_increments
    view: Callable[[Any], View]
    outputs: tuple[Output, ...]
    costs: tuple[Output, ...]
    sketch: Callable[[Any], Any] | None = None
    places: Callable[[Any], Any] | None = None
    method: Callable[[Any], Method] | None = None
    trace: Callable[[Any, Mapping[str, Any]], Any] | None = None
    until: Callable[[Any], bool] | None = None
    watch: Callable[[Any, Any, Any], Any] | None = None
    refinement: Callable[[Any], StepRefinement | None] | None = None
    increment_error: float = INCREMENT_ERROR
    effort: Callable[[Any, Sequence[float]], Effort] | None = None
    setup: Callable[[Any], Hashable] | None = None
    warnings: Callable[[Any], tuple[str, ...]] | None = None
    advice: Advice | Callable[[Any], Advice] = field(default_factory=dict, hash=False)
    quantities: tuple[Quantity, ...] = ()
    source: str = ""
    derivatives: Derivatives | None = None
    derives: float = 0.0
    allow: tuple[str, ...] = ()

    def path(
        self, parameters: Any, values: Sequence[float], monitor: Monitor,
        begun: Mapping[str, Any] | None = None,
    ) -> Iterator[Record]:  # fmt: skip
        """Yield one record for each value of the branch parameter, in increasing order.

        Each is yielded as soon as it is known, also that of a failed run. A scene without a branch
        parameter yields one record.

        Parameters
        ----------
        begun : `Record.state` of a run with a smaller value than all of these, to go on from;
            without effect if runs have derivatives: their neighbours have no state
        """
        runs = [parameters]
        if self.branch:
            kind = type(getattr(self.parameters(), self.branch))
            runs = [replace(parameters, **{self.branch: kind(value)}) for value in sorted(values)]
        method: Method = self.method(runs[-1]) if self.method else _by_increments
        method = partial(method, begun=begun) if begun and not self.derivatives else method
        for each, run in zip(runs, method(self, runs, monitor), strict=True):
            yield replace(self.record(run), parameters=each)
        monitor(1.0)

    def refuse(self, parameters: Any, samples: Any) -> None:
        """Refuse outputs that runs in these `Samples` cannot have, before they are computed.

        Raises
        ------
        ModelError
            that names the entry
        """
        for output in self.outputs:
            if hasattr(output, "before"):
                output.before(parameters, samples.system, samples.view)

    @property
    def known_quantities(self) -> Mapping[str, Quantity]:
        """The quantities that its runs may have, by name."""
        return {**QUANTITIES, **{each.name: each for each in self.quantities}}

    @property
    def goes_on(self) -> bool:
        """Whether a loading path goes on for values that are asked for later: see `follow`."""
        return bool(self.branch) and self.method is None and type(self).path is Scene.path

    def follow(
        self, parameters: Any, values: Iterable[float], largest: float, monitor: Monitor
    ) -> Iterator[Record]:
        """Yield one record for each value of the branch parameter, which may depend on the last.

        The next value is asked for after the record of the one before. Its run goes on from where
        the path has been below it. The records are those of `path`.

        Parameters
        ----------
        values : in any order
        largest : a bound on the values
        """
        kind = type(getattr(self.parameters(), self.branch))
        last = replace(parameters, **{self.branch: kind(largest)})
        runs = (replace(parameters, **{self.branch: kind(value)}) for value in values)
        for run in _by_increments(self, runs, monitor, last):
            yield self.record(run)

    def remedy(
        self,
        parameters: Any,
        error: NotConverged | None,
        status: Status = Status.NOT_CONVERGED,
        violated: Sequence[str] = (),
    ) -> str:
        """Return what the user can do about an outcome; empty if nothing is known.

        `TooLong` has its own advice, opposite to a finer mesh.
        """
        if isinstance(error, TooLong):
            return ""
        table = self.advice(parameters) if callable(self.advice) else self.advice
        reasons: tuple[Any, ...] = (*violated, *type(error).__mro__, status)
        return next((table[each] for each in reasons if each in table), "")

    def record(self, run: Any) -> Record:
        """Return the record of a `FinishedRun`."""
        record: Record = _record(self, run)
        return record
