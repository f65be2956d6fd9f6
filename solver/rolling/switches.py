"""How near a steady pass is to a switch: see `solver.derivatives.switches`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from solver.contact.problem import OPEN, STICK
from solver.rolling.passing import Pass
from solver.rolling.plane.wheel import RollingContact
from solver.typing import Array


def distances(found: Pass[Any]) -> Array:
    """Return the distances (n,) of a pass from all switches, over their scales; NaN without one.

    A point of a row yields between two columns or not. The scales are the yield stress, the
    displacement of the axle and the load.
    """
    return np.concatenate([each.ravel() for each in (_of_flow(found), *_of_contact(found.loading))])


def _of_flow(found: Pass[Any]) -> Array:
    """Return for each point: stress below yield, or flow since the column before."""
    law, states = found.law, found.states
    at_rest = found.before.strain(law.elasticity)[:, None]
    elastic = np.moveaxis(at_rest + found.strain, 2, 0) - states.plastic_strain
    stress = np.tensordot(law.stiffness(len(elastic)), elastic, axes=1)
    flow = np.diff(states.accumulated, axis=1, prepend=found.before.accumulated[:, None])
    below = -law.yield_value(stress, states)
    return np.asarray(below - 2 * law.elasticity.shear_modulus * flow) / law.yield_stress


def _of_contact(contact: Any) -> Iterator[Array]:
    """Yield for each vertex: gap or normal force; shear below its bound, or slip."""
    if not isinstance(contact, RollingContact):
        return
    length, force = abs(contact.height) or 1.0, float(contact.normal.sum()) or 1.0
    yield contact.gap / length - contact.normal / force
    below = (contact.bound - np.abs(contact.tangential)) / force
    held = np.where(contact.status == STICK, below, -np.abs(contact.slip) / length)
    yield np.where(contact.status == OPEN, np.nan, held)
