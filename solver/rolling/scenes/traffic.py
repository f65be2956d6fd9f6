"""Random traffic: passes whose loads, positions and tractions scatter about those of the run.

They scatter as a normal distribution that is cut off at three standard deviations. Dynamic wheel
loads are distributed so: J. Eisenmann, Germans gain a better understanding of track structure,
Railway Gazette International 128 (1972) 305-308. Their standard deviation is 0.1 (track in very
good condition) to 0.3 (poor condition) of the load, more above 60 km/h.
"""

from __future__ import annotations

from collections.abc import Sequence
from statistics import NormalDist
from typing import Protocol

import numpy as np

from solver.errors import ModelError
from solver.typing import Array

CUT = 3.0
"""Largest deviation from the mean, in standard deviations."""


class Scattered(Protocol):
    """Parameters of passes that scatter."""

    def deviating(self, deviation: Sequence[float]) -> object:
        """Return the parameters of a pass; deviations are in standard deviations."""


def deviations(seed: int, passes: int, count: int) -> Array:
    """Return deviations (passes, count) from the mean, in standard deviations.

    Those of a pass do not depend on how many passes follow.
    """
    normal = NormalDist()
    least, most = normal.cdf(-CUT), normal.cdf(CUT)
    share = least + (most - least) * np.random.default_rng(seed).random((passes, count))
    return np.array([normal.inv_cdf(each) for each in share.ravel()]).reshape(share.shape)


def check_spreads(parameters: Scattered, spreads: Sequence[str]) -> None:
    """Raise `ModelError` for a spread that takes a parameter beyond its limits.

    Parameters
    ----------
    spreads : names of the standard deviations, in the order of `Scattered.deviating`
    """
    for number, name in enumerate(spreads):
        for way in (-CUT, CUT):
            deviation = [way if other == number else 0.0 for other in range(len(spreads))]
            try:
                parameters.deviating(deviation)
            except ModelError as error:
                reached = f"makes {error.field} = {error.value:g} at {CUT:g} standard deviations"
                allowed = f"{reached}, which {error.allowed}"
                raise ModelError(name, getattr(parameters, name), allowed) from None
