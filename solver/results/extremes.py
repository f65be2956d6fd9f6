"""The largest and smallest residual stress of each body and component, with their positions."""

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


LARGEST = Extreme(
    declare("residual_max", "largest residual stress in the body", "MPa", dims=_OVER),
    declare_along(
        "residual_max_{}", "position along {} of the largest residual stress in the body", "mm",
        dims=_OVER,
    ),
    declare(
        "surface_residual_max", "largest residual stress at the contact surface", "MPa",
        dims=_OVER,
    ),
    declare(
        "surface_residual_max_s",
        "distance along the surface from its middle of the largest residual stress there", "mm",
        dims=_OVER,
    ),
)  # fmt: skip
SMALLEST = Extreme(
    declare("residual_min", "smallest residual stress in the body", "MPa", dims=_OVER),
    declare_along(
        "residual_min_{}", "position along {} of the smallest residual stress in the body", "mm",
        dims=_OVER,
    ),
    declare(
        "surface_residual_min", "smallest residual stress at the contact surface", "MPa",
        dims=_OVER,
    ),
    declare(
        "surface_residual_min_s",
        "distance along the surface from its middle of the smallest residual stress there", "mm",
        dims=_OVER,
    ),
)  # fmt: skip


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
