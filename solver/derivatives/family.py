"""The neighbouring runs of a scene, and the derivatives of its results by their differences."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from solver.contact.state import Converged
from solver.contact.system import System
from solver.derivatives.asked import Derivatives, named, reach
from solver.derivatives.neighbours import NeighbouringRuns
from solver.errors import ModelError
from solver.loading.program import Program
from solver.results.acting import acting_on
from solver.results.fields import Samples
from solver.results.quantities import QUANTITIES
from solver.results.run import FinishedRun, Output, Values

_JUMP = 1e-3
"""Change of a number over the number, above which it jumps, as the place of a maximum that two
places share does. It has no derivative. Changes of a line or a map are relative to its largest
value."""


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
        self._asked, self._scene, self._moving = asked, scene, set[str]()
        self._declared = asked.quantities(type(run), scene.known_quantities)
        models = dict(zip(self._steps(run), map(scene.model, self.runs(run)), strict=True))
        for name, model in models.items():
            both = zip(system.model.bodies, model.bodies, strict=True)
            if not all(np.array_equal(one.mesh.p, two.mesh.p) for one, two in both):
                self._moving.add(name)
        self._parameters = [run, *self.runs(run)]
        for name, parameters in zip(models, self._parameters[1:], strict=True):
            if name in self._moving:  # its difference is wider
                models[name] = scene.model(parameters)
        systems = {name: System(model) for name, model in models.items()}
        self.followers = NeighbouringRuns(system, systems)
        views = map(scene.view, self._parameters[1:])
        self._beside = [samples, *map(Samples, systems.values(), views)]
        self._acting = [
            acting_on(each, symmetric=own.view.symmetric, axis=own.view.axis)
            for each, own in zip((system, *systems.values()), self._beside, strict=True)
        ]

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
        for name, other in zip(self._steps(run), beside, strict=True):
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

    def values(
        self, watched: Sequence[Sequence[Any]], run: FinishedRun, outputs: Iterable[Output]
    ) -> Values:
        """Return the derivatives of results of a run, given its outputs, and their ranges.

        They are NaN where a neighbour failed or has no such number, and where the number jumps. Of
        a line or a map they are those at places of equal number, which may move: the derivatives of
        its coordinates say how.
        """
        steps, found = self._steps(run.parameters), dict[str, Any]()
        shares = {by: abs(step / getattr(run.parameters, by)) for by, step in steps.items()}
        runs = self.finished(run, watched)
        for (by, share), other in zip(shares.items(), runs[1:], strict=False):
            found[reach(by)] = min(share * other.outcome.last.near, 1.0)
        for output in (_coordinates, *outputs) if runs else ():
            first = _numbers(output(runs[0]))
            wanted = [name for name in self._asked.of if name in first]
            if not wanted:
                continue
            for (by, step), other in zip(steps.items(), runs[1:], strict=True):
                after = _numbers(output(other))
                for of in wanted:
                    level, values = np.abs(first[of]), np.asarray(after.get(of, np.nan))
                    most = _JUMP * np.nan_to_num(level).max(initial=0.0)
                    change = values - first[of]
                    found[named(of, by)] = np.where(np.abs(change) > most, np.nan, change / step)
        lacks = {q.name: np.nan for q in self._declared if not q.dims}
        return {q: (lacks | found)[q.name] for q in self._declared if q.name in lacks | found}


def _coordinates(run: FinishedRun) -> Values:
    """Return the coordinates of a run that are numbers."""
    each = {name: np.asarray(values) for name, values in run.view.coordinates.items()}
    numbers = {name: values for name, values in each.items() if values.dtype.kind == "f"}
    return {QUANTITIES[name]: values for name, values in numbers.items() if name in QUANTITIES}


def _numbers(values: Values) -> dict[str, Any]:
    return {quantity.name: value for quantity, value in values.items()}
