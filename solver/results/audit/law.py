"""The error of the last increment in time, estimated with smaller steps."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.tensors import to_tensor

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.materials import Law, PlasticState

    Array = NDArray[np.float64]


def increment_error(
    law: Law, strains: tuple[Array, Array], stress: Array, before: PlasticState, steps: int = 4
) -> float:
    """Return the largest change of a stress component by smaller steps, over the yield stress.

    Parameters
    ----------
    strains : two Mandel strains (n_components, n), start and end of a straight strain path
    stress : (n_components, n) result of one step to the second strain, Mandel [MPa]
    before : internal variables at the first strain
    steps : number of steps the increment is divided into
    """
    first, last = strains
    found, state = stress, before
    for k in range(1, steps + 1):
        found, _, state, _ = law.respond(first + (last - first) * k / steps, state)
    return float(np.abs(to_tensor(found - stress)).max(initial=0.0)) / law.yield_stress
