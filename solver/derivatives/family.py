"""The neighbouring runs of a scene, and the derivatives of its numbers by their differences."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from solver.contact.system import System
from solver.derivatives.asked import Derivatives, named
from solver.derivatives.neighbours import NeighbouringRuns
from solver.errors import ModelError
from solver.loading.outcome import Outcome, beside_of
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
        self._moving: set[str] = set()
        own = [body.mesh.p for body in scene.model(run).bodies]
        for name, each in zip(asked.by, self.runs(run), strict=True):
            moved = zip(own, scene.model(each).bodies, strict=True)
            if not all(np.array_equal(p, body.mesh.p) for p, body in moved):
                self._moving.add(name)
        systems = [System(scene.model(each)) for each in self.runs(run)]
        self.followers = NeighbouringRuns(system, dict(zip(asked.by, systems, strict=True)))
        views = [scene.view(each) for each in self.runs(run)]
        self._beside = [samples, *map(Samples, systems, views)]
        self._acting = [
            acting_on(each, symmetric=own.view.symmetric, axis=own.view.axis)
            for each, own in zip((system, *systems), self._beside, strict=True)
        ]
        self._own: dict[int, tuple[Any, list[Any]]] = {}

    def runs(self, run: Any) -> list[Any]:
        """Return the parameters of the neighbours of a run."""
        steps = self._steps(run)
        return [replace(run, **{name: getattr(run, name) + steps[name]}) for name in steps]

    def _steps(self, run: Any) -> dict[str, float]:
        return self._asked.steps(run, self._moving)

    def program(self, run: Any) -> Program:
        """Return the program of a run, with those of its neighbours beside it."""
        beside = tuple(self._scene.program(each) for each in self.runs(run))
        own: Program = self._scene.program(run)
        for name, other in zip(self._asked.by, beside, strict=True):
            if len(other.targets) != len(own.targets):
                allowed = "must not change the number of increments: derivatives are taken by it"
                raise ModelError(name, getattr(run, name), allowed)
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
                    for samples, beside in zip(self._beside, beside_of(at), strict=False)
                ],
            )
            return own

        return value

    def finished(self, run: FinishedRun) -> list[FinishedRun]:
        """Return the neighbours of a finished run, first the run itself; none if one failed."""
        parameters = [run.parameters, *self.runs(run.parameters)]
        return [
            replace(
                run,
                parameters=each,
                samples=samples,
                acting=self._acting[k],
                outcome=self._complete(outcome, run.outcome, k),
                kept={},
            )
            for k, (outcome, each, samples) in enumerate(
                zip(run.outcome.beside, parameters, self._beside, strict=False)
            )
        ]

    def _complete(self, outcome: Outcome, run: Outcome, k: int) -> Outcome:
        """Return the outcome of a neighbour, with what `beside` has recorded."""
        traces = tuple(self._own[id(each)][1][k] for each in run.traces)
        history = tuple(self._own[id(each)][1][k] for each in run.history)
        return replace(outcome, traces=traces, history=history)

    def values(self, run: FinishedRun, outputs: Iterable[Output]) -> Values:
        """Return the derivatives of numbers of a run, given its outputs.

        They are NaN where a neighbour failed or has no such number, and where the number jumps.
        """
        steps, found = self._steps(run.parameters), dict[str, float]()
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
