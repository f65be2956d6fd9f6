"""The old names of a walk over loads; `Walker` and `Outcome` take their place."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING

from solver.loading.walker import Walker

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from solver.contact.state import Converged
    from solver.contact.system import System
    from solver.errors import NotConverged
    from solver.loading.control import PathControl
    from solver.loading.outcome import Tally
    from solver.loading.stepper import Report


@dataclass(frozen=True, slots=True, kw_only=True)
class Branch:
    """An `Outcome` of one load: ``points["loaded"]`` and ``points["unloaded"]`` by other names."""

    load: float
    tally: Tally
    loaded: Converged | None = None
    unloaded: Converged | None = None
    error: NotConverged | None = None


class Path:
    """A `Walker` of ``control.program(load)`` for each load; use that, this name will go."""

    def __init__(self, system: System, control: PathControl, report: Report | None = None) -> None:
        text = "solver.Path is replaced by solver.Walker: Walker(system, control).walk(programs)"
        warnings.warn(text, DeprecationWarning, stacklevel=2)
        self._walker = Walker(system, control, report=report)
        self._control = control

    def branches(self, loads: Sequence[float]) -> Iterator[Branch]:
        """Yield a branch for every load factor, in increasing order."""
        programs = [self._control.program(load) for load in sorted(loads)]
        for load, outcome in zip(sorted(loads), self._walker.walk(programs), strict=True):
            yield Branch(
                load=load,
                tally=outcome.tally,
                loaded=outcome.points.get("loaded"),
                unloaded=outcome.points.get("unloaded"),
                error=outcome.error,
            )
