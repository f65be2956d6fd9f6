"""Rolls with an advance small enough: halved until that changes residual stress no more."""

from __future__ import annotations

from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

from solver.errors import LimitLoad
from solver.loading.passes import Passes, PassResult
from solver.loading.stepper import PathControl, Tally

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from solver.loading.passes import Schedule
    from solver.loading.stepper import Report
    from solver.results.harvest import Harvest

HALVINGS = 6


class Settling:
    """Passes over the track of a harvest, in increments chosen by the error they make.

    Backward Euler in the plastic strain is of first order in the advance, so the change of the
    residual stress when the advance is halved estimates the error that is left. The first pass
    is rolled at ever smaller advances until it is small; the passes go on from the last one.

    Parameters
    ----------
    schedule : its step is the largest advance
    tolerance : accepted change of residual stress under mid-track [MPa]; 0 takes the step as it is

    Attributes
    ----------
    advance : that was taken in the end [mm]
    error : estimated error of the residual stress left by the advance [MPa]; NaN where unknown
    """

    def __init__(
        self, harvest: Harvest, schedule: Schedule, tolerance: float, report: Report
    ) -> None:
        self._harvest = harvest
        self._schedule = schedule
        self._tolerance = tolerance
        self._report = report
        self.advance = schedule.advance
        self.error = np.nan
        self._failed = np.nan

    def results(self) -> Iterator[PassResult]:
        """Yield what `Passes.results` yields."""
        halvings = HALVINGS if self._tolerance else 0
        coarse, tally = None, Tally()
        for halved in range(halvings + 1):
            schedule = self._schedule.refined(2**halved)
            trial = self._passes(schedule, tally)
            result = next(trial)
            failed = result.unloaded is None and not isinstance(result.error, LimitLoad)
            if failed and coarse is not None:  # what the larger advance gave stands
                self._failed = schedule.advance
                break
            first, passes, self.advance = result, trial, schedule.advance
            if first.unloaded is not None:
                fine = self._profile(first)
                if coarse is not None:
                    self.error = float(np.abs(fine - coarse).max())
                if self.error <= self._tolerance:
                    break
                coarse = fine
            elif not failed:
                break
            # what larger advances have cost stays in the tally
            tally = Tally(seconds=first.tally.seconds)
        yield from chain([first], passes)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Return what there is to say of the error."""
        if not self._tolerance or self.error <= self._tolerance:
            return ()
        error = "an unknown error" if np.isnan(self.error) else f"an error of {self.error:.3g} MPa"
        failed = "" if np.isnan(self._failed) else f"; one of {self._failed:.3g} mm failed"
        return (
            f"an advance of {self.advance:.3g} mm still leaves {error}, "
            f"above the tolerance of {self._tolerance:.3g} MPa{failed}",
        )

    def _passes(self, schedule: Schedule, tally: Tally) -> Iterator[PassResult]:
        control = PathControl(load_step=1.0, max_cuts=4)
        return Passes(self._harvest.system, schedule, control, self._report).results(tally)

    def _profile(self, result: PassResult) -> NDArray[np.float64]:
        """Return the residual stress xx and zz under mid-track (2, depth) [MPa]."""
        assert result.unloaded is not None
        stress, _ = self._harvest.profile(result.unloaded)
        return stress[len(stress) // 2, [0, 2]]
