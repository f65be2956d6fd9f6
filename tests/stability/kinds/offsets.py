"""One problem far from the origin: what rounding of the positions explains, and no more.

A position D away is rounded by eps D; over an element of size 0.5 that is a relative error of
2 eps D in strain operators, and over the displacements at the contact, about 0.01, an error
of 100 eps D in gaps of surfaces that meet without one.
"""

from __future__ import annotations

from functools import cache, partial

import numpy as np

from solver import Solution
from tests.stability.kinds.units import compare, pressed
from tests.stability.trial import Figure, Scene

FACTOR = 1e3
"""Over eps D: the 100 above, and ten times as much in stress next to an edge."""


@cache
def _here() -> Solution:
    return pressed()


def _judge(away: float, solution: Solution) -> dict[str, Figure]:
    return compare(solution, _here(), 1.0, 1.0, 1e-7 + FACTOR * float(np.finfo(float).eps) * away)


def scenes() -> list[Scene]:
    """Return offsets of 1e3 to 1e7 mm, along x and y, not whole numbers of elements."""
    return [
        Scene(
            what=f"all of it {away:g} mm away",
            run=partial(pressed, at=(0.7371 * away, -0.9173 * away)),
            judge=partial(_judge, away),
        )
        for away in (1e3, 1e4, 1e5, 1e6, 1e7)
    ]
