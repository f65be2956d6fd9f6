"""Computes the runs of a scene, and their records."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import tee
from typing import Any

from solver.audit.figures import AUDIT
from solver.audit.pairs import untouched
from solver.audit.report import Audit, audit
from solver.contact.system import System
from solver.errors import LimitLoad
from solver.late import Late
from solver.loading.outcome import Outcome
from solver.loading.program import Control, Program, walked
from solver.loading.walker import Walker
from solver.results.acting import acting_on
from solver.results.cycles import decided
from solver.results.fields import Samples
from solver.results.maps import outlines
from solver.results.quantities import Quantity
from solver.results.record import Record, Status
from solver.results.run import FinishedRun, Output, Values
from solver.results.singularity import singular_points
from solver.scenes.scene import Monitor, Scene

_Family = Late("solver.derivatives.family:IncrementalFamily")


def record(scene: Scene, run: FinishedRun) -> Record:
    """Return the record of a run."""
    cost = _merged(run, scene.costs)
    if not run.complete:
        limit = isinstance(run.outcome.error, LimitLoad)
        status = Status.LIMIT_LOAD if limit else Status.NOT_CONVERGED
        messages = (*run.doubts, *run.notes, str(run.outcome.error))
        return _labelled(scene, run, status, messages, cost)
    check = run.check()
    status = Status.OUTSIDE_THEORY if check.outside else Status.OK
    states = {stage: run.outcome.points[stage] for stage in run.view.stages}
    own = scene.warnings(run) if scene.warnings else ()
    figures = {AUDIT[name]: figure for name, figure in check.figures.items()}
    values = {**cost, **figures, **_merged(run, (singular_points, outlines, *scene.outputs))}
    if run.derived is not None and scene.derivatives is not None:
        derived = run.derived(run, scene.outputs)
        values |= derived
        own = (*own, *scene.derivatives.notes(derived))
    if check.violations:
        status = Status.AUDIT_FAILED
    messages = run.doubts + check.violations + check.outside + run.notes + check.warnings + own
    return replace(
        _labelled(scene, run, status, messages, values),
        mesh=partial(run.samples.fields.on_mesh, states, run.beside),
        state=run.state,
    )


def _message(scene: Scene, run: FinishedRun, status: Status, messages: tuple[str, ...]) -> str:
    """Return the message of a run, with what the user can do.

    A message of a violation begins with the name of its figure.
    """
    violated = [each.partition(" ")[0] for each in messages]
    error = run.outcome.error
    advice = (
        scene.remedy(run.parameters, error, status, violated) if status is not Status.OK else ""
    )
    return "; ".join((*messages, advice) if advice else messages)


def _labelled(
    scene: Scene, run: FinishedRun, status: Status, messages: tuple[str, ...], values: Values
) -> Record:
    own = {q.name: value for q, value in values.items() if q.coordinate}
    return Record(
        parameters=run.parameters,
        status=status,
        message=_message(scene, run, status, messages),
        coordinates={**run.view.coordinates, **own},
        fields={
            q.name: (q.dims, value) for q, value in values.items() if q.dims and not q.coordinate
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
    """Solve the programs of runs that differ in the branch parameter; yield each run when finished.

    With `largest`, a bound on the runs, the next run is asked for when the one before is finished.
    """
    given = list(runs) if largest is None else None
    last = given[-1] if given is not None else largest
    system = System(scene.model(last))
    samples = Samples(system, scene.view(last))
    scene.refuse(last, samples)
    family = _Family(scene.derivatives, scene, last, system, samples) if scene.derivatives else None
    program = family.program if family else scene.program
    watch = partial(scene.watch, last, samples) if scene.watch else None
    if watch and family:
        watch = partial(family.watched, scene.watch)
    acting = acting_on(system, symmetric=samples.view.symmetric, axis=samples.view.axis)
    programs: Iterable[Program]
    if given is not None:
        runs, bound = given, None
        programs = listed = [program(run) for run in given]
        report = _counted(listed, monitor)
    else:
        runs, asked = tee(runs)
        bound, programs = program(largest), map(program, asked)
        report = partial(monitor, 0.0)  # how much is still to be asked for is not known
    walker = Walker(
        system,
        Control(increment_error=scene.increment_error),
        trace=partial(scene.trace, samples) if scene.trace else None,
        refinement=scene.refinement(last) if scene.refinement else None,
        until=partial(decided, laws=system.laws) if scene.until and scene.until(last) else None,
        report=report,
        watch=watch,
        followers=family.followers if family else None,
    )
    view = samples.view
    for walked_to, run in zip(walker.walk(programs, bound), runs, strict=True):
        outcome, derived = walked_to, None
        if family:
            derived = partial(family.derived, outcome.history)
            outcome = replace(outcome, history=tuple(own[0] for own in outcome.history))

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
            acting=acting,
            outcome=outcome,
            check=check,
            singular=system.model.singular,
            doubts=system.model.doubts,
            notes=notes,
            derived=derived,
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
