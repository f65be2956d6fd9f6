"""Numbers of every run: extremes of plastic strain and residual stress with positions, and cost."""

from __future__ import annotations

from collections import defaultdict
from typing import NamedTuple

import numpy as np

from solver.results.outputs import output
from solver.results.quantities import Quantity, along_axes, declare, declare_along
from solver.results.run import FinishedRun, Values
from solver.typing import Array

_OVER = ("body", "component")
_ROUNDING, _SAME = 1e-9, 1e-6
"""Stress over the least yield stress, up to which it is rounding and has no position. Relative
difference up to which stresses are equal."""


class Extreme(NamedTuple):
    """Extreme residual stress in a body, and at its contact surface, with its positions."""

    inside: Quantity
    place: tuple[Quantity, ...]
    surface: Quantity
    s: Quantity


def _extreme(word: str, which: str) -> Extreme:
    """Return the quantities of an extreme, such as ``residual_max``, the largest stress."""
    stress = f"{which} residual stress"
    return Extreme(
        declare(f"residual_{word}", f"{stress} in the body", "MPa", dims=_OVER),
        declare_along(
            f"residual_{word}_{{}}", f"position along {{}} of the {stress} in the body", "mm",
            dims=_OVER,
        ),
        declare(
            f"surface_residual_{word}", f"{stress} at the contact surface", "MPa", dims=_OVER
        ),
        declare(
            f"surface_residual_{word}_s",
            f"distance along the surface from its middle of the {stress} there", "mm", dims=_OVER,
        ),
    )  # fmt: skip


LARGEST, SMALLEST = _extreme("max", "largest"), _extreme("min", "smallest")


@output("residual_extremes", "surfaces", "release")
def residual_extremes(run: FinishedRun) -> Values:
    """Return the extreme residual stresses at the nodes of each body and of its contact surface.

    If several nodes have the same stress, as along a track after a pass, the position is that of
    the node nearest to the middle of the contact. It is NaN if there is no stress.
    """
    laws = [run.system.full(name).body.material for name in run.system.names]
    least = [min(law.yield_stress, law.elasticity.youngs_modulus) for law in laws]
    none = _ROUNDING * min(least)
    found: defaultdict[Quantity, list[Array]] = defaultdict(list)
    for name, boundary in run.view.surfaces.items():
        body = run.system.full(name)
        stress = run.samples.fields.at_nodes(run.unloaded, name).stress
        away = np.abs(run.view.axis.reached(body.X))
        surface = body.boundary_nodes(boundary)
        s = run.view.axis.reached(body.X[:, surface])
        for extreme, sign in ((LARGEST, 1.0), (SMALLEST, -1.0)):
            inside, at = _most(sign * stress, none, body.X, away)
            along, (where,) = _most(sign * stress[:, surface], none, s[None], away[surface])
            of_body = {
                extreme.inside: sign * inside,
                **along_axes(extreme.place, at),
                extreme.surface: sign * along,
                extreme.s: where,
            }
            for quantity, values in of_body.items():
                found[quantity].append(values)
    return {quantity: np.stack(values) for quantity, values in found.items()}


def _most(stress: Array, none: float, X: Array, away: Array) -> tuple[Array, Array]:
    """Return the largest value of each component (n,), and its position (n_axes, n).

    Parameters
    ----------
    stress : (n, n_nodes) [MPa]
    none : stress up to which there is no position [MPa]
    X, away : positions of the nodes (n_axes, n_nodes), and their distance from the middle
        (n_nodes,) [mm]
    """
    most = np.nanmax(stress, axis=1)
    same = stress >= most[:, None] - _SAME * np.abs(most[:, None])
    nodes = np.where(same, away, np.inf).argmin(axis=1)
    return most, np.where(np.abs(most) > none, X[:, nodes], np.nan)


MAX_PLASTIC_STRAIN = declare(
    "max_plastic_strain", "largest equivalent plastic strain after unloading"
)
DEPTH_OF_MAX_PLASTIC_STRAIN = declare(
    "depth_of_max_plastic_strain",
    "depth of the largest plastic strain below the surface; negative in the upper body", "mm",
)  # fmt: skip
PEAK_RESIDUAL_TENSION = declare(
    "peak_residual_tension", "largest normal component of the residual stress", "MPa"
)
PEAK_RESIDUAL_COMPRESSION = declare(
    "peak_residual_compression", "smallest normal component of the residual stress", "MPa"
)
PLASTIC_WORK = declare("plastic_work", "plastic work in the meshed part of the bodies", "N mm")

INCREMENTS = declare("increments", "load increments", count=True)
CUT_INCREMENTS = declare("cut_increments", "load increments that were cut", count=True)
ITERATIONS = declare("iterations", "Newton iterations", count=True)
MEDIAN_ITERATIONS = declare("median_iterations", "median Newton iterations per increment")
INNER_FALLBACKS = declare(
    "inner_fallbacks", "iterations whose contact problem needed pivoting", count=True
)
BLENDED_TANGENTS = declare("blended_tangents", "iterations with a stiffened tangent", count=True)
CPU_SECONDS = declare("cpu_seconds", "processor time", "s")
DEGREES_OF_FREEDOM = declare("degrees_of_freedom", "degrees of freedom", count=True)


@output("extremes", "release")
def extremes(run: FinishedRun) -> Values:
    """Return the largest plastic strain, the extreme residual stresses, and the plastic work."""
    system = run.system
    names = system.names
    strains = {n: system.state(n, run.unloaded).plastic.accumulated for n in names}
    largest = {name: float(np.nanmax(each)) for name, each in strains.items()}
    most = max(names, key=lambda name: largest[name])
    where = run.view.below(system.positions(most)[:, [np.nanargmax(strains[most])]])[0]
    residual = [run.samples.fields.at_nodes(run.unloaded, name).stress[:3] for name in names]
    return {
        MAX_PLASTIC_STRAIN: largest[most],
        DEPTH_OF_MAX_PLASTIC_STRAIN: float(where) if largest[most] > 0 else np.nan,
        PEAK_RESIDUAL_TENSION: float(max(np.nanmax(r) for r in residual)),
        PEAK_RESIDUAL_COMPRESSION: float(min(np.nanmin(r) for r in residual)),
        PLASTIC_WORK: run.outcome.tally.plastic_work,
    }


def cost(run: FinishedRun) -> Values:
    """Return counts of increments, iterations and unknowns, and the processor time."""
    tally = run.outcome.tally
    return {
        INCREMENTS: len(tally.iterations),
        CUT_INCREMENTS: tally.cuts,
        ITERATIONS: sum(tally.iterations),
        MEDIAN_ITERATIONS: float(np.median(tally.iterations)) if tally.iterations else 0.0,
        INNER_FALLBACKS: tally.pivoted,
        BLENDED_TANGENTS: tally.blended,
        CPU_SECONDS: tally.seconds,
        DEGREES_OF_FREEDOM: float(run.system.n_unknowns),
    }
