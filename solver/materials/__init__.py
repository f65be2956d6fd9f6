"""Material laws: (strain, state, material) -> (stress, tangent, new state).

A law never changes the state it is given; a state becomes history only when the increment
that made it has converged.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from solver.materials import plane_stress, von_mises
from solver.materials.state import PlasticState, Response

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from solver.materials.material import Material


def respond(
    strain: NDArray[np.float64], state: PlasticState, material: Material, kinematics: str
) -> Response:
    """Return the response of ``material`` in the two-dimensional state ``kinematics``."""
    law = plane_stress.projected_return if kinematics == "plane_stress" else von_mises.radial_return
    return law(strain, state, material)


def elastic_stiffness(material: Material, kinematics: str) -> NDArray[np.float64]:
    """Return the elastic stiffness (4, 4) on Mandel strain in the state ``kinematics`` [MPa]."""
    if kinematics == "plane_stress":
        return plane_stress.elastic_stiffness(material)
    return von_mises.elastic_stiffness(material)


__all__ = ["PlasticState", "Response", "elastic_stiffness", "respond"]
