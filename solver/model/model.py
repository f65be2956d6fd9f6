"""A model: bodies and contact pairs, checked together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.errors import ModelError
from solver.materials.doubts import doubts
from solver.mesh.elements import element_type
from solver.model.body import Body
from solver.model.pairs import ContactPair, Link
from solver.model.rigid import Pushed, RigidBody
from solver.model.singular import SingularPoint
from solver.parameters import check


@dataclass(frozen=True, kw_only=True, eq=False)
class Model:
    """Bodies in contact.

    Attributes
    ----------
    bodies : bodies with different names and the same kinematics
    rigid : rigid bodies, with names of their own
    contacts : pairs of boundaries that may touch, on bodies of the same thickness
    links : boundaries that are tied, rigid, held by springs, or moved by a rigid body
    singular : points around which the audit ignores large strain, because it depends on the mesh
    """

    bodies: tuple[Body, ...]
    contacts: tuple[ContactPair, ...] = ()
    rigid: tuple[RigidBody, ...] = ()
    links: tuple[Link, ...] = ()
    singular: tuple[SingularPoint, ...] = ()

    def __post_init__(self) -> None:
        check(self)
        names = [body.name for body in self.bodies] + [body.name for body in self.rigid]
        if not self.bodies or len(set(names)) < len(names):
            raise ModelError("bodies", names, "must be at least one, with different names")
        self._check_solids()
        kinds = {body.kinematics for body in self.bodies}
        if len(kinds) > 1:
            raise ModelError("bodies.kinematics", sorted(kinds), "must be the same for all bodies")
        for body in self.rigid if "axisymmetric" in kinds else ():
            if isinstance(body.x, Pushed) or isinstance(body.rotation, Pushed):
                allowed = "must have x and rotation Moved where bodies are axisymmetric"
                raise ModelError("rigid", body.name, allowed)
        for contact in self.contacts:
            sides = (("slave", contact.slave), ("master", contact.master))
            for side, (name, boundary) in sides:
                self.body(name, side).facets(boundary, side, outer=True)
            if all(isinstance(self.body(name), RigidBody) for _, (name, _) in sides):
                pair = (contact.slave, contact.master)
                raise ModelError("contacts", pair, "must not be two rigid bodies")
            elastic = all(self.body(name, side).material.elastic for side, (name, _) in sides)
            contact.law.check_bodies(elastic=elastic)
        self._check_pairs()
        self._check_large()
        for k, link in enumerate(self.links):
            self._check_link(f"links[{k}]", link)
        for body in self.rigid:
            if not body.surfaces and all(link.rigid != body.name for link in self.links):
                allowed = "must be 1 or more, unless a link moves a boundary with the body"
                raise ModelError(f"rigid.{body.name}.surfaces", {}, allowed)

    @property
    def large(self) -> bool:
        """Whether the strain of a body is large."""
        return any(body.large for body in self.bodies)

    def _check_large(self) -> None:
        """Raise `ModelError` for contact and links that bodies of large strain do not have yet."""
        large = {body.name for body in self.bodies if body.large}
        for k, pair in enumerate(self.contacts):
            if pair.sliding == "small" and large & {pair.slave[0], pair.master[0]}:
                allowed = "must be auto or finite: the strain of a body in this contact is large"
                raise ModelError(f"contacts[{k}].sliding", pair.sliding, allowed)
        for body in self.bodies if self.singular else ():
            kind = element_type(body.element)
            reduced = kind.cells == "quad" and kind.order < kind.full_order
            if body.large and reduced and not body.full_integration:
                allowed = (
                    f"must be quad4 or have full_integration: body {body.name!r} has large strain, "
                    "and next to singular points its elements lose their stability with fewer "
                    "points"
                )
                raise ModelError("element", body.element, allowed)
        for k, link in enumerate(self.links):
            rigid = link.rigid and self.body(link.rigid)
            turns = isinstance(rigid, RigidBody) and rigid.turns and link.master is not None
            if (link.local or turns) and large & {of for of, _ in link.sides}:
                allowed = (
                    "must not move along normals, nor relative to a master with a body that "
                    "rotates: the strain of the body it moves is large. Leave normal or the master "
                    "out"
                )
                raise ModelError(f"links[{k}]", link.rigid or link.components, allowed)

    def _check_solids(self) -> None:
        """Raise `ModelError` for contact, links and rigid bodies in a model of bodies in space."""
        kinds = {body.element for body in self.bodies if body.dim == 3}
        for name in ("rigid", "contacts", "links", "singular") if kinds else ():
            if len(getattr(self, name)):
                allowed = f"must be left out: bodies of {min(kinds)} do not have it yet"
                raise ModelError(name, len(getattr(self, name)), allowed)
        if kinds and any(body.dim == 2 for body in self.bodies):
            every = [body.element for body in self.bodies]
            raise ModelError("bodies.element", every, "must be all in the plane or all in space")

    def _check_link(self, name: str, link: Link) -> None:
        """Raise `ModelError` for bodies and surfaces that a link cannot join."""
        sides = zip(("slave", "master"), link.sides, strict=False)
        for side, (of, boundary) in sides:
            body = self.body(of, f"{name}.{side}")
            if not isinstance(body, Body):
                allowed = "must be a boundary of a body with a mesh: name a rigid body by rigid"
                raise ModelError(f"{name}.{side}", (of, boundary), allowed)
            if body.axle is not None:
                allowed = "must be of a body without an axle"
                raise ModelError(f"{name}.{side}", (of, boundary), allowed)
            body.facets(boundary, f"{name}.{side}", outer=True)
            for j, pair in enumerate(self.contacts):
                if any(self._overlap((of, boundary), each) for each in (pair.slave, pair.master)):
                    allowed = f"shares facets with contacts[{j}]: link or contact, not both"
                    raise ModelError(f"{name}.{side}", (of, boundary), allowed)
        if link.master is not None and self._overlap(*link.sides):
            allowed = f"shares facets with slave {link.slave}: must be another surface"
            raise ModelError(f"{name}.master", link.master, allowed)
        if link.rigid is not None and not isinstance(
            self.body(link.rigid, f"{name}.rigid"), RigidBody
        ):
            raise ModelError(f"{name}.rigid", link.rigid, "must be a rigid body")

    def _check_pairs(self) -> None:
        """Raise `ModelError` for unequal thickness, self-contact, and a pair given twice."""
        pairs = [(contact.slave, contact.master) for contact in self.contacts]
        plane = self.bodies[0].kinematics != "axisymmetric"
        for i, (slave, master) in enumerate(pairs):
            thickness = {name: self.body(name).thickness for name, _ in (slave, master)}
            if plane and len(set(thickness.values())) > 1:
                allowed = "must join bodies of one thickness [mm]: the same pressure acts on both"
                raise ModelError(f"contacts[{i}]", thickness, allowed)
            if self._overlap(slave, master):
                allowed = f"shares facets with slave {slave}: must be another surface"
                raise ModelError(f"contacts[{i}].master", master, allowed)
            for j, (one, other) in enumerate(pairs[:i]):
                straight = self._overlap(slave, one) and self._overlap(master, other)
                if straight or (self._overlap(slave, other) and self._overlap(master, one)):
                    allowed = f"pairs surfaces that contacts[{j}] pairs: give each pair once"
                    raise ModelError(f"contacts[{i}]", (slave, master), allowed)

    def _overlap(self, one: tuple[str, str], other: tuple[str, str]) -> bool:
        """Whether two surfaces, given by body and boundary, share facets."""
        if one[0] != other[0]:
            return False
        body = self.body(one[0])
        return len(np.intersect1d(body.facets(one[1]), body.facets(other[1]))) > 0

    @property
    def doubts(self) -> tuple[str, ...]:
        """Warnings about material parameters that look like mistakes, such as a modulus in GPa."""
        return doubts({body.name: body.material for body in self.bodies})

    def body(self, name: str, field: str = "body") -> Body | RigidBody:
        """Return the body called ``name``."""
        bodies: tuple[Body | RigidBody, ...] = (*self.bodies, *self.rigid)
        for body in bodies:
            if body.name == name:
                return body
        allowed = "must be one of " + ", ".join(b.name for b in bodies)
        raise ModelError(field, name, allowed)
