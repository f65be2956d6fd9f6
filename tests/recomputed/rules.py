"""States of a run, and own values of fields, contact and extremes at its places."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cache, cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from solver.audit import links
from solver.audit.plain import PlainBody, load_factor
from solver.fem.discretisation import Discretisation
from solver.model.loads import TravellingPressure
from solver.model.rigid import Moved, RigidBody
from solver.results.body_fields import STORED
from solver.results.named_places import NamedPlaces
from solver.results.record import Record
from solver.results.requested import RequestedNumber
from solver.results.run import FinishedRun
from solver.results.view import View
from solver.rolling.results.plane import TrackBody
from solver.tensors import AXES, components
from tests.recomputed.bodies import Fields, Located, PlainSection, of_pass, of_state, of_zone
from tests.recomputed.contact import (
    Acting,
    Tractions,
    between,
    of_pair,
    of_pressure,
    of_wheel,
)

Array = NDArray[np.float64]

LIMIT = 1e-6
"""Limit of difference / scale, a multiple of rounding: both interpolate in the same elements."""
MEASURED = 0.02
"""Limit for gap, slip and reactions if surfaces are curved or slide far: the rules project points
differently, and means over hats differ with the angle of the surface within an edge."""
AREA = 1e-4
"""Limit for pressure and shear on such surfaces: at the ends of the contact another projection
gives another share of a hat that faces the partner."""
STEADY = 1e-3
"""Limit for stress under a steady load: its strains are those of equilibrium up to
`audit_steadiness`."""
LEAST_STRAIN = 1e-6
"""Least scale of strains; times Young's modulus, least scale of stresses."""
LEAST_LENGTH = 1e-9
"""Least scale of displacement, gap and slip, over the size of the bodies."""
NEAR = 0.1
"""Ratio of the gap to the largest motion or gap; below it gaps by different projections are
compared."""
SAME_TIME = 1e-9
"""Largest difference of two equal times of the program."""
COUNT, GOLDEN = 24, (5**0.5 - 1) / 2
"""Number of values of a field that are computed again, besides the largest, and their spread."""
OUTSIDE = np.inf
"""Own value where nothing may be stored, as the place is outside all bodies."""
MAPS = ("residual_stress", "plastic_strain", "stress_difference", *(f"map_{f}" for f in STORED))


class Own(NamedTuple):
    """Own values, NaN where they are not known, and the differences that are allowed."""

    values: Any
    allowed: Any = 0.0


def some(count: int, *fields: Array) -> NDArray[np.int64]:
    """Numbers of some places, evenly spread, and where fields (..., n) are largest."""
    spread = np.floor(np.arange(1, COUNT + 1) * GOLDEN % 1.0 * count).astype(np.int64)
    largest = [np.argmax(np.abs(np.nan_to_num(one)))
               for field in fields for one in field.reshape(-1, count)]  # fmt: skip
    return np.unique(np.concatenate([spread, np.array(largest, dtype=np.int64)]))


def spread(values: Array, at: NDArray[np.int64], count: int) -> Array:
    """Values (..., n_at) at some of all places (..., count), NaN elsewhere."""
    out = np.full((*values.shape[:-1], count), np.nan)
    out[..., at] = values
    return out


class Rules:
    """The states of a run, and what own values are made of."""

    def __init__(
        self, run: FinishedRun, record: Record, view: View, places: NamedPlaces | None
    ) -> None:
        self.run, self.record, self.view = run, record, view
        self.system: Any = run.system
        self.track = getattr(run.system, "track", None)
        self.passed = None if self.track is None else _passed(run)
        self.places = places if self.track is None else None
        self.numbers: Sequence[RequestedNumber] = self.places.numbers if self.places else ()
        self.plain = cache(self._plain)
        self.fields = cache(self._fields)
        self.acting = cache(self._acting)
        self.located = cache(
            lambda body, at: Located(self.plain(body), np.frombuffer(at).reshape(self.axes, -1))
        )
        self.tractions = cache(
            lambda pair, at: Tractions(self.system, pair, run.outcome.points[at])
        )

    # -- states ----------------------------------------------------------------------------------

    @property
    def axes(self) -> int:
        return len(self.view.axis.origin)

    @property
    def names(self) -> Sequence[str]:
        return self.system.names

    def _plain(self, body: str) -> PlainBody:
        kind = PlainBody if self.axes == 2 else PlainSection
        return kind(self.system.full(body))

    def _fields(self, body: str, stage: str) -> Fields:
        state, plain, released = self.state(stage), self.plain(body), stage == self.view.unloaded
        if isinstance(plain, PlainSection):
            return of_zone(plain, self.track, self.passed, state.u if released else None)
        if self.track is not None:
            return of_pass(plain, self.track, self.passed, loaded=not released)
        number = self.system.part(body)
        whole = isinstance(self.system.parts[number], Discretisation)
        plastic = state.plastic[number] if whole else None
        return of_state(plain, self.system.displacement(body, state), plastic, state.time)

    def state(self, stage: str) -> Any:
        return self.run.outcome.points[stage].state

    def stored(self, name: str) -> Array:
        """A stored field, after the last pass if it has the dimension of passes."""
        dims, values = self.record.fields[name]
        return np.asarray(values)[-1] if dims[0] == "pass" else np.asarray(values)

    def axis(self, name: str) -> Array:
        return np.asarray(self.record.coordinates.get(name, np.zeros(0)), dtype=float)

    # -- scales ----------------------------------------------------------------------------------

    @cached_property
    def stress_scale(self) -> float:
        """The largest stress under load, at least `LEAST_STRAIN` times Young's modulus [MPa]."""
        each = [self.fields(name, self.view.loaded) for name in self.view.surfaces or self.names]
        most = max(float(np.nanmax(np.abs(fields.at("stress")))) for fields in each)
        E = max(f.plain.body.material.elasticity.youngs_modulus for f in each)
        return max(most, LEAST_STRAIN * E)

    @cached_property
    def size(self) -> float:
        """The largest side of the bodies [mm]."""
        return max(float(np.ptp(self.system.full(name).X, axis=1).max()) for name in self.names)

    def scale(self, kind: str, values: Array) -> float:
        """The largest of values, at least what rounding of its kind makes of nothing."""
        least = {"stress": self.stress_scale, "mises": self.stress_scale, "flow": LEAST_STRAIN}
        least |= dict.fromkeys(("plastic_strain", "plastic_tensor", "strain"), LEAST_STRAIN)
        least |= dict.fromkeys(("displacement", "gap", "slip"), LEAST_LENGTH * self.size)
        most = float(np.max(np.abs(values[np.isfinite(values)]), initial=0.0))
        return max(most, least.get(kind, LEAST_STRAIN * self.stress_scale))

    def _field_scale(self, kind: str, values: Array) -> float:
        return self.stress_scale if kind in ("stress", "mises") else self.scale(kind, values)

    def limit(self, stage: str, kind: str = "") -> float:
        """Limit of a field in a state; equivalent plastic strain is exact in all."""
        steady = isinstance(self.system, TrackBody) and stage != self.view.unloaded
        return STEADY if steady and kind != "plastic_strain" else LIMIT

    # -- fields at places of the view -------------------------------------------------------------

    def _place(self, s: Array, depth: Array) -> Array:
        """Places (n_axes, n) along the axis of the view and below it [mm]."""
        axis = self.view.axis
        each = zip(*axis, axis.down, strict=True)
        return np.stack([x0 + s * ax + depth * down for x0, ax, down in each])

    def _along(self, X: Array) -> Array:
        """Coordinates (n,) of places (n_axes, n) along the axis of the view [mm]."""
        each = zip(X, *self.view.axis, strict=True)
        return np.asarray(sum((x - x0) * way for x, x0, way in each))

    def _height(self, s: Array) -> Array:
        """Height (n,) of the surface over the axis of the view [mm]."""
        return np.interp(s, *self.view.top) if self.view.top.size else np.zeros(len(s))

    def sampled(self, bodies: Sequence[str], X: Array, field: str, stage: str) -> Array:
        """A field at places (..., n), of the first body that contains each."""
        found = [(self.located(name, X.tobytes()), self.fields(name, stage)) for name in bodies]
        out = found[0][0].of(found[0][1].at(field))
        unsure = ~found[0][0].inside & ~found[0][0].outside
        for where, fields in found[1:]:
            here = where.of(fields.at(field))
            out = np.where(np.isnan(out) & ~unsure, here, out)
            unsure |= ~where.inside & ~where.outside
        out = np.maximum(out, 0.0) if field in ("mises", "plastic_strain") else out
        return np.where(np.all([where.outside for where, _ in found], axis=0), OUTSIDE, out)

    @cached_property
    def _map(self) -> tuple[NDArray[np.int64], Array]:
        """Which places of the map are compared, and where they are."""
        x, y = (self.axis(name) for name in self.view.map_axes)
        there = [name for name in MAPS if name in self.record.fields]
        at = some(
            len(x) * len(y), *(self.stored(name).reshape(-1, len(x) * len(y)) for name in there)
        )
        return at, self._place(x[at % len(x)], -y[at // len(x)])

    def on_map(self, field: str, stage: str) -> Array:
        """A field (..., ny, nx) of the map."""
        at, X = self._map
        shape = [len(self.axis(name)) for name in self.view.map_axes[::-1]]
        own = self.sampled(tuple(self.view.surfaces), X, field, stage)
        return spread(own, at, shape[0] * shape[1]).reshape(*own.shape[:-1], *shape)

    def map(self, name: str, field: str) -> Own:
        """A map of a field in all stages, or after release."""
        values, staged = self.stored(name), name.startswith("map_")
        stages = self.view.stages if staged else (self.view.unloaded,)
        own = np.stack([self.on_map(field, stage) for stage in stages])
        limits = np.reshape(
            [self.limit(stage, field) for stage in stages], (-1, *[1] * (own.ndim - 1))
        )
        scale = [self._field_scale(field, one) for one in (values if staged else [values])]
        allowed = limits * np.reshape(scale, limits.shape)
        return Own(own, allowed) if staged else Own(own[0], allowed[0])

    def stress_difference(self) -> Own:
        """Difference of the principal stresses in the plane of the map."""
        stage, axes = self.view.loaded, self.view.map_axes
        stress = self.on_map("stress", stage)
        one, other = (stress[AXES.index(axis)] for axis in axes)
        shear = stress[components(len(stress)).index("".join(sorted(axes)))]
        with np.errstate(invalid="ignore"):
            own = np.sqrt((one - other) ** 2 + 4 * shear**2)
        own = np.where(np.isinf(one), OUTSIDE, own)
        return Own(own, self.limit(stage) * self.stress_scale)

    def profile(self, field: str) -> Own:
        """A field after release at each depth below each station."""
        station, depth, view = self.axis("station"), self.axis("depth"), self.view
        flat = [
            np.moveaxis(self.stored("residual_profile"), 1, 0),
            self.stored("profile_plastic_strain"),
        ]
        count = len(station) * len(depth)
        at = some(count, *(values.reshape(-1, count) for values in flat))
        top = self._height(station)[at // len(depth)]
        inside = np.maximum(depth, 1e-4 * depth.max() if self.view.top.size else 0.0)
        X = self._place(station[at // len(depth)], inside[at % len(depth)] - top)
        # the state behind a steady pass is interpolated from recovered values
        steady = isinstance(self.system, TrackBody) and field == "plastic_strain"
        own = self.sampled((view.profile_body,), X, "flow" if steady else field, view.unloaded)
        own = np.maximum(own, 0.0) if steady else own
        own = spread(own, at, count).reshape(*own.shape[:-1], len(station), len(depth))
        scale = self._field_scale(field, flat[1])
        return Own(own if own.ndim == 2 else np.moveaxis(own, 0, 1), LIMIT * scale)

    def surface_residual(self) -> Own:
        s, view, own = self.axis("s"), self.view, []
        for values, name in zip(self.stored("surface_residual"), view.surfaces, strict=True):
            at = some(len(s), values)
            X = self._place(s[at], np.zeros(len(at)))
            own.append(spread(self.sampled((name,), X, "stress", view.unloaded), at, len(s)))
        return Own(np.stack(own), LIMIT * self.stress_scale)

    def surface_mises(self) -> Own:
        s, view, name, own = self.axis("s"), self.view, self.view.profile_body, []
        for stage in view.stages:
            fields = self.fields(name, stage)
            nodes = fields.plain.part.boundary_nodes(view.surfaces[name])
            reached = self._along(fields.plain.part.X[:, nodes])
            order = np.argsort(reached)
            values = np.minimum(fields.at("mises")[nodes][order], np.max(fields.at_points[1]))
            own.append(between(s + self._centre(stage), reached[order], values))
        return Own(np.stack(own), LIMIT * self.stress_scale)

    # -- contact along the view -------------------------------------------------------------------

    @property
    def _travelling(self) -> Any:
        each = (load for body in self.system.model.bodies for load in body.every_load)
        return next((load for load in each if isinstance(load, TravellingPressure)), None)

    def _centre(self, stage: str) -> float:
        """Position of s = 0 along the axis of the view [mm]."""
        if self.track is not None or stage not in self.view.following:
            return 0.0
        time, moving = float(self.state(stage).time), self._travelling
        if moving is not None:
            return load_factor(moving.position, time)
        axles = (body.axle for body in self.system.model.bodies if body.axle is not None)
        return next((float(a.centre[0] + load_factor(a.position, time)) for a in axles), 0.0)

    def _acting(self, stage: str) -> Acting:
        x, nowhere = self.axis("s") + self._centre(stage), np.full(len(self.axis("s")), np.nan)
        if isinstance(self.system, TrackBody):
            released = stage == self.view.unloaded
            if self.run.parameters.load == "hertz":
                acting: Any = self.run.acting
                return of_pressure(*acting.args, float(released), x)
            if released:
                return Acting(np.zeros_like(x), np.zeros_like(x), nowhere)
            return of_wheel(self.track, self.passed, x)
        if self.track is not None:  # the contact is no line
            return Acting(nowhere, nowhere, nowhere)
        if self.system.interfaces:
            found = self.tractions(0, stage)
            return of_pair(found, self._along(found.X), x, symmetric=self.view.symmetric)
        if self._travelling is None:
            return Acting(nowhere, nowhere, nowhere)
        return of_pressure(self._travelling, float(self.state(stage).time), x)

    def contact_line(self, kind: str) -> Own | None:
        """Pressure, shear or gap along the view, or along each contact."""
        if self.record.fields[f"contact_{kind}"][0][0] == "contact":
            return self.contact(kind)
        own, allowed = [], []
        for stage, stored in zip(self.view.stages, self.stored(f"contact_{kind}"), strict=True):
            acting = self.acting(stage)
            values, scale = (
                getattr(acting, kind),
                max(acting.peak, LEAST_STRAIN * self.stress_scale),
            )
            limit = LIMIT
            if kind == "gap":
                scale, limit = acting.way, MEASURED if acting.measured else LIMIT
                # far from contact a gap, and whether it exists, depends on the projection
                near = np.isfinite(stored) & (np.abs(values) < NEAR * acting.way)
                values = np.where(near | (not acting.measured), values, np.nan)
            own.append(values)
            allowed.append(np.full(len(values), limit * scale))
        return Own(np.stack(own), np.stack(allowed))

    def peak(self) -> Own:
        found = self.acting(self.view.loaded).peak
        return Own(found if len(self.axis("s")) else np.nan, LIMIT * found)

    def half_width(self) -> Own:
        """Middle of its bounds, which allow half of their distance.

        The edge of contact is found from gaps.
        """
        found = self.acting(self.view.loaded)
        own, aside = (found.most + found.least) / 2, (found.most - found.least) / 2
        limit = MEASURED if found.measured else LIMIT
        return Own(own if len(self.axis("s")) else np.nan, aside + limit * found.most)

    # -- extremes ---------------------------------------------------------------------------------

    def _strained(self, bodies: Sequence[str] = ()) -> tuple[Array, Array]:
        """Positions (n_axes, n) and plastic strain (n,) of all points after release."""
        each = [self.fields(n, self.view.unloaded).at_points for n in bodies or self.names]
        X, _, flow = zip(*each, strict=True)
        return np.concatenate(X, axis=1), np.concatenate(flow)

    def most_strained(self, bodies: Sequence[str] = ()) -> Own:
        """The largest plastic strain of some bodies, or of all."""
        flow = self._strained(bodies)[1]
        return Own(np.nanmax(flow), LIMIT * self.scale("flow", flow))

    def depth_of_most(self) -> Own:
        X, flow = self._strained()
        each = zip(X, self.view.axis.origin, self.view.axis.down, strict=True)
        depth = sum((x - x0) * down for x, x0, down in each) + self._height(self._along(X))
        there = flow >= np.nanmax(flow) - LIMIT * self.scale("flow", flow)
        stored = np.array([self.record.scalars["depth_of_max_plastic_strain"]])
        return Own(closest(depth[None, there], stored)[0], LIMIT * self.size)

    def peak_residual(self, of: Callable[[Any], Any]) -> Own:
        each = [self.fields(n, self.view.unloaded).at("stress")[:3].ravel() for n in self.names]
        return Own(of(np.concatenate(each)), LIMIT * self.stress_scale)

    def extreme(self, name: str, axis: str = "") -> Own:
        """Extreme stress of each body and component, or its position along an axis."""
        own, surface = [], name.startswith("surface")
        of = np.nanmax if name.endswith("max") else np.nanmin
        for k, (body, boundary) in enumerate(self.view.surfaces.items()):
            fields = self.fields(body, self.view.unloaded)
            X, stress = fields.plain.part.X, fields.at("stress")
            axes: Sequence[str] = AXES[: len(X)]
            if surface:
                nodes = fields.plain.part.boundary_nodes(boundary)
                X, stress = self._along(X[:, nodes])[None], stress[:, nodes]
                axes = ("s",)
            most = of(stress, axis=1)
            if axis:
                there = np.abs(stress - most[:, None]) <= LIMIT * self.stress_scale
                where = np.stack([self.stored(f"{name}_{each}")[k] for each in axes])
                found = [closest(X[:, t], where[:, c]) for c, t in enumerate(there)]
                most = np.array(found)[:, axes.index(axis)]
            own.append(most)
        return Own(np.stack(own), LIMIT * (self.size if axis else self.stress_scale))

    # -- named places -----------------------------------------------------------------------------

    def coordinate(self, name: str) -> Own | None:
        """A coordinate of the view or of named places."""
        declared = self.view.coordinates
        if self.places is not None:
            declared = declared | {
                "line": list(self.places.lines), "point": list(self.places.points),
                "contact": list(self.places.contacts), "part": list(self.system.all_names),
            }  # fmt: skip
        if name not in declared:
            return None
        values = np.asarray(declared[name])
        return Own(values, LIMIT * np.abs(values).max() if values.dtype.kind == "f" else 0.0)

    def place(self, kind: str, axis: int) -> Own:
        """Positions of lines or points along an axis."""
        assert self.places is not None
        each = getattr(self.places, f"{kind}s").values()
        own = np.stack([places.X[axis] for places in each])
        most = max(float(np.abs(places.X).max()) for places in each)
        return Own(own[:, 0] if kind == "point" else own, LIMIT * most)

    def line_s(self) -> Own:
        assert self.places is not None
        own = np.stack([lengths(line.X) for line in self.places.lines.values()])
        return Own(own, LIMIT * own[:, -1:])

    def at_places(self, kind: str, field: str) -> Own:
        """A field on lines or at points in all stages."""
        assert self.places is not None
        own, allowed = [], []
        for k, (body, X) in enumerate(getattr(self.places, f"{kind}s").values()):
            at = np.arange(X.shape[1])
            if kind == "line":
                stored = [self.stored(f"line_{each}")[k] for each in STORED]
                at = some(X.shape[1], *stored)
            for stage in self.view.stages:
                values = self.sampled((body,), X[:, at], field, stage)
                values = spread(values, at, X.shape[1])
                own.append(values if kind == "line" else values[..., 0])
                scale = self.scale(field, self.fields(body, stage).at(field))
                allowed.append(np.full(own[-1].shape, LIMIT * scale))
        shape = (-1, len(self.view.stages), *own[0].shape)
        return Own(np.reshape(own, shape), np.reshape(allowed, shape))

    def displacement(self, axis: int) -> Own:
        """Displacement of points along an axis."""
        own, allowed = self.at_places("point", "displacement")
        return Own(own[..., axis], allowed[..., axis])

    def contact(self, kind: str) -> Own | None:
        """Pressure, shear, gap or slip along each contact in all stages, or positions there."""
        if self.places is None or not self.places.samples:
            return None
        own, allowed = [], []
        for k, _ in enumerate(self.places.contacts):
            for stage in self.view.stages:
                found = self.tractions(k, stage)
                s = np.asarray(self.record.coordinates["fraction"]) * found.s[-1]
                if kind in ("s", "x", "y"):
                    values = found.s if kind == "s" else found.X["xy".index(kind)]
                    scale, limit = float(np.abs(found.X).max() if kind != "s" else s[-1]), LIMIT
                else:
                    values, limit = found.on_slave(kind), self.share(found, kind)
                    scale = self.scale(kind, values)
                    if kind in ("gap", "slip"):  # after unloading only rounding may be left
                        scale = max(found.way, LEAST_LENGTH * self.size)
                own.append(between(s, found.s, values))
                allowed.append(np.full(len(s), limit * scale))
        shape = (len(self.places.contacts), len(self.view.stages), -1)
        both = Own(np.reshape(own, shape), np.reshape(allowed, shape))
        return Own(both.values[:, 0], both.allowed[:, 0]) if kind in ("s", "x", "y") else both

    @staticmethod
    def share(found: Tractions, kind: str) -> float:
        limit = MEASURED if kind in ("gap", "slip") else AREA
        return limit if found.measured else LIMIT

    # -- at the ends of stages -------------------------------------------------------------------

    @cached_property
    def _courses(self) -> dict[str, Own]:
        """Forces and motions after increments, known at the ends of stages."""
        found: dict[str, Own] = {}
        if self.places is None or "increment_time" not in self.record.fields:
            return found
        for stage in self.view.stages:
            away = np.abs(self.stored("increment_time") - self.state(stage).time)
            near = np.flatnonzero(away < SAME_TIME)
            for name, row, value, allowed in self._ended(stage) if len(near) else ():
                if name in self.record.fields:
                    shape = self.stored(name).shape
                    own = found.setdefault(name, Own(np.full(shape, np.nan), np.zeros(shape)))
                    own.values[row, near[-1]], own.allowed[row, near[-1]] = value, allowed
        return found

    def _ended(self, stage: str) -> Iterator[tuple[str, int, float, float]]:
        """Yield what a stage ends with: the variable, its row, its value and what is allowed."""
        system, state = self.system, self.state(stage)
        contact = {name: np.zeros(2) for name in system.all_names}
        exact, limit = LIMIT * state.force_scale, LIMIT
        for k, pair in enumerate(system.model.contacts):
            found = self.tractions(k, stage)
            limit = MEASURED if found.measured else limit
            contact[pair.slave[0]] += found.touching.on_slave.sum(axis=0)
            contact[pair.master[0]] += found.touching.on_master.sum(axis=0)
            yield "contact_normal_force", k, state.contacts[k].normal.sum(), exact
            yield "contact_tangential_force", k, -state.contacts[k].tangential.sum(), exact
        for row, name in enumerate(system.all_names):
            body, number = system.model.body(name), system.part(name)
            own = -contact[name] - links.resultant(system, state, state.links, name)[0]
            if isinstance(body, RigidBody):
                sizes = (1.0, 1.0, system.parts[number].frame.radius)
                for axis, motion, u, size in zip(
                    ("x", "y", "rotation"), body.every_load, state.u[number], sizes, strict=True
                ):
                    value = u / size
                    if isinstance(motion, Moved):
                        value = load_factor(motion.amplitude, state.time) * motion.value
                    least = LEAST_LENGTH * self.size / size
                    yield f"motion_{axis}", row, value, LIMIT * max(abs(value), least)
            elif body.axle is None:
                moved = system.displacement(name, state)
                own = own - self.plain(name).applied(state.time, moved)[0]
                if body.kinematics == "axisymmetric":
                    own[0] = np.nan  # radial forces balance around the axis
            else:
                continue
            for axis, value in zip("xy", own, strict=True):
                yield f"reaction_{axis}", row, value, limit * state.force_scale

    def course(self, name: str) -> Own | None:
        """Forces or motions after increments."""
        return self._courses.get(name)


def _passed(run: FinishedRun) -> Any:
    """The pass whose states a run has: what its audit checks."""
    check: Any = run.check
    return dict(zip(check.__code__.co_freevars, check.__closure__, strict=True))[
        "found"
    ].cell_contents


def closest(X: Array, to: Array) -> Array:
    """The place (n_axes,) of some (n_axes, n) that is closest to a stored one; NaN if it is."""
    if not np.isfinite(to).all():
        return np.full(len(X), np.nan)
    return np.asarray(X[:, np.abs(X - to[:, None]).max(axis=0).argmin()])


def lengths(X: Array) -> Array:
    """How far places (n_axes, n) are from the first (n,), along the line through them."""
    return np.append(0.0, np.cumsum(np.hypot.reduce(np.diff(X))))
