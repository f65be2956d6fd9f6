"""The largest and smallest residual stress, by body and component, and where each of them is."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.results.outputs import output
from solver.results.quantities import Quantity, declare

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.results.run import FinishedRun, Values

    Array = NDArray[np.float64]

_OVER = ("body", "component")
_ROUNDING, _SAME = 1e-9, 1e-6
"""Stress / least yield stress that is rounding, and has no place; relative difference of it."""


LARGEST = (
    declare("residual_max", "largest residual stress in the body", "MPa", dims=_OVER),
    declare(
        "residual_max_x", "position along x of the largest residual stress in the body", "mm",
        dims=_OVER,
    ),
    declare(
        "residual_max_y", "position along y of the largest residual stress in the body", "mm",
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
SMALLEST = (
    declare("residual_min", "smallest residual stress in the body", "MPa", dims=_OVER),
    declare(
        "residual_min_x", "position along x of the smallest residual stress in the body", "mm",
        dims=_OVER,
    ),
    declare(
        "residual_min_y", "position along y of the smallest residual stress in the body", "mm",
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
"""In the body, with x and y; at its contact surface, with s."""


@output("residual_extremes", "surfaces", "release")
def residual_extremes(run: FinishedRun) -> Values:
    """Return the extreme residual stresses at the nodes of each body and of its contact surface.

    Of nodes with the same stress, as on a track that a pass leaves alike along x, the one nearest
    to the middle of the contact is taken; where there is no stress, none.
    """
    laws = [run.system.full(name).body.material for name in run.system.names]
    least = [min(law.yield_stress, law.elasticity.youngs_modulus) for law in laws]
    none = _ROUNDING * min(least)
    found: dict[Quantity, list[Array]] = {each: [] for each in LARGEST + SMALLEST}
    for name, boundary in run.view.surfaces.items():
        body = run.system.full(name)
        stress = run.samples.fields.at_nodes(run.unloaded, name).stress
        away = np.abs(run.view.axis.reached(body.X))
        surface = body.boundary_nodes(boundary)
        s = run.view.axis.reached(body.X[:, surface])
        for quantities, sign in ((LARGEST, 1.0), (SMALLEST, -1.0)):
            inside, at = _most(sign * stress, none, body.X, away)
            along, where = _most(sign * stress[:, surface], none, s[None], away[surface])
            inside, along = sign * inside, sign * along
            for quantity, values in zip(quantities, (inside, *at, along, *where), strict=True):
                found[quantity].append(values)
    return {quantity: np.stack(values) for quantity, values in found.items()}


def _most(stress: Array, none: float, X: Array, away: Array) -> tuple[Array, Array]:
    """Return the largest value of each component (4,), and its place (n, 4).

    Parameters
    ----------
    X, away : positions of the nodes (n, n_nodes), and their distance from the middle (n_nodes,)
    """
    most = stress.max(axis=1)
    same = stress >= most[:, None] - _SAME * np.abs(most[:, None])
    nodes = np.where(same, away, np.inf).argmin(axis=1)
    return most, np.where(np.abs(most) > none, X[:, nodes], np.nan)
