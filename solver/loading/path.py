"""A loading path with an unloading branch at every load asked for.

The trunk visits multiples of the load step. A branch leaves it at the last multiple below its
load, goes to exactly that load, and unloads; the trunk then goes on from where the branch
left. So what a branch returns does not depend on which other branches are asked for: a sweep
over load on one path gives bit for bit what separate runs give.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from solver.contact.state import Converged
from solver.loading.increment import Increment
from solver.loading.outcome import IncrementFailed, Yielded
from solver.loading.stepper import ROUNDING, PathControl, Point, Stepper, Stopped, Tally

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from solver.contact.system import System
    from solver.errors import NotConverged
    from solver.loading.stepper import Report


@dataclass(frozen=True, slots=True, kw_only=True)
class Branch:
    """One load reached and released.

    ``loaded`` and ``unloaded`` are None, and ``error`` tells why, where the path ended before.
    """

    load: float
    tally: Tally
    loaded: Converged | None = None
    unloaded: Converged | None = None
    error: NotConverged | None = None


class Path:
    """The loading path of one system."""

    def __init__(self, system: System, control: PathControl, report: Report | None = None) -> None:
        self.system = system
        self.control = control
        self._stepper = Stepper(system, control, report)

    def branches(self, loads: Sequence[float]) -> Iterator[Branch]:
        """Yield a branch for every load factor, in increasing order."""
        error: NotConverged | None = None
        try:
            trunk = self._stepper.together(self.system.initial())
        except Stopped as stopped:
            error, trunk = stopped.error, stopped.point
        step = self.control.load_step
        for load in sorted(loads):
            direct = self._elastic(load)
            if direct is not None:
                yield direct
                continue
            while error is None and trunk.now.state.load + step < load * (1 - ROUNDING):
                following = (round(trunk.now.state.load / step) + 1) * step
                try:
                    trunk = self._stepper.advance(trunk, following)
                except Stopped as stopped:
                    error, trunk = stopped.error, stopped.point
            if error is not None:
                yield Branch(load=load, tally=trunk.tally, error=error)
                continue
            yield self._branch(trunk, load)

    def _branch(self, trunk: Point, load: float) -> Branch:
        loaded = None
        try:
            loaded = self._stepper.advance(trunk, load)
            unloaded = self._unload(loaded)
        except Stopped as stopped:
            now = loaded.now if loaded else None
            tally = stopped.point.tally
            return Branch(load=load, tally=tally, loaded=now, error=stopped.error)
        return Branch(load=load, tally=unloaded.tally, loaded=loaded.now, unloaded=unloaded.now)

    def _elastic(self, load: float) -> Branch | None:
        """Return the branch of a load that yields nothing, in one increment, or None.

        Without yielding, unloading restores the virgin state exactly. One increment is exact
        where the history of friction cannot matter: no friction, or surfaces that fit before
        loading, where everything grows in proportion.
        """
        if not self.system.proportional:
            return None
        start = self._stepper.rest(self.system.initial())
        try:
            converged = Increment(
                self.system,
                start.now.state,
                load,
                elastic_only=True,
                tolerances=self.control.tolerances,
            ).solve()
        except (Yielded, IncrementFailed):
            return None
        if converged.strayed:  # stepping tells at which load
            return None
        converged = self._stepper.worked(start.now, converged)
        self._stepper.report()
        tally = self._stepper.timed(start.tally.plus(converged))
        return Branch(load=load, tally=tally, loaded=converged, unloaded=start.now)

    def _unload(self, loaded: Point) -> Point:
        load, steps = loaded.now.state.load, self.control.unload_steps
        point = replace(loaded, before=None)
        for k in range(1, steps):
            point = self._stepper.advance(point, load * (1 - k / steps))
        return self._stepper.advance(point, 0.0, contact=False)
