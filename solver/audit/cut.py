"""Self-equilibrium of a residual stress on a plane cut."""

from __future__ import annotations

import numpy as np

from solver.fem.discretisation import Discretisation
from solver.fem.fields import Sampler, recovery
from solver.typing import Array


def cut_force(part: Discretisation, stress: Array, where: Array) -> float:
    """Return the normal force on a plane cut, over yield stress times area of the cut.

    A residual stress is self-equilibrated: the result is zero up to discretisation error.

    Parameters
    ----------
    stress : (4, n_points) Mandel [MPa]
    where : (2, n) points along the straight cut [mm]
    """
    along = where[:, -1] - where[:, 0]
    length = float(np.linalg.norm(along))
    n = np.array([along[1], -along[0]]) / length
    s = Sampler(part, where)((recovery(part) @ stress.T).T)
    traction = n[0] ** 2 * s[0] + n[1] ** 2 * s[1] + np.sqrt(2) * n[0] * n[1] * s[3]
    t = np.linalg.norm(where - where[:, :1], axis=0)
    measure = np.broadcast_to(part.measure(where), len(t))
    area = float(np.trapezoid(measure, t))
    return float(np.trapezoid(traction * measure, t)) / (area * part.body.material.yield_stress)
