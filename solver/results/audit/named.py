"""Compare stored results at named places with recomputed values."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from solver.model.rigid import Moved, RigidBody
from solver.results.audit.compared import AREA, LEAST_STRAIN, LIMIT, MEASURED, Compared, some
from solver.results.audit.links import linked
from solver.results.audit.plain import load_factor
from solver.results.audit.sources import between
from solver.results.audit.values import Located, at_nodes
from solver.results.body_fields import BODY_FIELDS, STORED
from solver.tensors import AXES, components

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from solver.results.audit.sources import OfStates
    from solver.results.audit.tractions import Tractions
    from solver.results.named_places import NamedPlaces
    from solver.results.record import Record
    from solver.results.requested import RequestedNumber
    from solver.results.run import FinishedRun

    Array = NDArray[np.float64]

_LEAST_LENGTH = 1e-9
"""Least scale of displacement, gap and slip, over the size of the bodies."""
_PARTS = {name: k for names in (components(6), AXES) for k, name in enumerate(names)}
_ROUNDED = 1e-9
"""Largest difference of two equal times of the program."""


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
        recorded, share = self._record.scalars[number.name], 1.0
        if number.contact is not None:
            found = self._source.tractions(
                self._places.contacts.index(number.contact), number.stage
            )
            values, X, s = _on_slave(found, kind), found.X, found.s
            share = self._share(found, kind)
            if number.is_resultant:
                level = self._run.outcome.points[number.stage].state.force_scale
                self._out.add(number.name, recorded, found.force(kind), level)
                return
            if kind in ("pressure", "shear") and np.isnan(values[found.closed]).any():
                return
            if (kind, number.take) == ("pressure", "extent"):
                share = LIMIT / MEASURED if found.measured else 1.0
                self._out.add(number.name, recorded, found.length, s[-1], share)
                return
            values = np.where(np.isnan(values) & ~found.closed, 0.0, values) if kind in (
                "pressure", "shear") else values  # fmt: skip
        else:
            values, X = self._values(number, number.stage, kind, part)
            if number.minus:
                values = values - self._values(number, number.minus, kind, part)[0]
            s = _lengths(X)
        scale = self._scale(kind, values)
        if not np.isfinite(values).any():
            return
        if number.take in ("maximum", "minimum"):
            own = np.nanmax(values) if number.take == "maximum" else np.nanmin(values)
            self._out.add(number.name, recorded, own, scale, share)
            place = [self._record.scalars[f"{number.name}_{axis}"] for axis in AXES[: len(X)]]
            off = np.hypot.reduce(X - np.array(place)[:, None])
            there = values[off <= off.min() * (1 + 1e-9) + 1e-12 * np.abs(X).max()]
            near = np.abs(there[np.isfinite(there)] - own).min(initial=np.inf)
            self._out.add(f"{number.name}_x", near, 0.0, scale, share)
            self._out.add(f"{number.name}_x", off.min(), 0.0, max(s[-1], self._least["gap"]))
            return
        values = np.nan_to_num(values)
        if number.take == "integral":
            whole, most = (float((v[1:] + v[:-1]) @ np.diff(s) / 2) for v in (values, abs(values)))
            self._out.add(number.name, recorded, whole, max(most, self._least[kind] * s[-1]), share)
            return
        self._out.add(number.name, recorded, _above_zero(values, s), s[-1], share)

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
        inside = np.ones(X.shape[1], dtype=bool)
        for at, span in zip(X, (number.x, number.y, number.z), strict=False):
            if span is not None and number.line is None:
                inside &= (at >= span[0]) & (at <= span[1])
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
    touching = found.touching
    return np.where(found.known, touching.gap if kind == "gap" else touching.way, np.nan)


def _above_zero(values: Array, s: Array) -> float:
    """Return the length on which values, linear between positions s, are above zero [mm]."""
    total = 0.0
    for a, b, length in zip(values[:-1], values[1:], np.diff(s), strict=True):
        if a > 0 and b > 0:
            total += length
        elif a > 0 or b > 0:
            total += length * max(a, b) / abs(a - b)
    return float(total)
