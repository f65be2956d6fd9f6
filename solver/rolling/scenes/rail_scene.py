"""What scenes of passes over a prism have in common."""

from __future__ import annotations

from typing import Any

from solver.late import Late, late
from solver.results.record import Status
from solver.scenes.scene import Scene


def rail_scene(
    name: str, summary: str, parameters: type[Any], *, geometry: Late, outputs: tuple[Late, ...],
    advice: str,
) -> Scene:  # fmt: skip
    """Return a scene whose set-up is in ``NAME_setup``.

    Parameters
    ----------
    geometry : (parameters) -> what the set-up depends on
    outputs : those beside maps, profiles, extremes, the contact patch and the section
    advice : what to do if a pass does not converge
    """
    method, view, sketch, effort = late(
        f"rolling.scenes.{name}_setup", "method", "view", "sketch", "effort"
    )
    return Scene(
        name=name,
        summary=summary,
        parameters=parameters,
        branch="passes",
        method=method,
        view=view,
        sketch=sketch,
        outputs=(
            *late("results.maps", "maps", "profiles"),
            *late("results.extremes", "residual_extremes"),
            *late("results.figures", "extremes"),
            *late("rolling.scenes.rail_outputs", "patch", "section"),
            *outputs,
        ),
        costs=late("results.figures", "cost"),
        effort=effort,
        setup=geometry,
        advice={
            Status.LIMIT_LOAD: "lower load or traction, or let the material harden",
            Status.NOT_CONVERGED: advice,
        },
    )
