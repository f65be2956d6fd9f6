"""The neighbouring runs of a scene, and the derivatives of its numbers by their differences."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from solver.contact.system import System
from solver.derivatives.asked import Derivatives, named
from solver.derivatives.neighbours import NeighbouringRuns
from solver.errors import ModelError
from solver.fem.discretisation import Discretisation
from solver.loading.outcome import Outcome
from solver.loading.program import Program
from solver.results.acting import acting_on
from solver.results.run import FinishedRun, Output, Values
from solver.results.samples import Samples

_JUMP = 1e-3
"""Change of a number over the number: a larger one, at a tiny change of a parameter, is a jump, as
of the place of a maximum that two places share. It has no derivative."""


class Family:
    """The neighbouring runs of a path of a scene.

    Parameters
    ----------
    asked : the derivatives
    scene : the scene, with ``model``, ``program`` and ``view``
    run : parameters of the last run of the path
    system, samples : those of the run

    Raises
    ------
    ModelError
        naming a parameter by which no derivative exists
    """

    def __init__(
        self, asked: Derivatives, scene: Any, run: Any, system: System, samples: Samples
    ) -> None:
        self._asked, self._scene, self._samples = asked, scene, samples
        self._declared = asked.quantities(type(run), scene.known_quantities)
        systems = []
        for name, each in zip(asked.by, self.runs(run), strict=True):
            systems.append(System(scene.model(each)))
            _check_alike(name, system, systems[-1])
        self.followers = NeighbouringRuns(system, systems)
        views = [scene.view(each) for each in self.runs(run)]
        self._beside = [samples, *map(Samples, systems, views)]
        self._acting = [
            acting_on(each, symmetric=own.view.symmetric, axis=own.view.axis)
            for each, own in zip((system, *systems), self._beside, strict=True)
        ]
        self._own: dict[int, tuple[Any, list[Any]]] = {}

    def runs(self, run: Any) -> list[Any]:
        """Return the parameters of the neighbours of a run."""
        steps = self._asked.steps(run)
        return [replace(run, **{name: getattr(run, name) + steps[name]}) for name in steps]

    def program(self, run: Any) -> Program:
        """Return the program of a run, with those of its neighbours beside it."""
        beside = tuple(self._scene.program(each) for each in self.runs(run))
        own: Program = self._scene.program(run)
        for name, other in zip(self._asked.by, beside, strict=True):
            if len(other.targets) != len(own.targets):
                raise _unlike(name, getattr(run, name), "the increments")
        return replace(own, beside=beside)

    def beside(self, function: Callable[..., Any]) -> Callable[[Any], Any]:
        """Return (states) -> value of a function (samples, states) of the scene.

        It is also computed for the neighbours, which `_outcome` gives theirs.
        """

        def value(at: Any) -> Any:
            own = function(self._samples, at)
            self._own[id(own)] = (
                own,
                [
                    function(samples, beside)
                    for samples, beside in zip(self._beside, _beside(at), strict=False)
                ],
            )
            return own

        return value

    def finished(self, run: FinishedRun) -> list[FinishedRun]:
        """Return the neighbours of a finished run, first the run itself; none if one failed."""
        outcome = run.outcome
        if not _beside(outcome.points):
            return []
        parameters = [run.parameters, *self.runs(run.parameters)]
        return [
            replace(
                run,
                parameters=each,
                samples=samples,
                acting=self._acting[k],
                outcome=self._outcome(outcome, k),
                kept={},
            )
            for k, (each, samples) in enumerate(zip(parameters, self._beside, strict=True))
        ]

    def _outcome(self, outcome: Outcome, k: int) -> Outcome:
        """Return the outcome of a neighbour."""
        return replace(
            outcome,
            last=outcome.last.beside[k],
            tally=replace(outcome.tally, plastic_work=outcome.tally.beside[k]),
            points=_beside(outcome.points)[k],
            traces=tuple(self._own[id(each)][1][k] for each in outcome.traces),
            history=tuple(self._own[id(each)][1][k] for each in outcome.history),
            cycles=tuple(cycle.beside[k] for cycle in outcome.cycles),
        )

    def values(self, run: FinishedRun, outputs: Iterable[Output]) -> Values:
        """Return the derivatives of numbers of a run, given its outputs.

        They are NaN where a neighbour failed or has no such number, and where the number jumps.
        """
        steps, found = self._asked.steps(run.parameters), dict[str, float]()
        runs = self.finished(run)
        for output in outputs if runs else ():
            first = _numbers(output(runs[0]))
            wanted = [name for name in self._asked.of if name in first]
            if not wanted:
                continue
            for (by, step), other in zip(steps.items(), runs[1:], strict=True):
                after = _numbers(output(other))
                for of in wanted:
                    change = after.get(of, np.nan) - first[of]
                    jumps = abs(change) > _JUMP * abs(first[of])
                    found[named(of, by)] = np.nan if jumps else change / step
        return {quantity: found.get(quantity.name, np.nan) for quantity in self._declared}


def _numbers(values: Values) -> dict[str, Any]:
    return {quantity.name: value for quantity, value in values.items()}


def _beside(at: Any) -> list[Any]:
    """Return what the neighbours have of states: an increment, or several by name; none failed."""
    if not isinstance(at, Mapping):
        return list(at.beside)
    each = zip(*(found.beside for found in at.values()), strict=False)
    return [dict(zip(at, found, strict=True)) for found in each]


def _check_alike(name: str, system: System, other: System) -> None:
    """Raise `ModelError` unless two systems have the same elements, points and unknowns."""
    for one, two in zip(system.parts, other.parts, strict=True):
        same = type(one) is type(two) and one.n == two.n and np.array_equal(one.active, two.active)
        if same and isinstance(one, Discretisation) and isinstance(two, Discretisation):
            same = np.array_equal(one.dofs, two.dofs)
        if not same:
            raise _unlike(name, one.body.name, "the mesh")
    pairs = zip(system.interfaces, other.interfaces, strict=True)
    if any((a.slave, a.master) != (b.slave, b.master) for a, b in pairs):
        raise _unlike(name, "contact", "the slave of a pair")


def _unlike(name: str, value: Any, what: str) -> ModelError:
    return ModelError("derivatives.by", name, f"must not change {what} ({value})")
