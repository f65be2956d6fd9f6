"""A model: bodies and contact pairs, checked together."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from solver.errors import ModelError
from solver.kinds import check_kinds
from solver.materials.doubts import doubts
from solver.model.amplitude import Amplitude
from solver.model.body import Body
from solver.model.friction import Coulomb, FrictionLaw
from solver.model.link import Link
from solver.model.rigid import Pushed, RigidBody
from solver.model.singular import SingularPoint


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactPair:
    """Two boundaries that may touch.

    Attributes
    ----------
    slave, master : ``(body name, boundary name)``. Gap, slip, pressure and shear are defined at the
        vertices of the slave: the mean gap around each vertex must not be negative. Choose as slave
        the surface that ends at a corner, else the finer one or the one that yields. They are
        exchanged if the slave is unsuitable (`solver.contact.slave`)
    friction : Coulomb coefficient; zero, or a value that counts as zero (`effective_friction`),
        leaves out the tangential unknowns. Or a law of friction (`FrictionLaw`)
    cohesion : shear that contact carries in addition to friction [MPa]: the shear is at most
        ``friction * pressure + min(cohesion, pressure)``
    shear_limit : ratio of the largest contact shear to the initial shear yield stress of the weaker
        body, at any pressure; inf (default) sets no limit. If heat lowers the yield stress
        (`Temperature`), that of the surfaces at the end of the increment counts. If friction
        permits more shear than the material, the surface layer flows instead of slipping, and its
        strain grows as the mesh is refined
    sliding : which point of the master belongs to a point of the slave, and along which normal.
        ``small``: always the point it faces before loading; consistent with small strains, and
        exactly linear between changes of status. ``finite``: the point it faces in the current
        positions, paired again in every iteration. ``auto`` (default): ``finite`` if either surface
        is curved or bent before loading, else ``small`` until the surfaces have moved too far for
        it (`solver.contact.drift`). Small sliding is wrong if surfaces move along each other by
        more than an element, which the audit calls outside small-strain theory, or curved ones by
        more than a hundredth of the contact's length, of which it warns
    gap : gap added to the distance of the surfaces as meshed [mm]
    interference : overlap at load factor 1, in addition to that of the mesh [mm]: a load, which
        pushes the bodies apart with friction
    amplitude : load factor of the interference; when absent, time is the load factor
    presence : whether the pair is there over time: its surfaces may touch while it is above 0 and
        does not decrease. While it decreases its forces decrease with it, wherever the surfaces
        are; at 0 there is no pair, and bodies pass through each other. When absent, always 1
    """

    slave: tuple[str, str]
    master: tuple[str, str]
    friction: float | FrictionLaw = 0.0
    shear_limit: float = math.inf
    sliding: Literal["auto", "small", "finite"] = "auto"
    cohesion: float = 0.0
    gap: float = 0.0
    interference: float = 0.0
    amplitude: Amplitude | None = None
    presence: Amplitude | None = None

    def __post_init__(self) -> None:
        check_kinds(ContactPair, self)
        if self.presence is not None and (least := float(np.min(self.presence.value))) < 0:
            raise ModelError("presence", least, "must not be negative")
        if not self.shear_limit > 0:
            raise ModelError("shear_limit", self.shear_limit, "must be positive")
        if isinstance(self.friction, FrictionLaw):
            for name, none in (("cohesion", 0.0), ("shear_limit", math.inf)):
                if (value := getattr(self, name)) != none:
                    raise ModelError(name, value, "must not stand beside a law of friction")
        _ = self.law  # checks itself
        if self.sliding not in ("auto", "small", "finite"):
            raise ModelError("sliding", self.sliding, "must be auto, small or finite")
        for name in ("gap", "interference"):
            if not np.isfinite(getattr(self, name)):
                raise ModelError(name, getattr(self, name), "must be finite [mm]")

    @property
    def law(self) -> FrictionLaw:
        """The law of friction."""
        if isinstance(self.friction, FrictionLaw):
            return self.friction
        return Coulomb(friction=self.friction, cohesion=self.cohesion, shear_limit=self.shear_limit)

    def offset(self, time: float) -> float:
        """Return the gap added at a time to the distance of the surfaces as meshed [mm]."""
        factor = time if self.amplitude is None else self.amplitude.at(time)
        return self.gap - factor * self.interference

    def absent(self, time: float) -> bool:
        """Return whether there is no pair at a time."""
        return self.presence is not None and self.presence.at(time) == 0

    def left(self, before: float, time: float) -> float | None:
        """Return the ratio of its forces at a time to those before; None if contact finds them."""
        if self.presence is None:
            return None
        was, now = self.presence.at(before), self.presence.at(time)
        return None if now > 0 and now >= was else now / (was or 1.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Model:
    """Bodies in contact.

    Attributes
    ----------
    bodies : bodies with different names and the same kinematics
    rigid : rigid bodies, with names of their own
    contacts : pairs of boundaries that may touch, of bodies of one thickness
    links : boundaries that are tied, kept rigid, or held by springs
    singular : points around which large strain is not judged: it depends on the mesh
    """

    bodies: tuple[Body, ...]
    contacts: tuple[ContactPair, ...] = ()
    rigid: tuple[RigidBody, ...] = ()
    links: tuple[Link, ...] = ()
    singular: tuple[SingularPoint, ...] = ()

    def __post_init__(self) -> None:
        check_kinds(Model, self)
        names = [body.name for body in self.bodies] + [body.name for body in self.rigid]
        if not self.bodies or len(set(names)) < len(names):
            raise ModelError("bodies", names, "must be at least one, with different names")
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
        for k, link in enumerate(self.links):
            self._check_link(f"links[{k}]", link)
        for body in self.rigid:
            if not body.surfaces and all(link.rigid != body.name for link in self.links):
                allowed = "must be 1 or more, unless a link moves a boundary with the body"
                raise ModelError(f"rigid.{body.name}.surfaces", {}, allowed)

    def _check_link(self, name: str, link: Link) -> None:
        """Refuse bodies that a link cannot join, and surfaces that something else holds too."""
        sides = zip(("slave", "master"), link.sides, strict=False)
        for side, (of, boundary) in sides:
            body = self.body(of, f"{name}.{side}")
            if not isinstance(body, Body):
                allowed = "must be a boundary of a body with a mesh: name a rigid body by rigid"
                raise ModelError(f"{name}.{side}", (of, boundary), allowed)
            if body.axle is not None or body.periodic is not None:
                allowed = "must be of a body without an axle that is not periodic"
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
        """Refuse two thicknesses, a surface paired with itself, and two surfaces paired twice."""
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
