"""Pressure, shear and gap of a contact pair, from contact forces and the surfaces' shapes."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from solver.contact.state import Converged
from solver.contact.system import System
from solver.mesh.edges import shape_derivatives, shape_functions
from solver.results.audit.surfaces import PairState, Surfaces, deformed
from solver.typing import Array, Bools

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
        return surfaces.touching(state, start, self._contact.normal, self._contact.tangential)

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
    def closed(self) -> Bools:
        """Whether vertices (n,) carry pressure."""
        return np.asarray(self._contact.normal > 0)

    @property
    def repeated(self) -> bool:
        """Whether the body is periodic: the surface then has copies at its ends."""
        return len(np.unique(self._chain.nodes)) < len(self._chain.nodes)

    @property
    def measured(self) -> bool:
        """Whether gaps and motions are means with another projection than the solver's."""
        return self._surfaces.finite or self._surfaces.curved

    @cached_property
    def whole(self) -> Bools:
        """Whether the hat of a vertex faces the master completely or not at all.

        The part of another hat that faces it depends on the projection.
        """
        return np.asarray((self.share > 1 - _WHOLE) | (self.share < _WHOLE))

    @property
    def share(self) -> Array:
        """Shares of the hats (n,) that face the master."""
        return self.touching.area / self._area

    @cached_property
    def known(self) -> Bools:
        """Whether the hats of a vertex and its neighbours face the master completely or not at all.

        Pressure and shear are means over the hats of neighbours.
        """
        whole = self.whole
        return whole & np.append(whole[1:], True) & np.append(True, whole[:-1])

    def force(self, kind: str) -> float:
        """Return the sum of the contact forces of ``pressure`` or ``shear`` [N]."""
        forces = self._contact.normal if kind == "pressure" else -self._contact.tangential
        return float(forces.sum())

    def _depth(self, x: Array) -> Array:
        """Return the depth at positions x (2, ...) [mm]: thickness, or 2 pi r."""
        if self._model.bodies[0].kinematics == "axisymmetric":
            return np.asarray(2 * np.pi * x[0])
        name = self._surfaces.pair.slave[0]
        return np.full(x.shape[1:], self._model.body(name).thickness)

    def _hats(self, x: Array) -> Array:
        """Return the integrals (n, n) of products of two hats, for nodes at x (2, n_nodes) [mm2].

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
        """Return means under the hats (n,) of a force per area [MPa] for forces (n,) [N].

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
        """Return the contact pressure [MPa]."""
        return self.over_area(self._contact.normal, moved=moved)

    def shear(self, *, moved: bool) -> Array:
        """Return the shear on the slave along its surface [MPa]."""
        return self.over_area(self._contact.tangential, moved=moved)

    def patches(self, x: Array) -> list[tuple[float, float]]:
        """Return start and end of each contact along x (n,), which increases or decreases [mm].

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
