"""The neighbouring runs of a scene, and the derivatives of its results by their differences."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any
from zlib import crc32

import numpy as np
from skfem import Mesh

from solver.contact.state import Converged
from solver.contact.system import System
from solver.derivatives.asked import AUDITED, WIDER, Derivatives, named, reach
from solver.derivatives.neighbours import NeighbouringRuns
from solver.errors import ModelError
from solver.loading.outcome import IncrementFailed
from solver.loading.program import Program
from solver.results.acting import acting_on
from solver.results.fields import Samples
from solver.results.quantities import QUANTITIES
from solver.results.run import FinishedRun, Output, Values
from solver.typing import Array

_JUMP = 1e-3
"""Change of a number over the number, above which it jumps, as the place of a maximum that two
places share does. It has no derivative. Changes of a line or a map are relative to its largest
value."""

_FINE, _WIDEST = 1e5, 30.0
"""Extent of a mesh over its shortest edge above which differences are wider, and by which factor:
rounding of displacements causes forces of about 1e-15 times this extent."""


class Family:
    """The neighbouring runs of a path of a scene.

    Parameters
    ----------
    asked : the derivatives
    scene : the scene
    run : parameters of the last run of the path
    wider : parameters whose differences are wider

    Raises
    ------
    ModelError
        naming a parameter by which no derivative exists
    """

    def __init__(self, asked: Derivatives, scene: Any, run: Any, wider: Iterable[str] = ()) -> None:
        self._asked, self._scene, self._wider = asked, scene, dict.fromkeys(wider, WIDER)
        self._ways = dict[str, int]()
        self._declared = asked.quantities(type(run), scene.known_quantities)

    def runs(self, run: Any) -> list[Any]:
        """Return the parameters of the neighbours of a run."""
        steps = self.steps(run)
        return [replace(run, **{name: getattr(run, name) + steps[name]}) for name in steps]

    def steps(self, run: Any) -> dict[str, float]:
        """Return the difference of each parameter by which a run is derived."""
        steps = self._asked.steps(run, self._wider).items()
        return {name: step * way for name, step in steps if (way := self._ways.get(name, 1))}

    def keep_mesh(self, run: Any, same: Callable[[Any], bool]) -> None:
        """Take each difference to the side on which the mesh is that of a run, none without one.

        Parameters
        ----------
        same : (parameters) -> whether they have the mesh of the run

        Raises
        ------
        ModelError
            naming a parameter that changes the mesh on both sides
        """
        self._ways = {}
        for name, step in self.steps(run).items():
            value, known = getattr(run, name), 0
            for way in (1, -1):
                with suppress(ModelError):  # the end of its range
                    if same(replace(run, **{name: value + way * step})):
                        self._ways[name] = way
                        break
                    known += 1
            else:
                if known > 1:
                    allowed = "must not change the mesh: derivatives are taken by it"
                    raise ModelError(name, value, allowed)
                self._ways[name] = 0

    def values(
        self, runs: Sequence[FinishedRun], run: FinishedRun, outputs: Iterable[Output]
    ) -> Values:
        """Return the derivatives of results of a run, given its outputs, and their audit.

        They are NaN where a neighbour failed or has no such number, and where the number jumps. Of
        a line or a map they are those at places of equal number, which may move: the derivatives of
        its coordinates say how.

        Parameters
        ----------
        runs : the run as a neighbour of itself, then the others; none if this is not known
        """
        runs = runs if runs and runs[0].complete else ()
        names = self._asked.names
        found: dict[str, Any] = {
            q.name: np.nan for q in self._declared if q.name in names and not q.dims
        }
        each = [(output, output(runs[0])) for output in (_coordinates, *outputs)] if runs else []
        outputs = [output for output, own in each if {q.name for q in own} & {*self._asked.of}]
        first = self._of([own for _, own in each])
        dims = {q.name: q.dims for _, own in each for q in own}  # a scene may add one to a quantity
        of_each = {named(of, by): dims[of] for by in self._asked.by for of in first}
        steps = self.steps(run.parameters)
        for (by, step), other in zip(steps.items(), runs[1:], strict=False):
            if not other.complete:
                continue
            slopes = _slopes(first, self._wanted(other, outputs), step)
            found |= {named(of, by): slope for of, slope in slopes.items()}
        audit = self._audit(run, runs, outputs, found) if len(runs) > 1 else {}
        given = (q.at(*of_each.get(q.name, q.dims)) for q in self._declared if q.name in found)
        return {**audit, **{q: found[q.name] for q in given}}

    def _wanted(self, run: FinishedRun, outputs: Iterable[Output]) -> dict[str, Any]:
        """Return the results of a run that are to be derived, of some outputs."""
        return self._of([output(run) for output in outputs])

    def _of(self, each: Iterable[Values]) -> dict[str, Any]:
        """Return those of some results that are to be derived."""
        found = {q.name: value for values in each for q, value in values.items()}
        return {name: found[name] for name in self._asked.of if name in found}

    def _audit(
        self, run: FinishedRun, runs: Sequence[FinishedRun], outputs: Iterable[Output], found: Any
    ) -> Values:
        """Return the audit of the derivatives ``found``, if there is one."""
        return {}


class IncrementalFamily(Family):
    """The neighbouring runs of a path by increments.

    Parameters
    ----------
    asked, scene, run : as of a `Family`; the scene has ``model``, ``program`` and ``view``
    system, samples : those of the run
    """

    def __init__(
        self, asked: Derivatives, scene: Any, run: Any, system: System, samples: Samples
    ) -> None:
        super().__init__(asked, scene, run)
        if any(_fineness(body.mesh) > _FINE for body in system.model.bodies):
            self._wider = dict.fromkeys(asked.by, _WIDEST)
        models = dict(zip(self.steps(run), map(scene.model, self.runs(run)), strict=True))
        moving = set[str]()
        for name in models.keys() - self._wider.keys():
            both = zip(system.model.bodies, models[name].bodies, strict=True)
            if not all(np.array_equal(one.mesh.p, two.mesh.p) for one, two in both):
                moving.add(name)
        self._wider |= dict.fromkeys(moving, WIDER)
        self._parameters = [run, *self.runs(run)]
        for name, parameters in zip(models, self._parameters[1:], strict=True):
            if name in moving:  # its difference is wider
                models[name] = scene.model(parameters)
        systems = {name: System(model) for name, model in models.items()}
        self.followers = NeighbouringRuns(system, systems)
        views = map(scene.view, self._parameters[1:])
        self._beside = [samples, *map(Samples, systems.values(), views)]
        self._acting = [
            acting_on(each, symmetric=own.view.symmetric, axis=own.view.axis)
            for each, own in zip((system, *systems.values()), self._beside, strict=True)
        ]

    def program(self, run: Any) -> Program:
        """Return the program of a run, with those of its neighbours beside it."""
        beside = tuple(self._scene.program(each) for each in self.runs(run))
        own: Program = self._scene.program(run)
        for name, other in zip(self.steps(run), beside, strict=True):
            if len(other.targets) != len(own.targets):
                allowed = "must not change the number of increments: derivatives are taken by it"
                raise ModelError(name, getattr(run, name), allowed)
        return replace(own, beside=beside)

    def watched(self, watch: Callable[[Any, Samples, Converged], Any], now: Converged) -> list[Any]:
        """Return what a scene watches in an increment: of the run, then of its neighbours."""
        known = list(zip(self._parameters, self._beside, strict=True))
        each = zip((known[0], *known), (now, *now.beside), strict=False)
        return [watch(*own, at) for own, at in each]

    def finished(self, run: FinishedRun, watched: Sequence[Sequence[Any]]) -> list[FinishedRun]:
        """Return the neighbours of a finished run, first the run itself; none if one failed.

        ``watched`` are the values of `watched` for each increment.
        """
        each = zip(
            run.outcome.beside,
            [run.parameters, *self.runs(run.parameters)],
            self._beside,
            self._acting,
            strict=False,
        )
        return [
            replace(
                run,
                parameters=parameters,
                samples=samples,
                acting=acting,
                outcome=replace(outcome, history=tuple(own[k] for own in watched)),
                kept={},
            )
            for k, (outcome, parameters, samples, acting) in enumerate(each, 1)
        ]

    def derived(
        self, watched: Sequence[Sequence[Any]], run: FinishedRun, outputs: Iterable[Output]
    ) -> Values:
        """Return the `values` of a run, and the ranges in which the derivatives hold.

        ``watched`` are those of `watched` for each increment.
        """
        runs = self.finished(run, watched)
        found = dict.fromkeys(map(reach, self._asked.by), np.nan)
        for (by, step), other in zip(self.steps(run.parameters).items(), runs[1:], strict=False):
            share = abs(step / getattr(run.parameters, by))
            found[reach(by)] = min(share * other.outcome.last.near, 1.0)
        ranges = {q: found[q.name] for q in self._declared if q.name in found}
        return {**self.values(runs, run, outputs), **ranges}

    def _audit(
        self, run: FinishedRun, runs: Sequence[FinishedRun], outputs: Iterable[Output], found: Any
    ) -> Values:
        """Return the error of the derivatives by one parameter in one increment.

        An increment that ends a stage is solved again (`NeighbouringRuns.alone`): the first on
        which a result depends, from a stage on that the parameters of the run decide, as they
        decide by which parameter.
        """
        chance, number = divmod(crc32(repr(run.parameters).encode()), len(runs) - 1)
        by, step = list(self.steps(run.parameters).items())[number]
        value, points = getattr(run.parameters, by), runs[0].outcome.points
        stages = [name for name, own in points.items() if own.start is not own.state]
        at, errors = chance % max(len(stages), 1), list[float]()
        for stage in stages[at:] + stages[:at]:
            try:
                alone = [self._alone(k, runs[k], run, stage) for k in (0, 1 + number)]
            except IncrementFailed:
                return {AUDITED: np.nan}
            first, after = (self._wanted(own, outputs) for own in alone)
            for of, slope in _slopes(first, after, step).items():
                own = found[named(of, by)]
                level = max(_largest(np.divide(first[of], value)), _largest(own)) or 1.0
                if np.isfinite(slope - own).any():
                    errors.append(_largest(slope - own) / level)
            if max(errors, default=0.0) > 0:
                break
        return {AUDITED: max(errors)} if errors else {}

    def _alone(self, k: int, own: FinishedRun, run: FinishedRun, stage: str) -> FinishedRun:
        """Return a neighbour whose increment at the end of a stage is solved again."""
        before = own.outcome.points[stage]
        after = self.followers.alone(k, before, run.outcome.points[stage])
        work = own.outcome.tally.plastic_work + after.plastic_work - before.plastic_work
        points = {name: after if c is before else c for name, c in own.outcome.points.items()}
        last = after if own.outcome.last is before else own.outcome.last
        tally = replace(own.outcome.tally, plastic_work=work)
        outcome = replace(own.outcome, points=points, last=last, tally=tally)
        return replace(own, outcome=outcome, kept={})


def _slopes(first: Mapping[str, Any], after: Mapping[str, Any], step: float) -> dict[str, Array]:
    """Return the derivatives of results, given those of the run and those after a step."""
    found: dict[str, Array] = {}
    for of, value in first.items():
        change = np.asarray(after.get(of, np.nan)) - value
        most = _JUMP * _largest(value)
        found[of] = np.where(np.abs(change) > most, np.nan, change / step)
    return found


def _fineness(mesh: Mesh) -> float:
    """Return the extent of a mesh over its shortest edge, in space over its smallest face."""
    sides = np.linalg.norm(np.ptp(mesh.p[:, mesh.facets], axis=1), axis=0)
    return float(np.ptp(mesh.p, axis=1).max() / sides.min())


def _largest(values: Any) -> float:
    """Return the largest absolute value, 0 if there is none."""
    return float(np.abs(np.nan_to_num(values)).max(initial=0.0))


def _coordinates(run: FinishedRun) -> Values:
    """Return the coordinates of a run that are numbers."""
    each = {name: np.asarray(values) for name, values in run.view.coordinates.items()}
    numbers = {name: values for name, values in each.items() if values.dtype.kind == "f"}
    return {QUANTITIES[name]: values for name, values in numbers.items() if name in QUANTITIES}
