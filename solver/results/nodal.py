"""All fields of a body at its nodes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from solver.results.samples import Nodal
from solver.tensors import not_below_zero, to_tensor, von_mises

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from solver.results.samples import Bodies, Solved

    Array = NDArray[np.float64]


def nodal_fields(system: Bodies, body: str, at: Solved) -> dict[str, Array]:
    """Return fields at the nodes of a body, components first.

    They are displacement (2, n) [mm], stress (4, n) [MPa], von Mises stress (n,) [MPa] and
    equivalent plastic strain (n,).
    """
    nodal = Nodal(system)
    stress = system.response(body, at).stress
    return {
        "displacement": system.displacement(body, at.state).reshape(-1, 2).T,
        "stress": to_tensor(nodal.stress(body, at)),
        # recovered from the points: that of recovered stress would go beyond the strength
        "von_mises": not_below_zero(nodal.of_points(body, von_mises(stress))),
        "plastic_strain": nodal.plastic_strain(body, at),
    }
