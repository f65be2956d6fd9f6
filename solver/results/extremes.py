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


def _declared(most: str, words: str) -> tuple[Quantity, ...]:
    """Declare an extreme in a body, and on its contact surface, each with its place."""
    place = f"of the {words} residual stress in the body"
    return (
        declare(f"residual_{most}", f"{words} residual stress in the body", "MPa", dims=_OVER),
        declare(f"residual_{most}_x", f"position along x {place}", "mm", dims=_OVER),
        declare(f"residual_{most}_y", f"position along y {place}", "mm", dims=_OVER),
        declare(
            f"surface_residual_{most}", f"{words} residual stress at the contact surface", "MPa",
            dims=_OVER,
        ),
        declare(
            f"surface_residual_{most}_s",
            f"distance along the surface from its middle {place.replace('in the body', 'there')}",
            "mm", dims=_OVER,
        ),
    )  # fmt: skip


LARGEST = _declared("max", "largest")
SMALLEST = _declared("min", "smallest")


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
