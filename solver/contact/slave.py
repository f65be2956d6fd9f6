"""Which surface of a pair is the slave, whose vertices bear the contact forces.

Contact forces can be no finer than the vertices that bear them, and no finer than the displacements
that answer them. A rigid body has no such displacements: it bears forces only where its edges are
like those of its partner. Of two curved surfaces, which touch in a narrow zone, the one with much
longer edges would not see that zone.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from solver.contact.normals import is_curved
from solver.model.rigid import RigidBody

if TYPE_CHECKING:
    from collections.abc import Mapping

    from solver.fem.surface import Surface
    from solver.model.model import ContactPair, Model

_RIGID = (0.4, 1.1)
"""Edges of a rigid slave / those of its partner."""
_COARSE = 2.0
"""Ratio of the edges of a slave to those of its partner, above which the partner is the slave
where they are curved."""
_NEAR = 0.01
"""Ratio of the distance beyond the nearest one to the edge, up to which a vertex is near
contact."""


def with_slaves(model: Model, surfaces: Mapping[tuple[str, str], Surface]) -> Model:
    """Return the model with slave and master of a pair exchanged where the slave bears no forces.

    ``surfaces`` are those of all pairs.
    """
    return replace(model, contacts=tuple(_ordered(model, c, surfaces) for c in model.contacts))


def _ordered(
    model: Model, contact: ContactPair, surfaces: Mapping[tuple[str, str], Surface]
) -> ContactPair:
    """Return the pair, its sides exchanged where that is better."""
    slave, master = surfaces[contact.slave], surfaces[contact.master]
    if isinstance(model.body(contact.master[0]), RigidBody):
        return contact
    ratio = _edges(slave, master)
    if isinstance(model.body(contact.slave[0]), RigidBody):
        bears = _RIGID[0] <= ratio <= _RIGID[1]
    else:
        bears = ratio <= _COARSE or not (is_curved(slave) or is_curved(master))
    return contact if bears else replace(contact, slave=contact.master, master=contact.slave)


def _edges(slave: Surface, master: Surface) -> float:
    """Return the edges of the slave / those of the master, the median where contact is near."""
    at, partner = slave.X[:, slave.vertices].T, master.X[:, master.vertices].T
    distance, nearest = cKDTree(partner).query(at)
    own, its = slave.spacing, master.spacing
    near = distance <= distance.min() + _NEAR * np.minimum(own, its[nearest])
    return float(np.median(own[near] / its[nearest[near]]))
