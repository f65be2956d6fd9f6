"""Pressure, shear and gap of a contact pair, from contact forces and the surfaces' shapes."""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from solver.audit.plain import load_factor
from solver.audit.surfaces import PairState, Surfaces, deformed
from solver.contact.state import Converged
from solver.contact.system import System
from solver.mesh.edges import shape_derivatives, shape_functions
from solver.model.loads import TravellingPressure
from solver.rolling.plane.wheel import RollingContact

Array = NDArray[np.float64]

_XI, _WEIGHT = np.polynomial.legendre.leggauss(4)
_WHOLE = 1e-6
"""Share of a vertex's hat that may lie beyond the master although the vertex faces it."""
COVERED = 1e-3
"""Share of a vertex's hat up to which the vertex does not face the master, as in the solver."""


class Tractions:
    """A contact pair in a converged state; arrays (n,) are those of the slave's vertices."""

    def __init__(self, system: System, number: int, converged: Converged) -> None:
        state, self._contact = converged.state, converged.state.contacts[number]
        self._surfaces = Surfaces(system, number, finite=self._contact.finite)
        self._model = system.model
        self._chain = self._surfaces.slave
        self._measured = self._surfaces, state, converged.start
        slave = self._surfaces.pair.slave[0]
        self._moved = deformed(system, slave, state)[0][:, self._chain.nodes]

    @cached_property
    def touching(self) -> PairState:
        """Gaps and motions on the deformed bodies."""
        surfaces, state, start = self._measured
        return surfaces.measured(state, start, self._contact.normal, self._contact.tangential)

    @property
    def gap(self) -> Array:
        """Mean gap under the hats, NaN where no master faces the slave [mm]."""
        return self.touching.gap

    @property
    def way(self) -> float:
        """Largest motion or gap of the slave: the scale of gaps [mm]."""
        moved = float(np.abs(self._moved - self._chain.X).max())
        return max(moved, float(np.nanmax(np.abs(self.touching.gap), initial=0.0)))

    @property
    def X(self) -> Array:
        """Positions of the vertices (2, n) [mm]."""
        return np.asarray(self._chain.X[:, self._chain.vertices])

    @property
    def s(self) -> Array:
        """Distance from the first vertex [mm]."""
        return np.append(0.0, np.cumsum(np.hypot(*np.diff(self.X))))

    @property
    def closed(self) -> NDArray[np.bool_]:
        """Whether vertices (n,) carry pressure."""
        return np.asarray(self._contact.normal > 0)

    @property
    def measured(self) -> bool:
        """Whether gaps and motions are means with another projection than the solver's."""
        return self._surfaces.finite or self._surfaces.curved

    @cached_property
    def whole(self) -> NDArray[np.bool_]:
        """Whether the hat of a vertex faces the master completely or not at all.

        The part of another hat that faces it depends on the projection.
        """
        return np.asarray((self.share > 1 - _WHOLE) | (self.share < _WHOLE))

    @property
    def share(self) -> Array:
        """Shares of the hats (n,) that face the master."""
        return self.touching.area / self._area

    @cached_property
    def known(self) -> NDArray[np.bool_]:
        """Whether the hats of a vertex and its neighbours face the master completely or not at all.

        Pressure and shear are means over the hats of neighbours.
        """
        whole = self.whole
        return whole & np.append(whole[1:], True) & np.append(True, whole[:-1])

    def force(self, kind: str) -> float:
        """The sum of the contact forces of ``pressure`` or ``shear`` [N]."""
        forces = self._contact.normal if kind == "pressure" else -self._contact.tangential
        return float(forces.sum())

    def _depth(self, x: Array) -> Array:
        """The depth at positions x (2, ...) [mm]: thickness, or 2 pi r."""
        if self._model.bodies[0].kinematics == "axisymmetric":
            return np.asarray(2 * np.pi * x[0])
        name = self._surfaces.pair.slave[0]
        return np.full(x.shape[1:], self._model.body(name).thickness)

    def _hats(self, x: Array) -> Array:
        """The integrals (n, n) of products of two hats, for nodes at x (2, n_nodes) [mm2].

        Their sum over one index is the area of a hat.
        """
        edges = self._chain.edges
        k, at = edges.shape[1], x[:, edges]
        place = at @ shape_functions(_XI, k).T
        along = np.hypot(*(at @ shape_derivatives(_XI, k).T))
        weight = _WEIGHT * along * self._depth(place)
        ends = np.stack([(1 - _XI) / 2, (1 + _XI) / 2])
        blocks = np.einsum("ep,ap,bp->eab", weight, ends, ends)
        n = len(edges)
        out, first = np.zeros((n + 1, n + 1)), np.arange(n)
        for a in (0, 1):
            for b in (0, 1):
                np.add.at(out, (first + a, first + b), blocks[:, a, b])
        return out

    @cached_property
    def _area(self) -> Array:
        return np.asarray(self._hats(self._chain.X).sum(axis=1))

    def over_area(self, force: Array, *, moved: bool) -> Array:
        """means under the hats (n,) of a force per area [MPa] for forces (n,) [N].

        ``moved`` uses the area in the deformed positions, if sliding is finite.
        """
        hats = self._hats(self._chain.X)
        area = self._area
        each = np.divide(force, area, out=np.zeros_like(force), where=area > 0)
        mean = np.divide(hats @ each, area, out=np.zeros_like(force), where=area > 0)
        if not (moved and self._surfaces.finite):
            return np.asarray(mean)
        now = self._hats(self._moved).sum(axis=1)
        return np.asarray(mean * np.divide(area, now, out=np.ones_like(area), where=now > 0))

    def pressure(self, *, moved: bool) -> Array:
        """The contact pressure [MPa]."""
        return self.over_area(self._contact.normal, moved=moved)

    def shear(self, *, moved: bool) -> Array:
        """The shear on the slave along its surface [MPa]."""
        return self.over_area(self._contact.tangential, moved=moved)

    def patches(self, x: Array) -> list[tuple[float, float]]:
        """start and end of each contact along x (n,), which increases or decreases [mm].

        Near a smooth edge gap^(2/3) is linear in the distance. The line through the second and
        third open vertex is extrapolated to zero, at most to the next vertex.
        """
        opened = np.cbrt(np.where(self.closed, np.nan, self.gap)) ** 2
        ends = []
        for way in (-1, 1):
            beyond = np.roll(self.closed, -way)
            beyond[-1 if way > 0 else 0] = False
            for last in np.flatnonzero(self.closed & ~beyond):
                a, b, c, inner = last + way, last + 2 * way, last + 3 * way, last - way
                end = x[last]
                if 0 <= min(a, c) and max(a, c) < len(x) and not self.closed[a]:
                    steep = (opened[c] - opened[b]) / (x[c] - x[b])
                    if steep * (x[c] - x[b]) > 0 and opened[b] > 0:
                        inner = inner if 0 <= inner < len(x) else last
                        within = sorted((x[a], x[inner]))
                        end = np.clip(x[b] - opened[b] / steep, *within)
                ends.append((way, float(end)))
        starts, stops = ([end for way, end in ends if way == one] for one in (-1, 1))
        return list(zip(starts, stops, strict=True))

    @property
    def length(self) -> float:
        """Length of the contact [mm]."""
        return sum(stop - start for start, stop in self.patches(self.s))

    def on_slave(self, kind: str) -> Array:
        """Pressure, shear, gap or slip at the vertices (n,), NaN if not known."""
        if kind in ("gap", "slip"):
            return np.where(self.whole, self.of_gaps(kind, COVERED), np.nan)
        moved = kind == "pressure_deformed"
        found = -self.shear(moved=False) if kind == "shear" else self.pressure(moved=moved)
        return np.where(self.known, found, np.nan)

    def of_gaps(self, kind: str, share: float) -> Array:
        """Gap or slip at the vertices (n,), NaN where the master faces less of a hat than this."""
        values = self.touching.gap if kind == "gap" else self.touching.way
        return np.where(self.share > share, values, np.nan)


class Acting(NamedTuple):
    """Pressure, shear along +s on the lower body [MPa] and gap [mm] at places (n,), or NaN.

    ``way`` is how far the surfaces have moved [mm]; ``measured`` says that gaps are means with
    another projection than the solver's. The half-width lies between ``least`` and ``most`` [mm].
    """

    pressure: Array
    shear: Array
    gap: Array
    way: float = 0.0
    measured: bool = False
    least: float = np.nan
    most: float = np.nan
    peak: float = 0.0


def between(x: Array, at: Array, values: Array) -> Array:
    """Values at x, linearly interpolated from ``values`` at ``at``; NaN outside."""
    return np.asarray(np.interp(x, at, values, left=np.nan, right=np.nan))


def of_pair(found: Tractions, at: Array, x: Array, *, symmetric: bool) -> Acting:
    """What acts at x (n,) on a pair whose vertices are at ``at`` along the axis of the view."""
    order = np.argsort(at)
    if not found.closed.any():
        nothing = between(x, at[order], np.zeros_like(at))
        return Acting(nothing, nothing, np.full_like(x, np.nan))
    unknown = np.where(found.known, 0.0, np.nan)
    pressure, shear, gap = (
        between(x, at[order], (values + unknown)[order])
        for values in (found.pressure(moved=False), -found.shear(moved=False), found.gap)
    )
    mean = found.pressure(moved=False)
    width = np.nan
    if found.known[mean.argmax()]:
        patches = np.array(found.patches(at))
        width = float(patches.max() if symmetric else np.ptp(patches) / 2)
    peak = float(mean.max())
    return Acting(pressure, shear, gap, found.way, found.measured, width, width, peak)


def of_pressure(moving: TravellingPressure, time: float, x: Array) -> Acting:
    """What a travelling Hertz pressure exerts at places x (n,)."""
    away = x - load_factor(moving.position, time)
    peak, width = load_factor(moving.amplitude, time) * moving.peak, moving.half_width
    pressure = peak * np.sqrt(np.clip(1 - (away / width) ** 2, 0.0, None))
    shear = load_factor(moving.shear_ratio, time) * pressure
    return Acting(pressure, shear, np.full_like(x, np.nan), least=width, most=width, peak=peak)


def of_wheel(track: Any, found: Any, x: Array) -> Acting:
    """What a wheel exerts at places x (n,) on a track without ends; gaps are not known."""
    touching, chain, way = found.loading, track.surface, found.direction
    assert isinstance(touching, RollingContact)
    at = way * chain.X[0, chain.vertices]
    side, order = np.abs(np.diff(at)) / 2, np.argsort(at)
    area = np.append(side, 0.0) + np.append(0.0, side)
    pressure, shear = touching.normal / area, -way * touching.tangential / area
    width, side = np.ptp(at[pressure > 0]) / 2, 2 * side.max()
    return Acting(
        between(x, at[order], pressure[order]), between(x, at[order], shear[order]),
        np.full_like(x, np.nan), least=float(width - side), most=float(width + side),
        peak=float(pressure.max()),
    )  # fmt: skip
