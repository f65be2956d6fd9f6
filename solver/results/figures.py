"""Numbers of every run: extreme values and cost."""

from __future__ import annotations

import numpy as np

from solver.results.outputs import output
from solver.results.quantities import declare
from solver.results.run import FinishedRun, Values

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
