"""Choice of the slave of a pair: the surface whose vertices carry the contact forces.

Contact forces need displacements of the same resolution. A rigid body has no displacement unknowns
at its vertices: it is the slave only if its edges are about as long as those of its partner. Two
curved surfaces touch in a narrow zone, which a surface with much longer edges does not resolve.
A curved body held by contact alone stands on one vertex at first. As the slave it stands on a
vertex of its own, which moves with it; as the master any small moment turns it to the next vertex.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np

from solver.contact.normals import is_curved
from solver.fem.surface import Surface
from solver.model.contact_pair import ContactPair
from solver.model.model import Model
from solver.model.rigid import RigidBody

_RIGID = (0.4, 1.1)
"""Edge length of a rigid slave over that of its partner: permitted range."""
_COARSE = 2.0
"""Edge length of a slave over that of its partner: with a larger ratio the partner becomes the
slave if one of them is curved."""
_STANDS = 0.75
"""The same ratio if the partner is curved and contact alone holds it."""
_AT_ONCE = 1_000_000
"""Number of distances between vertices in memory at a time, about."""
_NEAR = 0.01
"""(Distance of a vertex - least distance) over the edge length: vertices up to this ratio are near
contact."""


def with_slaves(
    model: Model, surfaces: Mapping[tuple[str, str], Surface], free: Collection[str]
) -> Model:
    """Return the model with slave and master exchanged in the pairs where this is better.

    ``surfaces`` are those of all pairs, by body and boundary; ``free`` are the names of bodies held
    by contact alone.
    """
    contacts = tuple(_ordered(model, contact, surfaces, free) for contact in model.contacts)
    return replace(model, contacts=contacts)


def _ordered(
    model: Model,
    contact: ContactPair,
    surfaces: Mapping[tuple[str, str], Surface],
    free: Collection[str],
) -> ContactPair:
    """Return the pair, its sides exchanged if this is better."""
    slave, master = surfaces[contact.slave], surfaces[contact.master]
    if isinstance(model.body(contact.master[0]), RigidBody):
        return contact
    ratio = _edges(slave, master)
    if isinstance(model.body(contact.slave[0]), RigidBody):
        suitable = _RIGID[0] <= ratio <= _RIGID[1]
    else:
        stands = is_curved(master) and contact.master[0] in free and contact.slave[0] not in free
        most = _STANDS if stands else _COARSE
        suitable = ratio <= most or not (is_curved(slave) or is_curved(master))
    return contact if suitable else replace(contact, slave=contact.master, master=contact.slave)


def _edges(slave: Surface, master: Surface) -> float:
    """Return the median ratio of edge lengths, slave over master, at the vertices near contact."""
    at, partner = slave.X[:, slave.vertices], master.X[:, master.vertices]
    pieces = np.array_split(at, at.shape[1] * partner.shape[1] // _AT_ONCE + 1, axis=1)
    each = (np.hypot(*(piece[:, :, None] - partner[:, None])) for piece in pieces)
    nearest = np.concatenate([apart.argmin(axis=1) for apart in each])
    distance = np.hypot(*(at - partner[:, nearest]))
    own, its = slave.spacing, master.spacing
    near = distance <= distance.min() + _NEAR * np.minimum(own, its[nearest])
    return float(np.median(own[near] / its[nearest[near]]))
