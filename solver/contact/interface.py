"""Contact pairs on the parts of a system; which of their sides is the slave.

Contact forces need displacements of the same resolution. A rigid body has no displacement unknowns
at its vertices: it is the slave only if its edges are about as long as those of its partner. Two
curved surfaces touch in a narrow zone, which a surface with much longer edges does not resolve.
A curved body held by contact alone stands on one vertex at first. As the slave it stands on a
vertex of its own, which moves with it; as the master any small moment turns it to the next vertex.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from solver.contact.geometry import Pairing, is_curved, is_smooth, pair
from solver.contact.overlap import check_overlap, largest_overlap
from solver.errors import ModelError
from solver.fem.discretisation import Discretisation
from solver.fem.large import LargeDiscretisation
from solver.fem.loads import Softening
from solver.fem.part import Part
from solver.fem.rigid import RigidPart
from solver.fem.surface import Surface
from solver.model.model import Model
from solver.model.pairs import ContactPair
from solver.model.rigid import RigidBody
from solver.typing import Array


@dataclass(frozen=True, slots=True)
class Interface:
    """A declared contact pair on its two parts of the system.

    ``hot`` is the thermal softening of slave and master; ``reach`` the largest overlap [mm] at
    which surfaces still face each other; ``reference`` the pairing before loading, which small
    sliding keeps. ``along_master`` says that forces act along the master's normals. Those of a
    smooth rigid body are exact, those of a surface that bends around it are not: forces along them
    work as the body slides. Along the slave's normals, a force and its reaction have one line of
    action, which an axisymmetric body does not need.
    """

    declared: ContactPair
    slave: int
    master: int
    slave_surface: Surface
    master_surface: Surface
    hot: tuple[Softening | None, Softening | None]
    parts: tuple[Part, Part]
    reach: float
    reference: Pairing | None
    along_master: bool

    @property
    def rough(self) -> bool:
        """Whether the contact carries shear."""
        return self.declared.law.rough

    @property
    def sides(self) -> tuple[tuple[int, Part, Surface], tuple[int, Part, Surface]]:
        """Slave and master: number, part and surface."""
        return (
            (self.slave, self.parts[0], self.slave_surface),
            (self.master, self.parts[1], self.master_surface),
        )

    @property
    def finite(self) -> bool:
        """Whether sliding is finite from the beginning, so that each iteration pairs surfaces."""
        return self.reference is None

    @property
    def floating(self) -> bool:
        """Whether contact has to hold a rigid motion of either part."""
        return any(part.rigid.shape[1] for part in self.parts)

    def pairing(self, u: tuple[Array, ...], time: float = 0.0, *, finite: bool = False) -> Pairing:
        """Return gap, area and derivative rows at displacements ``u`` and a time.

        If ``finite``, the surfaces are paired in their current positions; otherwise small sliding
        keeps the pairing before loading. The surfaces of an absent pair face each other nowhere.
        """
        found = self.facing(u, time, finite=finite)
        return found.parted if self.declared.absent(time) else found

    def facing(self, u: tuple[Array, ...], time: float, *, finite: bool) -> Pairing:
        """Return the pairing of `pairing`, but as if an absent pair were present."""
        as_meshed = self._as_meshed(u, finite)
        return replace(as_meshed, gap=as_meshed.gap + self.declared.offset(time))

    def strength(self, pairing: Pairing, time: float) -> Array:
        """Return the mean shear yield stress (n,) under each hat, of the weaker body [MPa]."""
        least = np.full(len(pairing.gap), np.inf)
        for part, hot, rows in zip(self.parts, self.hot, pairing.normal, strict=True):
            strength = part.body.material.shear_yield_stress
            ratio = 1.0 if hot is None else _mean(rows, hot.strong(time))
            least = np.minimum(least, strength * ratio)
        return least

    def slip(
        self,
        pairing: Pairing,
        u: tuple[Array, ...],
        since: tuple[Array, ...] | None = None,
    ) -> Array:
        """Return the slip (n,) of the slave's vertices at displacements ``u`` [mm].

        Slip counts from the displacements ``since``, by default from the undeformed bodies.
        """
        slip = np.zeros(len(pairing.gap))
        for (number, part, chain), rows in zip(self.sides, pairing.tangent, strict=True):
            moved = part.motion(chain, u[number])
            if since is not None:
                moved = moved - part.motion(chain, since[number])
            slip += rows @ moved.T.ravel()
        return slip

    def _as_meshed(self, u: tuple[Array, ...], finite: bool) -> Pairing:
        motions = [part.motion(chain, u[number]) for number, part, chain in self.sides]
        if self.reference is not None and not finite:
            change = sum(
                block @ motion.T.ravel()
                for block, motion in zip(self.reference.normal, motions, strict=True)
            )
            known = self.reference
            return replace(known, gap=known.gap + change, closing=known.normal)
        return pair(
            self.slave_surface, motions[0], self.master_surface, motions[1], self.reach,
            along_master=self.along_master,
        )  # fmt: skip


def _mean(rows: Array, values: Array) -> Array:
    """Return the means (n,) under the hats of ``values`` at a surface's nodes; 1 without a partner.

    ``rows`` (n, 2 n_nodes) are those of gaps, which are the weights of the means times the normal.
    """
    each = rows.reshape(len(rows), -1, 2)
    normal = each.sum(axis=1)
    size = (normal**2).sum(axis=1)
    along = np.einsum("nkd,nd->nk", each, normal) @ values
    return np.divide(along, size, out=np.ones(len(rows)), where=size > 0)


def surfaces_of(
    model: Model, wholes: Mapping[str, Discretisation | RigidPart]
) -> dict[tuple[str, str], Surface]:
    """Return the surfaces of all pairs in the numbering of the whole bodies.

    If a surface continues as the surface of another pair, contact may pass this end.
    """
    found = {
        side: wholes[side[0]].chain(side[1])
        for contact in model.contacts
        for side in (contact.slave, contact.master)
    }
    ends = {side: chain.nodes[chain.vertices[[0, -1]]] for side, chain in found.items()}

    def alone(side: tuple[str, str], node: int) -> bool:
        return not any(node in ends[o] for o in ends if o[0] == side[0] and o != side)

    out = {}
    for side, chain in found.items():
        start, end = (
            on and alone(side, node)
            for on, node in zip(chain.goes_on, ends[side].tolist(), strict=True)
        )
        out[side] = replace(chain, goes_on=(start, end))
    return out


def interface_of(
    contact: ContactPair,
    parts: tuple[Part, ...],
    names: list[str],
    surfaces: dict[tuple[str, str], Surface],
) -> Interface:
    """Return a contact pair on the parts, which ``names`` lists in their order.

    ``surfaces`` are those of all pairs, by body and boundary.

    Raises
    ------
    ModelError
        if the bodies overlap too much, or the surfaces do not face each other before loading
    """
    sides = []
    for side in (contact.slave, contact.master):
        number, chain = names.index(side[0]), surfaces[side]
        sides.append((number, parts[number].surface(chain)))
    (slave, slave_surface), (master, master_surface) = sides
    both = (parts[slave], parts[master])
    check_overlap(both[0].body, both[1].body, (slave_surface, master_surface))
    sizes = [float(part.body.box.max()) for part in both]
    reference, reach = None, sizes[0] if np.isfinite(sizes[0]) else sizes[1]
    curved = any(is_curved(chain) for _, chain in sides)
    small = contact.sliding == "small" or (contact.sliding == "auto" and not curved)
    small &= not any(isinstance(part, LargeDiscretisation) for part in both)
    if small:
        reach = largest_overlap(both[0].body, both[1].body)
    if small or not any(part.rigid.shape[1] or part.driven.fields.any() for part in both):
        at_rest = [np.zeros_like(chain.X) for _, chain in sides]
        reference = pair(slave_surface, at_rest[0], master_surface, at_rest[1], reach)
        if not reference.area.any():
            raise ModelError(
                "contacts", ".".join(contact.slave),
                f"this and {'.'.join(contact.master)} do not face each other: before loading no "
                "normal of the slave meets the outside of the master. Check the boundaries and the "
                "positions of the bodies",
            )  # fmt: skip
    hot = [_hot(part, chain) for part, (_, chain) in zip(both, sides, strict=True)]
    return Interface(
        declared=contact,
        slave=slave,
        master=master,
        slave_surface=slave_surface,
        master_surface=master_surface,
        hot=(hot[0], hot[1]),
        parts=both,
        reach=reach,
        reference=reference if small else None,
        along_master=_revolves(both[1], master_surface),
    )


def _revolves(part: Part, surface: Surface) -> bool:
    """Whether a surface is a smooth one of a rigid body of revolution."""
    return isinstance(part, RigidPart) and surface.thickness is None and is_smooth(surface)


def _hot(part: Part, surface: Surface) -> Softening | None:
    """Return the softening at a surface's nodes; None if the yield stress is constant."""
    if not isinstance(part, Discretisation):
        return None
    heat = Softening.of(part, part.X[:, surface.nodes])
    return heat if heat and heat.strength.fields.any() else None


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
