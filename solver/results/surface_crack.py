"""A crack from the surface into a body of a run: its stress intensity over depth in a cycle.

It is long and straight down, in the stress of the body without it. Where this is not known, or
the cycle strains plastically, K of a crack that reaches there is NaN.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from solver.errors import ModelError
from solver.fatigue.cracks import arrest, opened_range, stress_intensity
from solver.results.fields import StressCycle
from solver.results.quantities import declare
from solver.results.run import FinishedRun, Values
from solver.results.view import View
from solver.typing import Bools

_UNIT = "MPa mm^0.5"
LINES = tuple(
    declare(f"crack_K_{name}", f"{name}{of} K of a surface crack", _UNIT, dims=("depth",))
    for name, of in {"largest": "", "smallest": "", "range": " of open"}.items()
)
ARREST = declare(
    "crack_arrest_depth",
    "depth at which a crack that grows stops; infinite if not in the profile, NaN if not known",
    "mm",
)
LEAST = declare("crack_least_range", "smallest range of K as a crack grows", _UNIT)


@dataclass(frozen=True, slots=True, kw_only=True)
class SurfaceCrack:
    """A crack from the surface of the body of the profiles, straight down.

    Attributes
    ----------
    threshold : range of K below which it does not grow [MPa mm^0.5]
    initial : its depth at the beginning [mm]
    at : position along the surface, of a symmetric body on either half; None for the middle one of
        the profiles [mm]
    across : whether stress across the plane (in space, across the track) opens it, not stress along
        the surface (along the track)
    """

    threshold: float
    initial: float
    at: float | None = None
    across: bool = False

    def fits(self, view: View) -> None:
        """Refuse profiles that end above the crack.

        Raises
        ------
        ModelError
            if it begins beyond the profiles
        """
        if self.initial >= view.depth[-1]:
            allowed = f"must be less than the depth of profiles, {view.depth[-1]:g} mm"
            raise ModelError("fatigue.crack.initial", self.initial, allowed)

    def sampler(self, system: Any, view: View) -> Any:
        """Return the sampler of the depths of the profiles below the crack.

        Raises
        ------
        ModelError
            if it begins beyond the profiles or outside the body
        """
        self.fits(view)
        at = view.station[len(view.station) // 2] if self.at is None else self.at
        at = abs(at) if view.symmetric else at
        found = system.sampler(view.profile_body, replace(view, station=np.array([at])).profiles)
        if not found.inside[0]:
            allowed = f"must be on the surface of {view.profile_body}"
            raise ModelError("fatigue.crack.at", at, allowed)
        if not found.inside[view.depth <= self.initial].all():
            allowed = f"must be less than the depth of {view.profile_body} there"
            raise ModelError("fatigue.crack.initial", self.initial, allowed)
        return found

    def values(self, run: FinishedRun, cycle: StressCycle, void: Bools) -> Values:
        """Return the quantities of a run; ``void`` are cycles (n,) for which K does not hold."""
        view, body = run.view, run.view.profile_body
        sampler = self.sampler(run.system, view)
        cycle_of = np.arange(len(cycle.of)), cycle.of
        which = csr_array((np.ones(len(cycle.of)), cycle_of))
        across, up = (1.0, 0.0) if len(view.axis.along) == 3 else view.axis.along
        of_components = [0, 0, 1, 0] if self.across else [across**2, up**2, 0, 2 * across * up]
        normal = np.where(void[:, None], np.nan, cycle.stress[..., :4] @ of_components)
        stress = (sampler.matrix @ run.samples.fields.recovery(body) @ which @ normal).T
        stress[:, ~sampler.inside] = np.nan
        lengths = np.append(self.initial, view.depth[1:])
        K = stress_intensity(view.depth, stress, lengths)
        largest, smallest = K.max(axis=0), K.min(axis=0)
        opened, grown = opened_range(largest, smallest), lengths >= self.initial
        stop, least = arrest(lengths[grown], opened[grown], self.threshold)
        surface = 0.0 * stress[:, 0].max()  # not known if the stress there is not
        lines = (np.append(surface, each[1:]) for each in (largest, smallest, opened))
        return {**dict(zip(LINES, lines, strict=True)), ARREST: stop, LEAST: least}
