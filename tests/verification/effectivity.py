"""How well the estimated error of stress in the energy norm tells the true one."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from solver.fem.discretisation import Discretisation
from solver.fem.error import ErrorPoints

Array = NDArray[np.float64]


def effectivity(
    part: Discretisation,
    stress: Array,
    exact: Callable[[Array], Array],
    within: float = np.inf,
) -> float:
    """Return the estimated error / the true error, both in the energy norm.

    Parameters
    ----------
    stress : (4, n_points) at the points of the elements, Mandel [MPa]
    exact : gives the Mandel stress (4, n) at positions (2, n)
    within : elements count whose middle has coordinates up to this size [mm]
    """
    points = ErrorPoints(part)
    computed = points.computed(stress)
    truth = exact(points.x.reshape(2, -1)).reshape(computed.shape)
    counted = (np.abs(points.x.mean(axis=2)) < within).all(axis=0)
    estimated, true = (
        points.energies(field - computed)[counted].sum()
        for field in (points.recovered(stress), truth)
    )
    return float(np.sqrt(estimated / true))
