"""Rolling by increments: one pass over a short track, load ratio 2.71, no hardening.

There is no closed form. The reference is a run of the finest elements and the shortest advance;
each series changes one thing and leaves the rest as it is by default. Stress under mid-track
contains that of the ends of the track, in the reference too.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from solver import SCENES, Record
from solver.rolling.scenes.rolling import RollingParameters
from tests.benchmarks.measure import Point, timed
from tests.benchmarks.steady import LOADS, graded_by, loads

BASE = RollingParameters(track=20.0)
QUICK = {"track": 8.0, "advance_step": 4.0, "press_steps": 4, "unload_steps": 1}
SERIES = ("mesh", "advance", "growth")
FIRST_ROW = "first row"
DEPTHS = (2.0, 5.0)
MEASURES = {
    FIRST_ROW: "residual sigma_x at the first row of points / Re",
    **{f"{depth:g} mm": f"residual sigma_x at {depth:g} mm / Re" for depth in DEPTHS},
}


@dataclass(frozen=True, slots=True)
class Case:
    """One setting of a series: the parameters it changes, and their size [mm or 1]."""

    series: str
    setting: str
    changes: Mapping[str, float] = field(default_factory=dict)
    size: float = float("nan")


def plan(quick: bool) -> tuple[Case, tuple[Case, ...]]:
    """Return the reference, and the cases."""
    h, others = (4 / 3, QUICK) if quick else (0.25, {"advance_step": 0.125})
    return Case("reference", "finest", {**graded_by(h), **others}), tuple(_cases(quick))


def _cases(quick: bool) -> Iterator[Case]:
    for h in (4.0, 2.0) if quick else (4.0, 2.0, 1.0, 0.5):
        yield Case("mesh", f"{h:g} mm", {**graded_by(h), **(QUICK if quick else {})}, h)
    if quick:
        return
    yield Case("default", "default")
    for advance in (2.0, 1.0, 0.5, 0.25):
        yield Case("advance", f"{advance:g} mm", {"advance_step": advance}, advance)
    for growth in (1.5, 1.3, 1.08):
        yield Case("growth", f"{growth:g}", {"growth": growth}, growth - 1)


def measure(quick: bool, repeats: int) -> list[Point]:
    """Return a point for every case and load; errors are those against the first, the reference."""
    reference, cases = plan(quick)
    points = []
    for load in loads(quick):
        exact = _point(reference, load, 1)
        points.append(exact)
        for case in cases:
            p = _point(case, load, repeats)
            errors = {n: abs(v - exact.values[n]) / BASE.yield_stress for n, v in p.values.items()}
            points.append(replace(p, errors=errors))
    return points


def _point(case: Case, load: str, repeats: int) -> Point:
    p = replace(BASE, **LOADS[load], **case.changes)
    run = timed(lambda _: rolled(p), repeats)
    return Point(
        problem="rolling",
        series=case.series,
        setting=f"{case.setting}, {load}",
        size=case.size,
        unknowns=int(run.result.scalars["degrees_of_freedom"]),
        cpu=run.cpu,
        spread=run.spread,
        repeats=run.repeats,
        values=_values(run.result),
    )


def rolled(parameters: RollingParameters) -> Record:
    """Return the record of a run; raise where it failed."""
    (record,) = SCENES["rolling"].path(parameters, [parameters.passes], lambda share: None)
    if not record.status.solved:
        raise RuntimeError(f"{record.status.name}: {record.message} ({parameters})")
    return record


def _values(record: Record) -> dict[str, float]:
    """Return the residual stress sigma_x under mid-track [MPa]."""
    dims, profile = record.fields["residual_profile"]
    del dims  # pass, station, component, depth
    middle = np.asarray(profile)[-1, 1, 0]
    values = np.interp(DEPTHS, record.coordinates["depth"], middle)
    below = dict(zip(list(MEASURES)[1:], values.tolist(), strict=True))
    return {FIRST_ROW: float(record.scalars["first_row_residual_x"]), **below}
