"""Compare stored results at named places with recomputed values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from solver.mesh.rounding import in_box
from solver.model.rigid import Moved, RigidBody
from solver.results.audit.compared import AREA, LEAST_STRAIN, LIMIT, MEASURED, Compared, some
from solver.results.audit.links import linked
from solver.results.audit.plain import load_factor
from solver.results.audit.sources import OfStates, between
from solver.results.audit.tractions import COVERED, Tractions
from solver.results.audit.values import Located, at_nodes
from solver.results.body_fields import BODY_FIELDS, STORED
from solver.results.named_places import NamedPlaces
from solver.results.record import Record
from solver.results.requested import RequestedNumber
from solver.results.run import FinishedRun
from solver.tensors import AXES, components
from solver.typing import Array

_LEAST_LENGTH = 1e-9
"""Least scale of displacement, gap and slip, over the size of the bodies."""
_PARTS = {name: k for names in (components(6), AXES) for k, name in enumerate(names)}
_ROUNDED = 1e-9
"""Largest difference of two equal times of the program."""


class _Sought(NamedTuple):
    """Values (n,) of which a number is taken, and their positions (n_axes, n).

    Attributes
    ----------
    partly : values at the vertices of a slave, with those whose hats face the master in part:
        their means, and whether they count, depend on the projection; the second are those that
        count for sure. Empty if there are none
    share : see `Compared.add`
    least : least scale of the values; of surfaces that move as one
    """

    values: Array
    X: Array
    partly: Sequence[Array]
    share: float = 1.0
    least: float = 0.0


class NamedPlacesCheck:
    """Comparison of lines, points, contact surfaces, forces and motions over time, and numbers.

    Parameters
    ----------
    stress_scale : scale by which differences of stress are divided [MPa]
    """

    def __init__(
        self,
        run: FinishedRun,
        record: Record,
        places: NamedPlaces,
        source: OfStates,
        out: Compared,
        stress_scale: float,
    ) -> None:
        self._run, self._record, self._places, self._source = run, record, places, source
        self._out = out
        sizes = [np.ptp(run.system.full(name).X, axis=1).max() for name in run.system.names]
        length = _LEAST_LENGTH * float(max(sizes))
        self._least = {"stress": stress_scale, "mises": stress_scale,
                       "plastic_strain": LEAST_STRAIN, "plastic_tensor": LEAST_STRAIN,
                       "strain": LEAST_STRAIN, "displacement": length,
                       "pressure": LEAST_STRAIN * stress_scale,
                       "shear": LEAST_STRAIN * stress_scale,
                       "pressure_deformed": LEAST_STRAIN * stress_scale,
                       "gap": length, "slip": length}  # fmt: skip

    def compare(self) -> None:
        """Compare all declared results."""
        self._lines()
        self._points()
        self._pairs()
        self._increments()
        for number in self._places.numbers:
            self._number(number)

    def _field(self, name: str) -> Array:
        return np.asarray(self._record.fields[name][1])

    def _scale(self, kind: str, values: Array) -> float:
        return max(float(np.max(np.abs(np.nan_to_num(values)), initial=0.0)), self._least[kind])

    # -- lines and points ------------------------------------------------------------------------

    def _lines(self) -> None:
        for k, line in enumerate(self._places.lines.values()):
            X = np.stack([self._field(f"line_{a}")[k] for a in AXES[: len(line.X)]])
            self._out.add("line_x", X, line.X, float(np.abs(line.X).max()))
            s = _lengths(line.X)
            self._out.add("line_s", self._field("line_s")[k], s, s[-1])
            stored = {name: self._field(f"line_{name}")[k] for name in STORED}
            at = some(X.shape[1], *stored.values())
            stored = {name: values[..., at] for name, values in stored.items()}
            self._fields("line", line.body, line.X[:, at], stored)

    def _points(self) -> None:
        for k, point in enumerate(self._places.points.values()):
            X = np.array([self._field(f"point_{a}")[k] for a in AXES[: len(point.X)]])
            self._out.add("point_x", X, point.X[:, 0], float(np.abs(point.X).max()))
            stored = {name: self._field(f"point_{name}")[k][..., None] for name in STORED}
            places = self._fields("point", point.body, point.X, stored)
            for j, stage in enumerate(self._run.view.stages):
                moved = self._source.fields(point.body, stage).displacement
                own, scale = places.of(moved)[:, 0], self._scale("displacement", moved)
                for axis, value in zip(AXES, own, strict=False):
                    name = f"point_displacement_{axis}"
                    self._out.add(name, self._field(name)[k, j], value, scale)

    def _fields(self, kind: str, body: str, X: Array, stored: Mapping[str, Array]) -> Located:
        """Compare fields (stage, ..., n) at places (2, n) of a body."""
        places = Located(self._source.plain(body), X)
        for k, stage in enumerate(self._run.view.stages):
            fields = self._source.fields(body, stage)
            for name, recorded in stored.items():
                nodal = at_nodes(fields, name)
                own = places.of(nodal)
                own = own if BODY_FIELDS[name].over else np.maximum(own, 0.0)
                self._out.add(f"{kind}_{name}", recorded[k], own, self._scale(name, nodal))
                self._out.absent(f"{kind}_{name}", recorded[k], places.outside)
        return places

    # -- contact and forces ------------------------------------------------------------------

    def _share(self, found: Tractions, kind: str) -> float:
        limit = MEASURED if kind in ("gap", "slip") else AREA
        return LIMIT / limit if found.measured else 1.0

    def _pairs(self) -> None:
        for k, _ in enumerate(self._places.contacts if self._places.samples else ()):
            for j, stage in enumerate(self._run.view.stages):
                found = self._source.tractions(k, stage)
                s = np.asarray(self._record.coordinates["fraction"]) * found.s[-1]
                self._out.add("contact_s", self._field("contact_s")[k], s, s[-1])
                for axis, at in zip("xy", found.X, strict=True):
                    name, own = f"contact_{axis}", between(s, found.s, at)
                    self._out.add(name, self._field(name)[k], own, float(np.abs(found.X).max()))
                for name in ("pressure", "shear", "pressure_deformed", "gap", "slip"):
                    values = _on_slave(found, name)
                    recorded = self._field(f"contact_{name}")[k, j]
                    scale = self._scale(name, values)
                    if name in ("gap", "slip"):  # after unloading only rounding may be left
                        scale = max(found.way, self._least[name])
                    self._out.add(f"contact_{name}", recorded, between(s, found.s, values), scale,
                                  self._share(found, name))  # fmt: skip

    def _increments(self) -> None:
        """Compare forces and motions at the ends of stages."""
        times = self._field("increment_time")
        for stage in self._run.view.stages:
            state = self._run.outcome.points[stage].state
            near = np.flatnonzero(np.abs(times - state.time) < _ROUNDED)
            if not len(near):
                continue
            contact = {name: np.zeros(2) for name in self._source.system.all_names}
            finite = False
            for k, pair in enumerate(self._source.system.model.contacts):
                found = self._source.tractions(k, stage)
                finite |= found.measured
                contact[pair.slave[0]] += found.touching.on_slave.sum(axis=0)
                contact[pair.master[0]] += found.touching.on_master.sum(axis=0)
                for name, sign in (("normal", 1.0), ("tangential", -1.0)):
                    own = sign * getattr(state.contacts[k], name).sum()
                    recorded = self._field(f"contact_{name}_force")[k, near[-1]]
                    self._out.add(f"contact_{name}_force", recorded, own, state.force_scale)
            for j, name in enumerate(self._source.system.all_names):
                contact[name] += linked(self._source.system, state, name)
                body = self._source.system.model.body(name)
                self._part(body, j, int(near[-1]), contact[name], state, measured=finite)

    def _part(
        self, body: Any, j: int, increment: int, contact: Array, state: Any, *, measured: bool
    ) -> None:
        """Compare the reaction and the motion of a body or rigid body."""
        own = -contact
        if isinstance(body, RigidBody):
            u = state.u[self._source.system.part(body.name)]
            for name, motion, moved in zip(
                ("motion_x", "motion_y"), body.every_load, u, strict=False
            ):
                held = isinstance(motion, Moved)
                value = load_factor(motion.amplitude, state.time) * motion.value if held else moved
                self._out.add(name, self._field(name)[j, increment], value,
                              max(abs(value), self._least["gap"]))  # fmt: skip
        else:
            own = own - self._source.plain(body.name).applied(state.time)[0]
            if body.kinematics == "axisymmetric":
                own[0] = np.nan  # radial forces balance around the axis
        share = LIMIT / MEASURED if measured else 1.0
        for name, value in zip(("reaction_x", "reaction_y"), own, strict=True):
            recorded = self._field(name)[j, increment]
            if np.isfinite(recorded):
                self._out.add(name, recorded, value, state.force_scale, share)

    # -- numbers -----------------------------------------------------------------------------

    def _number(self, number: RequestedNumber) -> None:
        """Compare an extreme value and its place, an integral or an extent."""
        if number.course:
            self._value(number)
            return
        kind, _, part = number.of.partition(".")
        if number.contact is not None:
            sought = self._sought(number, kind)
            if sought is None:
                return
        else:
            values, X = self._values(number, number.stage, kind, part)
            if number.minus:
                values = values - self._values(number, number.minus, kind, part)[0]
            sought = _Sought(values, X, ())
        if not np.isfinite(sought.values).any():
            return
        scale = max(sought.least, self._scale(kind, sought.values))
        recorded = self._record.scalars[number.name]
        if number.take in ("maximum", "minimum"):
            self._extreme(number, sought, recorded, scale)
        else:
            self._whole(number, sought, recorded, scale, self._least[kind])

    def _sought(self, number: RequestedNumber, kind: str) -> _Sought | None:
        """Return the values of a contact; None if the number is compared, or cannot be."""
        found = self._source.tractions(
            self._places.contacts.index(str(number.contact)), number.stage
        )
        recorded, share = self._record.scalars[number.name], self._share(found, kind)
        if number.is_resultant:
            level = self._run.outcome.points[number.stage].state.force_scale
            self._out.add(number.name, recorded, found.force(kind), level)
            return None
        values = _on_slave(found, kind)
        if kind in ("gap", "slip"):
            partly = [_of_gaps(found, kind, least) for least in (0.0, 2 * COVERED)]
            return _Sought(values, found.X, () if found.whole.all() else partly, share, found.way)
        if np.isnan(values[found.closed]).any():
            return None
        if (kind, number.take) == ("pressure", "extent"):
            share = LIMIT / MEASURED if found.measured else 1.0
            self._out.add(number.name, recorded, found.length, found.s[-1], share)
            return None
        values = np.where(np.isnan(values) & ~found.closed, 0.0, values)
        return _Sought(values, found.X, (), share)

    def _extreme(
        self, number: RequestedNumber, sought: _Sought, recorded: float, scale: float
    ) -> None:
        """Compare a maximum or minimum, and the value at its place."""
        values, X, partly, share, _ = sought
        name = f"{number.name}_x"
        place = [self._record.scalars[f"{number.name}_{axis}"] for axis in AXES[: len(X)]]
        off = np.hypot.reduce(X - np.array(place)[:, None])
        self._out.add(name, off.min(), 0.0, max(_lengths(X)[-1], self._least["gap"]))
        at = off <= off.min() * (1 + 1e-9) + 1e-12 * np.abs(X).max()
        sign = 1.0 if number.take == "maximum" else -1.0
        own = float(np.nanmax(sign * values))
        if len(partly) and np.isnan(values[at]).all():  # it may lie beyond those that are known
            own = max(own, sign * recorded)
            values, share = np.where(at, partly[0], values), LIMIT / MEASURED
        near = np.abs(values[at & np.isfinite(values)] - sign * own).min(initial=np.inf)
        self._out.add(number.name, recorded, sign * own, scale, share)
        self._out.add(name, near, 0.0, scale, share)

    def _whole(
        self, number: RequestedNumber, sought: _Sought, recorded: float, scale: float, least: float
    ) -> None:
        """Compare an integral or an extent."""
        s, share = _lengths(sought.X), LIMIT / MEASURED if len(sought.partly) else sought.share
        each = [np.nan_to_num(one) for one in sought.partly or [sought.values]]
        if number.take == "integral":
            found = [float((one[1:] + one[:-1]) @ np.diff(s) / 2) for one in each]
            size = abs(each[0])
            level = float((size[1:] + size[:-1]) @ np.diff(s) / 2)
            level = max(level, max(sought.least, least) * s[-1])
        else:  # where a value touches zero, rounding decides how far it is above
            off, level = scale * LIMIT / share, s[-1]
            found = [_above_zero(one + shift, s) for one in each for shift in (-off, off)]
            share = 1.0
        own = np.clip(recorded, min(found), max(found))
        self._out.add(number.name, recorded, own, level, share)

    def _value(self, number: RequestedNumber) -> None:
        """Compare a value at the end of a stage with the course, which is compared itself."""
        course, times = self._field(number.course), self._field("increment_time")
        if number.contact is not None:
            row = course[self._places.contacts.index(number.contact)]
        else:
            row = course[self._source.system.all_names.index(str(number.part))]
        own = 0.0
        for stage, sign in ((number.stage, 1.0), (number.minus, -1.0)):
            if stage:
                end = self._run.outcome.points[stage].state.time
                near = np.flatnonzero(np.abs(times - end) < _ROUNDED)
                own += sign * (row[near[-1]] if len(near) else np.nan)
        if np.isfinite(own):
            scale = max(float(np.nanmax(np.abs(row))), self._least["gap"])
            self._out.add(number.name, self._record.scalars[number.name], own, scale)

    def _values(
        self, number: RequestedNumber, stage: str, kind: str, part: str
    ) -> tuple[Array, Array]:
        """Return the values (n,) of a field of a body or line, and their positions (2, n)."""
        if number.line is not None:
            line = self._places.lines[number.line]
            body, X = line.body, line.X
        else:
            body, X = str(number.body), None
        fields = self._source.fields(body, stage)
        if part and kind == "plastic_strain":
            kind = "plastic_tensor"
        if X is None and kind in ("mises", "plastic_strain"):
            X, mises, flow = fields.at_points
            values = mises if kind == "mises" else flow
        else:
            nodal = at_nodes(fields, kind)
            places = None if X is None else Located(self._source.plain(body), X)
            values = nodal if places is None else places.of(nodal)
            values = _part(values, part) if part else np.maximum(values, 0.0)
            X = fields.plain.part.X if X is None else X
        spans = (number.x, number.y, number.z) if number.line is None else ()
        inside = in_box(X, spans, float(np.ptp(X, axis=1).max()))
        return np.where(inside, values, np.nan), X


def _part(values: Array, part: str) -> Array:
    """Return a component (n,) of a vector or tensor (n_components, n), or an invariant."""
    if part in _PARTS:
        return values[_PARTS[part]]
    xx, yy, zz, xy, *out = values
    yz, zx = out or (np.zeros_like(xy), np.zeros_like(xy))
    known = np.isfinite(xx)
    tensor = np.moveaxis(np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]]), -1, 0)
    low, middle, high = np.linalg.eigvalsh(np.where(known[:, None, None], tensor, 0.0)).T
    found = {"principal_1": high, "principal_2": middle, "principal_3": low, "tresca": high - low,
             "hydrostatic": (xx + yy + zz) / 3}[part]  # fmt: skip
    return np.where(known, found, np.nan)


def _lengths(X: Array) -> Array:
    """Return how far places (n_axes, n) are from the first (n,), along the line through them."""
    return np.append(0.0, np.cumsum(np.hypot.reduce(np.diff(X))))


def _on_slave(found: Tractions, kind: str) -> Array:
    """Return pressure, shear, gap or slip at the vertices of a slave (n,), NaN if not known."""
    if kind in ("pressure", "pressure_deformed"):
        moved = kind == "pressure_deformed"
        return np.where(found.known, found.pressure(moved=moved), np.nan)
    if kind == "shear":
        return np.where(found.known, -found.shear(moved=False), np.nan)
    return np.where(found.whole, _of_gaps(found, kind, COVERED), np.nan)


def _of_gaps(found: Tractions, kind: str, share: float) -> Array:
    """Return gap or slip at the vertices of a slave (n,), NaN where no master faces their hats.

    ``share`` is the part of a hat above which it counts as facing the master.
    """
    values = found.touching.gap if kind == "gap" else found.touching.way
    return np.where(found.share > share, values, np.nan)


def _above_zero(values: Array, s: Array) -> float:
    """Return the length on which values, linear between positions s, are above zero [mm]."""
    total = 0.0
    for a, b, length in zip(values[:-1], values[1:], np.diff(s), strict=True):
        if a > 0 and b > 0:
            total += length
        elif a > 0 or b > 0:
            total += length * max(a, b) / abs(a - b)
    return float(total)
