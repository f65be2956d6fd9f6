"""Links: boundaries that are tied, rigid, held by springs, or moved by a rigid body."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Interval, Unit

from solver.errors import ModelError
from solver.parameters import Infinite, check

Components = Literal["x", "y", "xy", "normal", "tangential"]
Springs = Annotated[float, Interval(gt=0.0), Unit("N/mm3")]
Side = tuple[str, str]
"""Name of a body and of its boundary."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Link:
    """Linear conditions on the displacements of a boundary, the slave.

    Without ``rigid`` and ``master`` all nodes of the slave have the same displacement; with a
    stiffness, springs hold the slave to the ground instead.

    Attributes
    ----------
    slave : body and boundary
    master : body and boundary to which the slave is tied; their nodes need not match
    rigid : the rigid body whose motion the slave follows; with a master, the motion of the slave
        relative to the master, such as the shortening of a bolt. Rotations are small
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
