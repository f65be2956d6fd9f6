"""A scene is data; one driver runs every scene."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import tee
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn

from solver.errors import LimitLoad, TooLong
from solver.loading.control import INCREMENT_ERROR, Control
from solver.loading.outcome import Outcome
from solver.loading.program import Program, walked
from solver.loading.refinement import StepRefinement
from solver.model.model import Model
from solver.results.audit.figures import AUDIT
from solver.results.mesh_fields import mesh_fields
from solver.results.outlines import outlines
from solver.results.quantities import QUANTITIES, Quantity
from solver.results.record import Record, Status
from solver.results.run import FinishedRun, Output, Values
from solver.results.singular_points import singular_points
from solver.results.view import View
from solver.scenes.effort import Effort

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from solver.model.body import Body
    from solver.results.audit.report import Audit
    from solver.results.named_places import NamedPlaces
    from solver.results.samples import Samples

Monitor = Callable[[float], None]
"""Called after every increment with the fraction of the work done (0-1).
An exception it raises stops the work and reaches the caller unchanged."""

Method = Callable[["Scene", Sequence[Any], Monitor], Iterator[FinishedRun]]
"""Computes runs of a scene from their parameters, in the order of the branch parameter."""


def _no_increments(parameters: Any) -> NoReturn:
    """Raise: neither model nor program of increments is known."""
    del parameters
    raise NotImplementedError("this scene is computed by its own method alone, not by increments")


class Sketch(NamedTuple):
    """The bodies of a scene before loading, in the plane of its map, where it has no model.

    Attributes
    ----------
    bodies : bodies with the meshes on which the scene is computed
    pairs : sides (body, boundary) that may touch
    springs : boundaries on springs, by body
    curves : (2, n) more surfaces by name [mm]
    """

    bodies: tuple[Body, ...]
    pairs: tuple[tuple[tuple[str, str], ...], ...] = ()
    springs: Mapping[str, Sequence[str]] = {}
    curves: Mapping[str, NDArray[np.float64]] = {}


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """A named problem.

    Attributes
    ----------
    name : as written in study files
    summary : one line
    parameters : frozen, keyword-only dataclass; every field has a default, an
        ``annotated_types`` constraint where it has a range, an ``annotated_types.Unit`` and a
        ``description`` in the field's metadata. Building it checks it (``ModelError``).
    branch : name of the branch parameter: runs that differ only in it share increments. The run of
        a larger value continues that of a smaller one, or leaves it later. Empty if there is none
    model : (parameters) -> bodies and contact; the same for all values of ``branch``. A scene
        whose ``method`` needs no increments has neither model nor program
    program : (parameters) -> loading history; a stage ``unloaded`` ends every lap
    view : (parameters) -> positions of results
    sketch : (parameters) -> its bodies, where its model is not what is computed, else None
    places : (parameters) -> named places and numbers requested at them
    outputs : functions that compute quantities of a complete run
    costs : functions that compute quantities of every run, also of one that failed
    method : (parameters) -> method that computes runs that differ in ``branch``; without it
        `by_increments`
    trace : (samples, states of a lap) -> data stored for each lap in ``outcome.traces``
    until : (parameters) -> whether repeated stages end when their shakedown state is decided
    watch : (parameters, samples, converged increment) -> data stored for it in ``outcome.history``
    refinement : (parameters) -> how increments are halved, or None for those of the program
    increment_error : largest error of stress, over the yield stress, that the length of an
        increment may add before it is divided: see `Control`
    effort : (parameters, values of ``branch``) -> work of the loading path, in microseconds or, if
        it needs a mesh, once for each `setup`; without it a study is estimated from its runs alone
    setup : (parameters) -> what an expensive set-up depends on, which a process keeps for its next
        run; a study gives runs with an equal one to the same worker. It must take milliseconds, as
        it is asked for every path before the first is computed
    warnings : (run) -> texts for the user, added to the message of its record
    advice : status -> what the user can do; or (parameters) -> such a table
    quantities : quantities that only this scene declares
    source : digest of the data it was made from, if any; it counts in the ids of runs
    allow : what all its studies allow: with ``large_strain`` runs outside small-strain theory are
        ok
    """

    name: str
    summary: str
    parameters: type[Any]
    branch: str
    model: Callable[[Any], Model] = _no_increments
    program: Callable[[Any], Program] = _no_increments
    view: Callable[[Any], View]
    outputs: tuple[Output, ...]
    costs: tuple[Output, ...]
    sketch: Callable[[Any], Sketch | None] | None = None
    places: Callable[[Any], NamedPlaces] | None = None
    method: Callable[[Any], Method] | None = None
    trace: Callable[[Samples, Mapping[str, Any]], Any] | None = None
    until: Callable[[Any], bool] | None = None
    watch: Callable[[Any, Samples, Any], Any] | None = None
    refinement: Callable[[Any], StepRefinement | None] | None = None
    increment_error: float = INCREMENT_ERROR
    effort: Callable[[Any, Sequence[float]], Effort] | None = None
    setup: Callable[[Any], Hashable] | None = None
    warnings: Callable[[FinishedRun], tuple[str, ...]] | None = None
    advice: Mapping[Status, str] | Callable[[Any], Mapping[Status, str]] = field(
        default_factory=dict, hash=False
    )
    quantities: tuple[Quantity, ...] = ()
    source: str = ""
    allow: tuple[str, ...] = ()

    def path(self, parameters: Any, values: Sequence[float], monitor: Monitor) -> Iterator[Record]:
        """Yield one record for each value of the branch parameter, in increasing order.

        Each is yielded as soon as it is known, also that of a failed run. A scene without a branch
        parameter yields one record.
        """
        runs = [parameters]
        if self.branch:
            kind = type(getattr(self.parameters(), self.branch))
            runs = [replace(parameters, **{self.branch: kind(value)}) for value in sorted(values)]
        method = self.method(runs[-1]) if self.method else by_increments
        for each, run in zip(runs, method(self, runs, monitor), strict=True):
            yield replace(self.record(run), parameters=each)
        monitor(1.0)

    @property
    def known_quantities(self) -> Mapping[str, Quantity]:
        """The quantities that its runs may have, by name."""
        return QUANTITIES | {each.name: each for each in self.quantities}

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
        for run in by_increments(self, runs, monitor, last):
            yield self.record(run)

    def record(self, run: FinishedRun) -> Record:
        """Return the record of a run."""
        cost = _merged(run, self.costs)
        if not run.complete:
            limit = isinstance(run.outcome.error, LimitLoad)
            status = Status.LIMIT_LOAD if limit else Status.NOT_CONVERGED
            messages = (*run.notes, str(run.outcome.error))
            return self._labelled(run, status, messages, cost)
        from solver.results.audit.stored import stored  # loads scipy

        check = run.check()
        status = Status.OUTSIDE_THEORY if check.outside else Status.OK
        states = {stage: run.outcome.points[stage] for stage in run.view.stages}
        own = self.warnings(run) if self.warnings else ()
        figures = {AUDIT[name]: figure for name, figure in check.figures.items()}
        values = {**cost, **figures, **_merged(run, (singular_points, outlines, *self.outputs))}
        written = self._labelled(run, Status.OK, (), values)
        places = self.places(run.parameters) if self.places else None
        comparison = stored(run, written, self.view(run.parameters), places)
        violations = check.violations + comparison.violations
        if violations:
            status = Status.AUDIT_FAILED
        messages = violations + check.outside + run.notes + check.warnings + own
        return replace(
            written,
            status=status,
            message=self._message(run, status, messages),
            scalars={**written.scalars, "audit_stored": comparison.figure},
            mesh=partial(mesh_fields, run.samples.fields, states, run.beside),
        )

    def _message(self, run: FinishedRun, status: Status, messages: tuple[str, ...]) -> str:
        """Return the message of a run; `TooLong` has its own advice, opposite to a finer mesh."""
        table = self.advice(run.parameters) if callable(self.advice) else self.advice
        advice = None if isinstance(run.outcome.error, TooLong) else table.get(status)
        return "; ".join((*messages, advice) if advice else messages)

    def _labelled(
        self, run: FinishedRun, status: Status, messages: tuple[str, ...], values: Values
    ) -> Record:
        own = {q.name: value for q, value in values.items() if q.coordinate}
        return Record(
            parameters=run.parameters,
            status=status,
            message=self._message(run, status, messages),
            coordinates={**run.view.coordinates, **own},
            fields={
                q.name: (q.dims, value)
                for q, value in values.items()
                if q.dims and not q.coordinate
            },
            scalars={q.name: value for q, value in values.items() if not q.dims},
            symmetric=run.view.symmetric,
        )


def _merged(run: FinishedRun, outputs: Sequence[Output]) -> Values:
    values: dict[Quantity, Any] = {}
    names: set[str] = set()
    for output in outputs:
        for quantity, value in output(run).items():
            if quantity.name in names:
                raise ValueError(f"two outputs of the scene give {quantity.name}")
            names.add(quantity.name)
            values[quantity] = value
    return values


def by_increments(
    scene: Scene, runs: Iterable[Any], monitor: Monitor, largest: Any = None
) -> Iterator[FinishedRun]:
    """Solve the programs of runs that differ in the branch parameter; yield each when finished.

    With `largest`, a bound on the runs, the next run is asked for when the one before is finished.
    """
    # these take half a second to import
    from solver.contact.system import System
    from solver.loading.walker import Walker
    from solver.results.audit.pairs import untouched
    from solver.results.audit.report import audit
    from solver.results.cycles import decided
    from solver.results.samples import Samples
    from solver.results.tractions import tractions_of

    given = list(runs) if largest is None else None
    last = given[-1] if given is not None else largest
    system = System(scene.model(last))
    samples = Samples(system, scene.view(last))
    tractions = tractions_of(system, symmetric=samples.view.symmetric, axis=samples.view.axis)
    programs: Iterable[Program]
    if given is not None:
        runs, bound = given, None
        programs = listed = [scene.program(run) for run in given]
        report = _counted(listed, monitor)
    else:
        runs, asked = tee(runs)
        bound, programs = scene.program(largest), map(scene.program, asked)
        report = partial(monitor, 0.0)  # how much is still to be asked for is not known
    walker = Walker(
        system,
        Control(increment_error=scene.increment_error),
        trace=partial(scene.trace, samples) if scene.trace else None,
        refinement=scene.refinement(last) if scene.refinement else None,
        until=partial(decided, laws=system.laws) if scene.until and scene.until(last) else None,
        report=report,
        watch=partial(scene.watch, last, samples) if scene.watch else None,
    )
    view = samples.view
    for outcome, run in zip(walker.walk(programs, bound), runs, strict=True):

        def check(outcome: Outcome = outcome) -> Audit:
            loaded, unloaded = outcome.points[view.loaded], outcome.points.get(view.unloaded)
            tally = outcome.tally
            stages = outcome.points.values()
            return audit(system, loaded, unloaded, tally.dissipation, tally.lost, stages)

        # in the rest of a run that failed, any pair could have come into contact
        notes = () if outcome.error else untouched(system, outcome.points.values())
        yield FinishedRun(
            parameters=run,
            samples=samples,
            tractions=tractions,
            outcome=outcome,
            check=check,
            singular=system.model.singular,
            notes=(*system.model.doubts, *notes),
        )


def _counted(programs: Sequence[Program], monitor: Monitor) -> Callable[[], None]:
    """Return a function to call after each increment, which reports the share done."""
    expected = walked(programs)
    done = 0

    def report() -> None:
        nonlocal done
        done += 1
        monitor(min(done / expected, 0.99))

    return report
