"""Recomputed fields and contact of a run by increments, from its states."""

from __future__ import annotations

import itertools
from functools import cache
from typing import Any

import numpy as np

from solver.model.motion import TravellingPressure
from solver.results.audit.plain import PlainBody, load_factor
from solver.results.audit.recomputed import Acting, BodyFields
from solver.results.audit.tractions import Tractions
from solver.results.audit.values import StateFields
from solver.results.run import FinishedRun
from solver.results.view import View
from solver.typing import Array


def between(x: Array, at: Array, values: Array) -> Array:
    """Return values at x, linearly interpolated from ``values`` at ``at``; NaN outside."""
    return np.asarray(np.interp(x, at, values, left=np.nan, right=np.nan))


def along(view: View, X: Array) -> Array:
    """Return the coordinates (n,) of places (n_axes, n) along the axis of a view [mm]."""
    each = zip(X, *view.axis, strict=True)
    return np.asarray(sum((x - x0) * ax for x, x0, ax in each))


class OfStates:
    """Recomputed results of a run by increments (see `Recomputed`)."""

    def __init__(self, run: FinishedRun) -> None:
        system: Any = run.system  # of a run by increments it is a `System`
        points = run.outcome.points

        def fields(name: str, stage: str) -> BodyFields:
            state, number = points[stage].state, system.part(name)
            plastic = state.plastic[number] if system.parts[number].meshed else None
            return StateFields(plain(name), system.displacement(name, state), plastic, state.time)

        # cached methods of this object would hold it, and it the system, in a circle
        self._run, self.system = run, system
        self.plain = plain = cache(lambda name: PlainBody(system.full(name)))
        self.fields = cache(fields)
        self.tractions = cache(lambda pair, stage: Tractions(system, pair, points[stage]))

    def exact(self, stage: str) -> bool:
        """See `Recomputed`."""
        del stage
        return True

    def held(self, name: str, stage: str) -> tuple[Array, Array]:
        """Return the solved and the declared displacements (2, n_nodes) each [mm].

        Declared are those of supports and moved boundaries, NaN elsewhere and in removed elements.
        """
        body, fields = self.plain(name).body, self.fields(name, stage)
        declared = np.full_like(fields.displacement, np.nan)
        for boundary, axes in body.supports.items():
            for each in axes:
                declared["xy".index(each), self.plain(name).part.boundary_nodes(boundary)] = 0.0
        moved: dict[tuple[str, int], float] = {}  # displacements of one boundary add up
        for load in body.every_load:
            factor = load_factor(load.amplitude, self._time(stage))
            for key in itertools.product(load.boundaries, load.components):
                moved[key] = moved.get(key, 0.0) + factor * load.components[key[1]]
        for (boundary, axis), value in moved.items():
            declared[axis, self.plain(name).part.boundary_nodes(boundary)] = value
        moved_to = fields.displacement
        return moved_to, np.where(np.isnan(moved_to), np.nan, declared)

    @property
    def _travelling(self) -> TravellingPressure | None:
        bodies = self.system.model.bodies
        return next((b.travelling for b in bodies if b.travelling is not None), None)

    def _time(self, stage: str) -> float:
        return float(self._run.outcome.points[stage].state.time)

    def centre(self, stage: str) -> float:
        """See `Recomputed`."""
        if stage not in self._run.view.following:
            return 0.0
        if self._travelling is not None:
            return load_factor(self._travelling.position, self._time(stage))
        axles = (b.axle for b in self.system.model.bodies if b.axle is not None)
        each = (a.centre[0] + load_factor(a.position, self._time(stage)) for a in axles)
        return float(next(each, 0.0))

    def acting(self, stage: str, x: Array) -> Acting:
        """See `Recomputed`."""
        nowhere = np.full_like(x, np.nan)
        if not self.system.interfaces:
            if self._travelling is None:
                return Acting(nowhere, nowhere, nowhere)
            body = next(b for b in self.system.model.bodies if b.travelling is not None)
            side = body.periodic and body.box[0]
            return Acting(*hertz(self._travelling, self._time(stage), x, side or 0.0), nowhere)
        found = self.tractions(0, stage)
        at = along(self._run.view, found.X)
        order = np.argsort(at)
        if not found.closed.any():
            nothing = between(x, at[order], np.zeros_like(at))
            return Acting(nothing, nothing, nowhere)
        unknown = np.where(found.known, 0.0, np.nan)
        pressure, shear, gap = (
            between(x, at[order], (values + unknown)[order])
            for values in (found.pressure(moved=False), -found.shear(moved=False), found.gap)
        )
        if found.repeated:  # the gaps of periodic copies are not measured
            gap = nowhere
        return Acting(pressure, shear, gap, found.way, found.measured)

    def extent(self, stage: str) -> tuple[float, float, float]:
        """See `Recomputed`."""
        if not self.system.interfaces:
            moving = self._travelling
            if moving is None:
                return np.nan, np.nan, 0.0
            share = load_factor(moving.amplitude, self._time(stage))
            return moving.half_width, moving.half_width, share * moving.peak
        found = self.tractions(0, stage)
        if not found.closed.any():
            return np.nan, np.nan, 0.0
        pressure = found.pressure(moved=False)
        if not found.known[pressure.argmax()]:
            return np.nan, np.nan, float(pressure.max())
        patches = np.array(found.patches(along(self._run.view, found.X)))
        width = float(patches.max() if self._run.view.symmetric else np.ptp(patches) / 2)
        return width, width, float(pressure.max())


def hertz(moving: TravellingPressure, time: float, x: Array, period: float) -> tuple[Array, Array]:
    """Return pressure and shear of a travelling pressure at places x (n,) [MPa]."""
    away = x - load_factor(moving.position, time)
    if period:
        away = (away + period / 2) % period - period / 2
    inside = np.clip(1 - (away / moving.half_width) ** 2, 0.0, None)
    pressure = load_factor(moving.amplitude, time) * moving.peak * np.sqrt(inside)
    return pressure, load_factor(moving.shear_ratio, time) * pressure
