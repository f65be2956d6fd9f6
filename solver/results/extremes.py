"""The largest and smallest residual stress, by body and component, and where each of them is."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.results.quantities import Quantity, declare
from solver.tensors import to_tensor

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.results.look import Look, Values

    Array = NDArray[np.float64]

_OVER = ("body", "component")
_ROUNDING = 1e-9
"""Stress / yield stress that is rounding: it has no place."""


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


def residual_extremes(look: Look) -> Values:
    """Return the extreme residual stresses at the nodes of each body and of its contact surface.

    Where two nodes have the same stress the first one is told; where there is no stress, none.
    """
    none = _ROUNDING * look.parameters.yield_stress
    found: dict[Quantity, list[Array]] = {each: [] for each in LARGEST + SMALLEST}
    for name, boundary in look.view.surfaces.items():
        body = look.system.full(name)
        stress = to_tensor(look.samples.stress(name, look.unloaded))
        surface = body.boundary_nodes(boundary)
        s = look.view.axis.reached(body.X[:, surface])
        for quantities, sign in ((LARGEST, 1.0), (SMALLEST, -1.0)):
            inside, at = _most(stress, sign, none, body.X)
            along, where = _most(stress[:, surface], sign, none, s[None])
            for quantity, values in zip(quantities, (inside, *at, along, *where), strict=True):
                found[quantity].append(values)
    return {quantity: np.stack(values) for quantity, values in found.items()}


def _most(stress: Array, sign: float, none: float, X: Array) -> tuple[Array, Array]:
    """Return the extreme of each component (4,), and its place (n, 4)."""
    nodes = (sign * stress).argmax(axis=1)
    values = stress[np.arange(len(stress)), nodes]
    return values, np.where(np.abs(values) > none, X[:, nodes], np.nan)
