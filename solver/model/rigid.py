"""Rigid bodies: an indenter or a plate given by its surfaces, or a point that moves boundaries."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from solver.errors import ModelError
from solver.materials import Elasticity, Law, PlasticState, Response
from solver.model.loads import Load
from solver.parameters import Coordinate, Infinite, Thickness, check
from solver.typing import Array, Ints

_TURN = 0.1
"""Largest angle of an edge of an arc [rad]: the error of its curvature is then 0.1 %."""


class Rigid(Law):
    """A law without strain: infinitely stiff, it never yields."""

    @property
    def elasticity(self) -> Elasticity:
        """Elastic constants with an infinite modulus."""
        return Elasticity(youngs_modulus=np.inf, poisson_ratio=0.0)

    def flow_stress(self, state: PlasticState) -> Array:
        """Return inf: it never yields."""
        return np.full(state.accumulated.shape, np.inf)

    def respond(self, strain: Array, state: PlasticState) -> Response:
        """Return the empty response of zero points; a rigid body has no others."""
        if strain.shape[1]:
            raise ValueError("a rigid body has no points")
        count = len(strain)
        empty = np.zeros(0, dtype=bool)
        return Response(np.zeros((count, 0)), np.zeros((count, count, 0)), state, empty)


_RIGID = Rigid()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Moved(Load):
    """A prescribed motion at load factor one: a displacement [mm] or a rotation [rad]."""

    value: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pushed(Load):
    """A free motion with a force [N] or a moment [N mm] on it, given at load factor one.

    Attributes
    ----------
    locked : time of locking, as of a tightened bolt: the motion is constant in all increments that
        begin at or after it
    """

    value: float = 0.0
    locked: float | Infinite = np.inf


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RigidSurface:
    """A surface of a rigid body: a chain of points with the body on its left.

    Attributes
    ----------
    points : (2, n) positions [mm]
    quadratic : whether every second point is the middle of a curved edge
    goes_on : whether the body continues smoothly beyond the start and the end; contact must not
        reach such an end. It is ignored on the axis of axisymmetric bodies
    """

    points: Array
    quadratic: bool = False
    goes_on: tuple[bool, bool] = (False, False)

    def check(self, name: str) -> None:
        """Raise `ModelError` if the points do not make a chain of edges."""
        points = np.asarray(self.points, dtype=float)
        if points.ndim != 2 or points.shape[0] != 2 or points.shape[1] < 2 + self.quadratic:
            raise ModelError(f"surfaces.{name}", points.shape, "must be points (2, n), two or more")
        if self.quadratic and points.shape[1] % 2 == 0:
            allowed = "must be an odd number of points where edges are quadratic"
            raise ModelError(f"surfaces.{name}", points.shape[1], allowed)
        if not np.isfinite(points).all():
            raise ModelError(f"surfaces.{name}", "nan or inf", "must be finite [mm]")
        if not np.linalg.norm(np.diff(points), axis=0).all():
            raise ModelError(f"surfaces.{name}", "a point twice", "must be distinct points [mm]")


def line(start: tuple[float, float], end: tuple[float, float], edges: int = 1) -> RigidSurface:
    """Return a straight surface of equal edges."""
    return RigidSurface(points=np.linspace(start, end, edges + 1).T)


def arc(
    centre: tuple[float, float],
    radius: float,
    angles: tuple[float, float],
    edges: int,
    goes_on: tuple[bool, bool] = (True, True),
) -> RigidSurface:
    """Return an arc from one angle to another [rad], by default a part of a larger surface.

    If the angles increase, the body is inside the circle. There are more than ``edges`` edges if
    each would span more than 0.1 rad.
    """
    least = int(np.ceil(abs(angles[1] - angles[0]) / _TURN))
    angle = np.linspace(*angles, 2 * max(edges, least) + 1)
    points = np.array(centre)[:, None] + radius * np.stack([np.cos(angle), np.sin(angle)])
    return RigidSurface(points=points, quadratic=True, goes_on=goes_on)


@dataclass(frozen=True, kw_only=True, eq=False)
class RigidBody:
    """A body that does not deform, given by its surfaces and its centre.

    Attributes
    ----------
    name : unique in its model
    surfaces : contact surfaces by name; empty if it only moves boundaries by links
    centre : point (x, y) to which displacements and moments refer [mm]
    x, y, rotation : the three motions, each prescribed (`Moved`; zero by default) or free with a
        force or moment on it (`Pushed`); rotation is positive counter-clockwise
    thickness : thickness of plane bodies [mm]
    """

    name: str
    surfaces: Mapping[str, RigidSurface] = field(default_factory=dict)
    centre: tuple[Coordinate, Coordinate] = (0.0, 0.0)
    x: Moved | Pushed = field(default_factory=Moved)
    y: Moved | Pushed = field(default_factory=Moved)
    rotation: Moved | Pushed = field(default_factory=Moved)
    thickness: Thickness = 1.0

    def __post_init__(self) -> None:
        check(self)
        for name, curve in self.surfaces.items():
            curve.check(name)

    @property
    def every_load(self) -> tuple[Moved | Pushed, ...]:
        """Its three motions, x, y and rotation."""
        return self.x, self.y, self.rotation

    @property
    def turns(self) -> bool:
        """Whether it may rotate."""
        return isinstance(self.rotation, Pushed) or self.rotation.value != 0

    @property
    def material(self) -> Law:
        """The law of a rigid material."""
        return _RIGID

    law = material

    def facets(self, boundary: str, field: str = "boundary", outer: bool = False) -> Ints:
        """Return the number of a surface (1,)."""
        if boundary not in self.surfaces:
            known = ", ".join(self.surfaces) or "it has none"
            allowed = f"must name a surface of the rigid body: {known}"
            raise ModelError(field, boundary, allowed)
        return np.array([list(self.surfaces).index(boundary)])

    @property
    def box(self) -> Array:
        """Sides (2,) of the bounding box: infinite, because only surfaces of the body are known."""
        return np.full(2, np.inf)
