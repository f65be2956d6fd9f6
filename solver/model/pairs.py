"""What joins two boundaries: contact pairs, which may touch, and links."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np
from annotated_types import Interval, Unit

from solver.errors import ModelError
from solver.model.amplitude import Amplitude
from solver.model.friction import Coulomb, FrictionLaw
from solver.parameters import Coordinate, Friction, Infinite, check


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactPair:
    """Two boundaries that may touch.

    Attributes
    ----------
    slave, master : ``(body name, boundary name)``. Gap, slip, pressure and shear are defined at the
        vertices of the slave: the mean gap around each vertex must not be negative. Choose as slave
        the surface that ends at a corner, else the finer one or the one that yields. The two are
        exchanged if the slave is unsuitable (`solver.contact.interface`)
    friction : Coulomb coefficient; zero, or a value that counts as zero (`effective_friction`),
        leaves out the tangential unknowns. Or a law of friction, as `Coulomb` with cohesion and a
        limit of shear
    law : the law of friction; that of a coefficient is Coulomb's
    sliding : which point of the master belongs to a point of the slave, and along which normal.
        ``small``: the point that it faces before loading; consistent with small strains, and
        exactly linear between changes of status. ``finite``: the point that it faces in the current
        positions, found in every iteration. ``auto`` (default): ``finite`` if either surface is
        curved or bent before loading, else ``small`` until the surfaces have moved too far for it
        (`solver.contact.drift`). Small sliding is wrong if surfaces move along each other by more
        than an element (the audit reports this as outside small-strain theory), or curved surfaces
        by more than a hundredth of the contact's length (the audit warns)
    gap : gap added to the distance of the surfaces in the mesh [mm]
    interference : overlap at load factor 1, in addition to that of the mesh [mm]: a load, which
        pushes the bodies apart with friction
    amplitude : load factor of the interference over time; by default the time itself
    presence : presence of the pair over time, always 1 by default. The surfaces may touch while it
        is positive and does not decrease. While it decreases, the forces decrease in proportion,
        whatever the gap; at 0 there is no pair, and the bodies pass through each other
    """

    slave: tuple[str, str]
    master: tuple[str, str]
    friction: Friction | FrictionLaw = 0.0
    law: FrictionLaw = field(init=False, repr=False, compare=False)
    sliding: Literal["auto", "small", "finite"] = "auto"
    gap: Coordinate = 0.0
    interference: Coordinate = 0.0
    amplitude: Amplitude | None = None
    presence: Amplitude | None = None

    def __post_init__(self) -> None:
        check(self)
        own = self.friction
        law = own if isinstance(own, FrictionLaw) else Coulomb(friction=own)
        object.__setattr__(self, "law", law)
        if self.presence is not None and (least := float(np.min(self.presence.value))) < 0:
            raise ModelError("presence", least, "must not be negative")

    def offset(self, time: float) -> float:
        """Return the gap added at a time to the distance of the surfaces in the mesh [mm]."""
        factor = time if self.amplitude is None else self.amplitude.at(time)
        return self.gap - factor * self.interference

    def absent(self, time: float) -> bool:
        """Whether there is no pair at a time."""
        return self.presence is not None and self.presence.at(time) == 0

    def left(self, before: float, time: float) -> float | None:
        """Return its forces at ``time`` over those ``before`` while it is being removed, else None.

        Otherwise the contact conditions determine the forces.
        """
        if self.presence is None:
            return None
        was, now = self.presence.at(before), self.presence.at(time)
        return None if now > 0 and now >= was else now / (was or 1.0)


Components = Literal["x", "y", "xy", "normal", "tangential"]
Springs = Annotated[float, Interval(gt=0.0), Unit("N/mm3")]
Side = tuple[str, str]
"""Name of a body and of its boundary."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Link:
    """Conditions on the displacements of a boundary, the slave.

    Without ``rigid`` and ``master`` all nodes of the slave have the same displacement; with a
    stiffness, springs hold the slave to the ground instead.

    Attributes
    ----------
    slave : body and boundary
    master : body and boundary to which the slave is tied; their nodes need not match
    rigid : the rigid body whose motion the slave follows; with a master, the motion of the slave
        relative to the master, such as the shortening of a bolt. Rotations are small. If the strain
        of the slave is large they may be large, and components and springs turn with the body
    components : components of the displacement in the conditions: along the axes, or along the
        normal or the tangent of the slave at each node. At a corner the normal is the mean of both
        sides
    stiffness : stiffness of springs between the two, force per area and displacement [N/mm3]; inf
        is rigid
    distributed : whether only the mean motion of the slave equals that of ``rigid``: force and
        moment act on the slave by a linear traction, and the slave may deform. In axisymmetric
        bodies it is the mean motion along y, and the traction is constant
    """

    slave: Side
    master: Side | None = None
    rigid: str | None = None
    components: Components = "xy"
    stiffness: Springs | Infinite = math.inf
    distributed: bool = False

    def __post_init__(self) -> None:
        check(self)
        if self.local and (self.master or self.distributed):
            allowed = "must be x, y or xy with a master, and where it is distributed"
            raise ModelError("components", self.components, allowed)
        if self.distributed and (
            self.rigid is None or self.master or math.isfinite(self.stiffness)
        ):
            allowed = "needs a rigid body, and neither a master nor springs"
            raise ModelError("distributed", self.distributed, allowed)

    @property
    def axes(self) -> tuple[int, ...]:
        """Its components along axes: 0 (x), 1 (y); empty for a `local` link."""
        return () if self.local else tuple("xy".index(axis) for axis in self.components)

    @property
    def local(self) -> bool:
        """Whether its component is along the normal or the tangent of the slave."""
        return self.components in ("normal", "tangential")

    @property
    def grounded(self) -> bool:
        """Whether springs hold the slave to the ground."""
        return self.rigid is None and self.master is None and math.isfinite(self.stiffness)

    @property
    def sides(self) -> tuple[Side, ...]:
        """The slave, and the master if there is one."""
        return (self.slave,) if self.master is None else (self.slave, self.master)
