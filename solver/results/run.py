"""A finished run, the input of all outputs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from solver.audit.report import Audit
from solver.loading.outcome import Outcome
from solver.model.singular import SingularPoint
from solver.results.acting import Acting
from solver.results.fields import Bodies, Samples, Solved
from solver.results.mesh_fields import MeshFields
from solver.results.quantities import Quantity
from solver.results.view import View
from solver.typing import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class FinishedRun:
    """A finished run.

    Attributes
    ----------
    parameters : the scene's parameters for this run
    samples : fields of its system at the positions of the scene's view
    acting : (state) -> what acts on its lower body
    outcome : the result of its program
    check : function that returns the audit of a complete run
    doubts : warnings about parameters that look like mistakes, see `Model.doubts`
    notes : messages to the user about the computation
    singular : singular points, near which numbers depend on the mesh
    beside : function that returns the fields of further bodies at the same stages
    derived : (run, outputs) -> derivatives of the numbers of the outputs, if they are asked for
    state : function that returns arrays from which a longer run goes on; empty if none can
    kept : what outputs have computed and need again
    """

    parameters: Any
    samples: Samples
    acting: Callable[[Any], Acting]
    outcome: Outcome
    check: Callable[[], Audit]
    doubts: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    singular: tuple[SingularPoint, ...] = ()
    beside: Callable[[], MeshFields] | None = None
    derived: Callable[[FinishedRun, Sequence[Output]], Values] | None = None
    state: Callable[[], Mapping[str, Array]] = dict
    kept: dict[Any, Any] = field(default_factory=dict)

    @property
    def system(self) -> Bodies:
        """The discretised bodies."""
        return self.samples.system

    @property
    def view(self) -> View:
        """The positions of the results."""
        return self.samples.view

    @property
    def complete(self) -> bool:
        """Whether the program reached its end."""
        return self.outcome.error is None

    @property
    def loaded(self) -> Solved:
        """The state under load."""
        return self.outcome.points[self.view.loaded]

    @property
    def unloaded(self) -> Solved:
        """The state after unloading."""
        return self.outcome.points[self.view.unloaded]

    @property
    def stages(self) -> list[tuple[Solved, float]]:
        """The stored states, each with the position x of s = 0 [mm]."""
        states = [(name, self.outcome.points[name]) for name in self.view.stages]
        following = self.view.following
        return [(c, self.acting(c).centre if name in following else 0.0) for name, c in states]


Values = Mapping[Quantity, Any]
"""Result of an output: a number or an array over its dimensions, by quantity."""

Output = Callable[[FinishedRun], Values]
"""Function that computes some quantities of a run."""
