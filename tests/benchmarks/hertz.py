"""Hertz line contact: an elastic cylinder, held by contact alone, on an elastic half-plane.

The closed form is for half-planes; bodies of 100 a disturb it by (a / size)^2 = 1e-4, the floor of
what can be told here.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from solver import Solution
from tests.benchmarks.measure import Point, timed
from tests.verification.hertz_line import exact, press

EXACT = exact()
ELEMENTS = ("quad8", "quad9", "quad4", "tri6")
MEASURES = {
    "pressure": "contact pressure, mean square over 0 < x < a",
    "peak": "peak pressure",
    "half_width": "contact half-width",
}


def measure(elements: Sequence[str], meshes: Sequence[int], repeats: int) -> list[Point]:
    """Return a point for every element and every number of elements in the half-width.

    Every repeat has a thickness of its own: it changes no stress, but equal elastic bodies would
    share their condensation, and the repeat would cost nothing.
    """
    points = []
    for element in elements:
        for n in meshes:
            run = timed(lambda repeat, n=n, e=element: press(n, e, thickness=1.0 + repeat), repeats)
            points.append(
                Point(
                    problem="hertz",
                    series=element,
                    setting=f"a/{n}",
                    size=1.0 / n,
                    unknowns=2 * sum(run.result.nodes(b).shape[1] for b in ("cylinder", "plane")),
                    cpu=run.cpu,
                    spread=run.spread,
                    repeats=run.repeats,
                    **_errors(run.result),
                )
            )
    return points


def _errors(solution: Solution) -> dict[str, dict[str, float]]:
    acting = solution.contact()
    position, pressure = acting.X, acting.pressure
    order = np.argsort(position[0])
    x, p = position[0, order], pressure[order]
    at = np.linspace(0.0, 1.0, 2001)
    miss = np.interp(at, x, p) - EXACT.pressure(at)
    # the square of Hertz's pressure is a line in x^2: its zero is the edge
    near = (p > 0.1 * p[0]) & (x > 0.3) & (x < 1.0)
    slope, offset = np.polyfit(x[near] ** 2, p[near] ** 2, 1)
    half_width = float(np.sqrt(-offset / slope))
    square = np.sqrt(np.mean(miss**2) / np.mean(EXACT.pressure(at) ** 2))
    return {
        "values": {"peak": float(p[0]), "half_width": half_width},
        "errors": {
            "pressure": float(square),
            "peak": abs(float(p[0]) / EXACT.peak_pressure - 1),
            "half_width": abs(half_width / EXACT.half_width - 1),
        },
    }
