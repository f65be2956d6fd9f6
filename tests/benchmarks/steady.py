"""A steady pass: free rolling and braking at 75 %, load ratio 2.71, no hardening.

There is no closed form. The reference is a run of the finest mesh, sub-steps and window; each
series changes one thing and leaves the rest as it is by default.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from solver.rolling.plane.track import Track
from solver.rolling.scenes.rolling import RollingParameters
from solver.rolling.scenes.rolling_endless import steady_passes, track_for
from tests.benchmarks.measure import Point, timed

BASE = RollingParameters()
SERIES = ("mesh", "growth", "sub-steps")
LOADS: Mapping[str, Mapping[str, float]] = {"free": {}, "braking": {"traction": 0.75}}
DEPTHS = (0.0, 1.0, 2.0, 5.0)
MEASURES = {
    load: {f"{depth:g} mm": f"residual sigma_x at {depth:g} mm / Re" for depth in DEPTHS}
    for load in LOADS
}
"""Residual stress, linear between rows of points; at the surface that of the first."""


@dataclass(frozen=True, slots=True)
class Case:
    """One setting of a series: changed parameters, sub-steps between points, element side [mm]."""

    series: str
    setting: str
    changes: Mapping[str, float] = field(default_factory=dict)
    parts: int = 16
    size: float = float("nan")


def loads(quick: bool) -> tuple[str, ...]:
    """Return the names of the loads that are measured."""
    return ("free",) if quick else tuple(LOADS)


def plan(quick: bool) -> tuple[Case, tuple[Case, ...]]:
    """Return the reference, and the cases."""
    h, parts = (4 / 3, 4) if quick else (0.25, 32)
    return Case("reference", "finest", graded_by(h), parts), tuple(_cases(quick))


def graded_by(h: float) -> dict[str, float]:
    """Return elements of side ``h`` [mm] whose sides grow in depth alike."""
    return {"element_size": h, "growth": 1.15**h}


def _cases(quick: bool) -> Iterator[Case]:
    for h in (4.0, 2.0) if quick else (4.0, 2.0, 1.0, 0.5):
        yield Case("mesh", f"{h:g} mm", graded_by(h), 4 if quick else 16, h)
    if quick:
        return
    yield Case("default", "default")
    for growth in (1.5, 1.3, 1.08):
        yield Case("growth", f"{growth:g}", {"growth": growth})
    for parts in (1, 2, 4, 8, 32):
        yield Case("sub-steps", f"{parts}", {}, parts)


def measure(quick: bool, repeats: int) -> list[Point]:
    """Return a point for every case; errors are those against the reference."""
    reference, cases = plan(quick)
    exact = {load: _profile(_rolled(reference, load)) for load in loads(quick)}
    points = []
    for case in cases:
        for load in loads(quick):
            if not quick:
                _rolled(case, load)  # mesh, factor and rim are shared by all runs of a study
            run = timed(lambda repeat, case=case, load=load: _rolled(case, load), repeats)
            found = _profile(run.result)
            names = list(MEASURES[load])
            errors = np.abs(found - exact[load]) / BASE.yield_stress
            points.append(
                Point(
                    problem="steady pass",
                    series=case.series,
                    setting=f"{case.setting}, {load}",
                    size=case.size,
                    unknowns=len(run.result[0].part.free),
                    cpu=run.cpu,
                    spread=run.spread,
                    repeats=run.repeats,
                    values=dict(zip(names, found.tolist(), strict=True)),
                    errors=dict(zip(names, errors.tolist(), strict=True)),
                )
            )
    return points


def _rolled(case: Case, load: str) -> tuple[Track, np.ndarray, np.ndarray]:
    """Return the track, and depth and residual sigma_x after the first pass."""
    p = replace(BASE, **LOADS[load], **case.changes)
    track = track_for(p)
    (one,) = steady_passes(p, parts=case.parts)
    left = one.after.whole
    return track, left.depth, left.stress(track.elasticity)[:, 0]


def _profile(rolled: tuple[Track, np.ndarray, np.ndarray]) -> np.ndarray:
    """Return the stress at the depths that are compared."""
    _, depth, stress = rolled
    return np.interp(DEPTHS, depth, stress)
