"""The elastic-plastic punch: plane stress, friction 0.4, no hardening, load_ratio 0.5714.

There is no closed form but the plateau: without friction the pressure in the plastic zone is the
yield stress. The other figures are compared with a run of the finest mesh and the finest
increments. Each series changes one thing and leaves the rest as in the base, so that the error of
the increments bottoms out at the base's mesh error; errors called ``alone`` compare with the
limit of the series instead, and show what that one thing adds.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np

from solver import SCENES, Record
from solver.linear import pardiso
from solver.scenes.punch import PunchParameters
from tests.benchmarks.measure import Point, timed

BASE = PunchParameters(friction=0.4)
ELEMENTS = ("quad8", "quad9", "quad4", "tri6")
MEASURES = {
    "residual_x_half_plane": "residual sigma_x, half-plane, 0.005 a from the corner / Re",
    "residual_x_punch": "residual sigma_x, punch, 0.028 a from the corner / Re",
    "plastic_work": "plastic work, relative",
    "plateau": "pressure in the plastic zone, no friction, largest error / Re",
}
SOLVERS = ("pardiso", "superlu") if pardiso.library() is not None else ("superlu",)
"""Those at hand, the one chosen by default first."""
_FINEST_MESH = {"smallest_element": 2.5e-4, "growth": 1.18}


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One setting of a series: the parameters it changes, and the linear solver."""

    series: str
    setting: str
    changes: Mapping[str, float | int | str] = field(default_factory=dict)
    linear_solver: str = SOLVERS[0]


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """What is run: a base, the references, the series.

    ``finest`` is every figure's reference; ``limits`` are the runs that series of increments
    tend to on the base's mesh.
    """

    base: PunchParameters
    finest: Mapping[str, float | int | str]
    limits: Mapping[str, Mapping[str, float | int | str]]
    cases: tuple[Case, ...]


def _mesh(series: str, sizes: tuple[tuple[float, float], ...], **more: str) -> Iterator[Case]:
    for h, growth in sizes:
        yield Case(
            series=series,
            setting=f"h = {h:g} a, growth {growth:g}",
            changes={"smallest_element": h, "growth": growth, **more},
        )


def _one(name: str, values: tuple[float | int, ...]) -> Iterator[Case]:
    for value in values:
        yield Case(series=name, setting=f"{value:g}", changes={name: value})


def full_plan() -> Plan:
    """Return the plan behind the published figures."""
    elements = ((4e-3, 1.7), (2e-3, 1.55), (1e-3, 1.4))
    return Plan(
        base=BASE,
        finest={**_FINEST_MESH, "load_step": 0.0125, "unload_steps": 10},
        limits={
            "load_step": {"load_step": 0.00625},
            "unload_steps": {"unload_steps": 20},
        },
        cases=(
            Case(series="default", setting="default"),
            *_mesh("mesh", ((8e-3, 2.0), *elements, (5e-4, 1.25))),
            *_mesh("smallest_element", tuple((h, 1.4) for h in (8e-3, 4e-3, 2e-3, 1e-3, 5e-4))),
            *_mesh("growth", tuple((1e-3, g) for g in (2.0, 1.7, 1.4, 1.2))),
            *(c for e in ELEMENTS for c in _mesh(e, elements, element=e)),
            *_one("load_step", (0.2, 0.1, 0.05, 0.025, 0.0125)),
            *_one("unload_steps", (1, 2, 5, 10)),
            *_solvers((4e-3, 2e-3, 1e-3)),
        ),
    )


def quick_plan() -> Plan:
    """Return a plan that takes less than a minute; its base and its reference are coarse."""
    coarse = replace(BASE, smallest_element=4e-3, growth=1.7)
    return Plan(
        base=coarse,
        finest={"smallest_element": 1e-3, "growth": 1.4},
        limits={"load_step": {"load_step": 0.025}, "unload_steps": {"unload_steps": 10}},
        cases=(
            *_mesh("mesh", ((8e-3, 2.0), (4e-3, 1.7), (2e-3, 1.55))),
            *(c for e in ELEMENTS for c in _mesh(e, ((4e-3, 1.7),), element=e)),
            *_one("load_step", (0.2, 0.1, 0.05)),
            *_one("unload_steps", (1, 5)),
            *_solvers((4e-3,)),
        ),
    )


def _solvers(sizes: tuple[float, ...]) -> Iterator[Case]:
    for name in SOLVERS:
        for h in sizes:
            yield Case(
                series=name,
                setting=f"h = {h:g} a",
                changes={"smallest_element": h},
                linear_solver=name,
            )


def measure(plan: Plan, repeats: int) -> list[Point]:
    """Return the points of a plan, the finest run first; equal runs are made once."""
    runs: dict[tuple[PunchParameters, str], Point] = {}

    def point(case: Case) -> Point:
        key = replace(plan.base, **case.changes), case.linear_solver
        if key not in runs:
            runs[key] = _run(*key, repeats)
        return replace(runs[key], series=case.series, setting=case.setting)

    finest = point(Case(series="finest", setting="reference", changes=plan.finest))
    limits = {
        name: point(Case(series=name, setting="limit", changes=changes))
        for name, changes in plan.limits.items()
    }
    points = [replace(finest, errors={"plateau": finest.values["plateau"]})]
    for case in plan.cases:
        this = point(case)
        errors = _errors(this, finest) | {"plateau": this.values["plateau"]}
        if case.series in limits:
            alone = _errors(this, limits[case.series])
            errors |= {f"{name} alone": error for name, error in alone.items()}
        points.append(replace(this, errors=errors))
    return points


def _errors(point: Point, truth: Point) -> dict[str, float]:
    """Return distances from another run: stresses over the yield stress, work relative."""
    scales = {
        "residual_x_half_plane": BASE.yield_stress,
        "residual_x_punch": BASE.yield_stress,
        "plastic_work": abs(truth.values["plastic_work"]),
    }
    return {n: abs(point.values[n] - truth.values[n]) / scale for n, scale in scales.items()}


def _run(parameters: PunchParameters, linear_solver: str, repeats: int) -> Point:
    with _linear_solver(linear_solver):
        run = timed(lambda repeat: _walk(parameters), repeats)
        smooth = _walk(replace(parameters, friction=0.0))
    scalars = run.result.scalars
    names = ("residual_x_half_plane", "residual_x_punch", "plastic_work", "iterations")
    return Point(
        problem="punch",
        series="",
        setting="",
        unknowns=int(scalars["degrees_of_freedom"]),
        cpu=run.cpu,
        spread=run.spread,
        repeats=run.repeats,
        values={name: float(scalars[name]) for name in names} | {"plateau": _plateau(smooth)},
    )


def _walk(parameters: PunchParameters) -> Record:
    (record,) = SCENES["punch"].path(parameters, [parameters.load_ratio], lambda share: None)
    if not record.status.solved:
        raise RuntimeError(f"{record.status.name}: {record.message} ({parameters})")
    return record


def _plateau(record: Record) -> float:
    """Return the largest |pressure / Re - 1| at 0.005 a to 0.025 a from the corner.

    The plastic zone reaches from the corner to 0.035 a.
    """
    distance = 1 - np.asarray(record.coordinates["s"]) / BASE.half_width
    within = (distance > 0.0049) & (distance < 0.0252)
    pressure = record.fields["contact_pressure"][1][0, within]
    return float(np.abs(pressure / BASE.yield_stress - 1).max())


@contextmanager
def _linear_solver(name: str) -> Iterator[None]:
    variable = "RESIDUA_LINEAR_SOLVER"
    before = os.environ.get(variable)
    os.environ[variable] = name
    try:
        yield
    finally:
        if before is None:
            del os.environ[variable]
        else:
            os.environ[variable] = before
