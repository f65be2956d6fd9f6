"""Requested numbers: extreme value, integral or extent of a field, or a value of a history."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from solver.errors import ModelError
from solver.mesh.rounding import in_box
from solver.parameters import Coordinate
from solver.results.acting import ContactResult
from solver.results.body_fields import BODY_FIELDS, BodyField
from solver.results.fields import Solved, SystemFields
from solver.results.quantities import Quantity
from solver.results.run import Values
from solver.results.view import Places
from solver.tensors import AXES, component, known_components
from solver.typing import Array

Span = tuple[Coordinate, Coordinate]
Take = Literal["maximum", "minimum", "integral", "extent"]
_OF_PAIR = {"pressure": "MPa", "shear": "MPa", "gap": "mm", "slip": "mm"}
_COURSES = {
    "motion.x": ("motion_x", "mm"), "motion.y": ("motion_y", "mm"),
    "motion.rotation": ("motion_rotation", "rad"),
    "reaction.x": ("reaction_x", "N"), "reaction.y": ("reaction_y", "N"),
    "normal_force": ("contact_normal_force", "N"),
    "tangential_force": ("contact_tangential_force", "N"),
}  # fmt: skip
"""Variables over increments, with units, by the names in requests."""
_UNITS = {name: field.units for name, field in BODY_FIELDS.items()} | _OF_PAIR
EXTREME = ("maximum", "minimum")
_SAME = 1e-9
"""Relative difference from an extreme up to which a value shares it: of its places the first is
named, not one that rounding chooses."""
FORCES = ("pressure", "shear")
"""Fields of a contact whose integral is a force, over the area instead of along the surface."""
OF_CONTACT = tuple(_OF_PAIR)
"""Fields of a contact that numbers may be requested of."""
OF_PART = tuple(name for name in _COURSES if "." in name)
"""Values of a part, a body or rigid body, at the end of a stage."""
FORCES_OF_CONTACT = tuple(name for name in _COURSES if "." not in name)
"""Values of a whole contact at the end of a stage."""


def of_body(axes: int) -> tuple[str, ...]:
    """Return the fields that numbers may be requested of, in a body with ``axes`` axes."""
    return tuple(
        name
        for own, field in BODY_FIELDS.items()
        for name in ([f"{field.stem}.{part}" for part in _parts(field, axes)] or [own])
    )


def _parts(field: BodyField, axes: int) -> tuple[str, ...]:
    """Return the components and invariants of a field."""
    return known_components(2 * axes) if field.over == "component" else field.parts(axes)


@dataclass(frozen=True, slots=True, kw_only=True)
class RequestedNumber:
    """A number requested of every run; a maximum or minimum also has a position.

    Attributes
    ----------
    name : name of the variable; that of the position has a suffix ``_x``, ``_y`` (or ``_z``)
    of : field, one of `of_body` or `OF_CONTACT`; or one of `OF_PART` or `FORCES_OF_CONTACT`, a
        value at the end of the stage. In a body ``mises`` and ``plastic_strain`` are those at
        integration points, other fields those at nodes
    take : ``maximum`` or ``minimum``; ``integral`` along a line or contact, for ``pressure`` and
        ``shear`` over the area, a force [N]; or ``extent``, the length along which the value is
        positive, for ``pressure`` the length of contact. Ignored for values at the end of a stage
    stage : name of the state
    minus : name of a state whose values are subtracted; empty for none. Not for fields of a contact
    body, line, contact, part : name of the place; exactly one of the four
    x, y, z : ranges of a box in the body that limits the number [mm]
    description : meaning in words
    """

    name: str
    of: str
    take: Take = "maximum"
    stage: str
    minus: str = ""
    body: str | None = None
    line: str | None = None
    contact: str | None = None
    part: str | None = None
    x: Span | None = None
    y: Span | None = None
    z: Span | None = None
    description: str = ""

    @property
    def course(self) -> str:
        """The variable over increments that it is a value of; empty for a field."""
        return _COURSES[self.of][0] if self.of in _COURSES else ""

    @property
    def is_resultant(self) -> bool:
        """Whether it is the resultant of a field of a contact."""
        return self.take == "integral" and self.of in FORCES

    @property
    def is_force(self) -> bool:
        """Whether it is the force of a contact, of supports or of motions."""
        return self.is_resultant or _COURSES.get(self.of, ("", ""))[1] == "N"

    @property
    def words(self) -> str:
        """Its meaning in words, with place and stage."""
        places = {"body": self.body, "line": self.line, "contact": self.contact, "part": self.part}
        where = next(f"{kind} {name}" for kind, name in places.items() if name is not None)
        what = self.of.replace(".", " ").replace("_", " ")
        when = f"{self.stage} minus {self.minus}" if self.minus else self.stage
        if self.course:
            return f"{what} of {where.removeprefix('part ')}, end of stage {when}"
        return f"{self.take} of {what} of {where}, stage {when}"

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """The number and, for an extreme value, its position along all three axes."""
        if self.course:
            units = _COURSES[self.of][1]
            words = self.description or self.words
            return (Quantity(name=self.name, long_name=words, units=units),)
        units = _UNITS[self.of.partition(".")[0]]
        along = "N" if self.is_resultant else f"{units} mm".removeprefix("1 ")
        units = {"extent": "mm", "integral": along}.get(self.take, units)
        number = Quantity(name=self.name, long_name=self.description or self.words, units=units)
        if self.take not in EXTREME:
            return (number,)
        return number, *(
            Quantity(
                name=f"{self.name}_{axis}", long_name=f"{axis} where {self.name} is", units="mm"
            )
            for axis in AXES
        )

    def values(
        self,
        fields: SystemFields,
        at: Solved,
        lines: Mapping[str, Places],
        contacts: Mapping[str, ContactResult],
        before: Solved | None = None,
    ) -> Values:
        """Return the number of a run, with its position if it has one; NaN if the field is unknown.

        Parameters
        ----------
        at : state at its stage
        lines : lines by name
        contacts : results of the contact pairs in this state, by name
        before : state whose values are subtracted, if any

        Raises
        ------
        ModelError
            if the body has no such component or no such axis
        """
        if self.contact is not None and (self.of, self.take) == ("pressure", "extent"):
            found: tuple[float, ...] = (contacts[self.contact].length,)
        else:
            values, X = self._field(fields, at, lines, contacts)
            if before is not None:
                values = values - self._field(fields, before, lines, contacts)[0]
            if self.is_resultant:
                found = (float(values @ contacts[str(self.contact)].area),)
            else:
                found = self._found(values, X)
        return dict(zip(self.quantities, found, strict=False))

    def at_increments(self, courses: Values, at: float, before: float | None = None) -> Values:
        """Return the number from a variable over increments, at the end of its stage.

        Parameters
        ----------
        courses : variables over increments
        at : time at the end of its stage
        before : time at the end of the stage whose value is subtracted, if any
        """
        known = {quantity.name: values for quantity, values in courses.items()}
        names, name = ("part", self.part) if self.contact is None else ("contact", self.contact)
        row = known[self.course][list(known[names]).index(name)]

        def value(time: float) -> float:
            ends = np.flatnonzero(np.isclose(known["increment_time"], time, rtol=0.0, atol=1e-9))
            return float(row[ends[-1]]) if ends.size else np.nan

        found = value(at) if before is None else value(at) - value(before)
        return {self.quantities[0]: found}

    def _found(self, values: Array, X: Array) -> tuple[float, ...]:
        """Return the number, with its position if any, from values (n,) at X (n_axes, n)."""
        known = np.isfinite(values)
        if not known.any():
            return (np.nan,) * (1 + len(X) if self.take in EXTREME else 1)
        if self.take in EXTREME:
            sign = 1.0 if self.take == "maximum" else -1.0
            heights = np.where(known, sign * values, -np.inf)
            most = heights.max()
            k = int((heights >= most - _SAME * abs(most)).argmax())
            return float(sign * most), *X[:, k].tolist()
        s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(X), axis=0))])
        values = np.where(known, values, 0.0)
        if self.take == "integral":
            return (float(np.trapezoid(values, s)),)
        return (_positive_length(values, s),)

    def _field(
        self,
        fields: SystemFields,
        at: Solved,
        lines: Mapping[str, Places],
        contacts: Mapping[str, ContactResult],
    ) -> tuple[Array, Array]:
        """Return the values (n,) of the field, NaN outside the box, and positions (n_axes, n)."""
        kind, _, part = self.of.partition(".")
        if self.contact is not None:
            self._check(OF_CONTACT)
            result = contacts[self.contact]
            return getattr(result, kind), result.X
        body = str(self.body)
        X = fields.system.full(body).X if self.line is None else lines[self.line].X
        self._check(of_body(len(X)))
        field = kind
        if part:
            field = next(
                own for own, each in BODY_FIELDS.items() if each.over and each.stem == kind
            )
        if self.line is not None:
            (there,) = fields.at_places(lines[self.line], [at])
            found = getattr(there, field)
        elif field in ("mises", "plastic_strain"):  # recovered nodal values may violate the law
            X, mises, strain = fields.at_points(at, body)
            found = mises if kind == "mises" else strain
        else:
            found = getattr(fields.at_nodes(at, body), field)
        if part:
            of_axis = BODY_FIELDS[field].over == "axis"
            values = found[AXES.index(part)] if of_axis else component(found, part)
        else:
            values = found
        spans = (self.x, self.y, self.z)
        for k, span in enumerate(spans[len(X) :], start=len(X)):
            if span is not None:
                allowed = f"must be left out: places of this body have {', '.join(AXES[:k])}"
                raise ModelError(f"{self.name}.{AXES[k]}", span, allowed)
        inside = in_box(X, spans, float(np.ptp(X, axis=1).max()))
        return np.where(inside, values, np.nan), X

    def _check(self, known: tuple[str, ...]) -> None:
        if self.of not in known:
            raise ModelError(f"{self.name}.of", self.of, f"must be one of {', '.join(known)}")


def _positive_length(values: Array, s: Array) -> float:
    """Return the length along which values, linear between points, are positive."""
    low, high = np.minimum(values[:-1], values[1:]), np.maximum(values[:-1], values[1:])
    rise = np.where(high > low, high - low, 1.0)
    share = np.where(low > 0, 1.0, np.clip(high, 0.0, None) / rise)
    return float(share @ np.diff(s))
