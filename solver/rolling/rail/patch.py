"""An elastic wheel that rolls over the surface of a prism, in the frame of its axle.

Material of both bodies flows upstream to downstream through the contact, in which nothing changes.
The *slip* at station c is the motion of the surface over the wheel while the axle advances by the
distance of two stations: with the displacements u of surface minus wheel, in local axes,

    slip[c] = (3 u_t[c] - 4 u_t[c - 1] + u_t[c - 2]) / 2 + rigid slip
    gap[c] = gap of the bodies - u_n[c]

The difference is of second order and one-sided, upstream, where material comes from: a central
difference would not couple the station to itself. The displacements are those without tractions,
and linear in the tractions: the influence between two stations depends on their distance alone. The
rest is the problem of `friction_cone`. The wheel is a half-space; its tractions are those of the
surface, mirrored.

J.J. Kalker, Three-Dimensional Elastic Bodies in Rolling Contact (1990), sections 1.6 and 4.2.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from solver.errors import ModelError, NoContact, Spins, WindowTooSmall
from solver.linear.solvers import one_thread
from solver.model.friction import BoundLines, FrictionLaw, pressure_lines
from solver.rolling.load import FULL_SLIP, spinning
from solver.rolling.rail.friction_cone import (
    NORMAL,
    OPEN,
    TANGENTS,
    TOLERANCE,
    ConeProblem,
    ConeSolution,
    Influence,
    solve_cone,
)
from solver.rolling.rail.half_space import half_space
from solver.rolling.rail.patch_contact import PatchContact, PatchLoad, PatchStart
from solver.rolling.rail.patch_grid import PatchGrid
from solver.rolling.rail.profiled_wheel import ProfiledWheel
from solver.typing import Array, Ints

_MIRROR = np.array([1.0, -1.0, 1.0])
"""Signs from the local axes of the prism's surface to those of the wheel's; the same for (shear,
pressure, shear)."""
_PRESSED = 0.5
"""Interpenetration of the undeformed bodies at the edge of the contact, over their approach. For a
ball in contact over a radius a it is 0.5 at the edge (K.L. Johnson, 1985, section 4.2)."""
_EXACT = 1e-12
"""Tolerance of `solve_cone`, of contacts of which differences of 1e-5 are taken."""
UPSTREAM = (1.5, -2.0, 0.5)
"""Weights of the displacement at a station, at the one before and at the second before, in the
slip."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RollingPatch(PatchLoad):
    """A wheel pressed on the surface of a prism.

    Attributes
    ----------
    grid : stations and vertices of the surface
    compliance : (N, m, 3, m, 3) [mm/MPa], N >= n: entry ``[d, i, a, j, b]`` is the displacement of
        the surface along axis a, the mean under hat i, d stations downstream of a unit traction
        along axis b at vertex j, in x, y, z. Negative d are at the end, as in an FFT; a prism of N
        stations that repeats itself has every d once
    wheel : the wheel
    friction : law that depends on pressure alone; without friction moment and lateral force are
        left out
    strength : initial shear yield stress of the prism [MPa]
    load : force and motion; creepages and spin are those of `ProfiledWheel.rolling`
    settled : tolerance of `solve_cone`
    """

    grid: PatchGrid
    compliance: Array
    wheel: ProfiledWheel
    friction: FrictionLaw
    strength: float = np.inf
    settled: float = TOLERANCE

    @property
    def exact(self) -> Self:
        """See `PassingLoad`."""
        return self.changed(settled=_EXACT)

    def __post_init__(self) -> None:
        """Raise `ModelError` for arrays and numbers that do not fit."""
        n, m = self.grid.stations, len(self.grid.z)
        shape = self.compliance.shape
        if shape[1:] != (m, 3, m, 3) or len(self.compliance) < n:
            raise ModelError("compliance", shape, f"must be ({n} or more, {m}, 3, {m}, 3)")
        if not self._lines.rough.any():
            object.__setattr__(self, "load", replace(self.load, drive=None, lateral_force=None))

    def changed(self, **changes: Any) -> Self:
        """See `PassingLoad`; influences of tractions are shared with a wheel of this elasticity.

        The motions of a wheel are shared with the same wheel.
        """
        other = replace(self, **changes)
        same = other.grid is self.grid and other.compliance is self.compliance
        if same and other.wheel.elasticity == self.wheel.elasticity:
            vars(other)["_influence"] = self._influence
            if other.wheel is self.wheel:
                vars(other)["_rolling"] = self._rolling
        return other

    @cached_property
    def _lines(self) -> BoundLines:
        """Friction bound of every point; see `pressure_lines`."""
        return pressure_lines(self.friction, 1, self.strength)

    @cached_property
    def _influence(self) -> Influence:
        """Slip and gap by tractions."""
        with one_thread():
            found = Influence(self._kernel(_apart(self.grid, self.compliance, self.wheel)))
        if not found.own()[:, NORMAL, NORMAL].min() > 0:
            raise ModelError("compliance", 0.0, "surface and wheel must not both be rigid")
        return found

    @cached_property
    def _axes(self) -> Array:
        return self.grid.axes

    @cached_property
    def _rolling(self) -> tuple[Array, Array]:
        """Slip and gap at rest, and by the rigid motions; see `ProfiledWheel.rolling`."""
        return self.wheel.rolling(self.grid)

    @property
    def _given(self) -> Array:
        """Height and prescribed motions (4,); some of them are free."""
        load = self.load
        return np.array([0.0, load.creepage, load.lateral_creepage, load.spin])

    def solve(self, u: Array, start: PatchStart | None = None) -> PatchContact:
        """See `PatchLoad`.

        Raises
        ------
        Spins
            if moment or lateral force exceed the friction of the whole contact
        WindowTooSmall
            if the contact reaches the outermost stations or vertices
        NoContact
            if no tractions are found
        """
        with one_thread():
            found = self._solve(u, start)
        status = found.status
        _check_rim(status)

        def near(other: Array) -> PatchStart:
            values, free = found.along(self._offset(other - u))
            return PatchStart(
                self._global(found.values + values), *self._moved(found.rigid + free)[:3]
            )

        height, creepage, lateral, spin = self._moved(found.rigid)
        return PatchContact(
            grid=self.grid,
            traction=self._global(found.values),
            gap=found.effects[..., NORMAL],
            slip=found.effects[..., TANGENTS],
            status=status,
            along=lambda change: self._global(found.along(self._offset(change))[0]),
            near=near,
            height=height,
            creepage=creepage,
            lateral_creepage=lateral,
            spin=spin,
            moment=float(np.tensordot(self._sums[1], found.values, 3)),
            steps=found.steps,
        )

    def _moved(self, free: Array) -> list[float]:
        """Return height, creepages and spin, from the rigid motions (k,) that are free."""
        rigid = self._given.copy()
        rigid[self._free] = free
        return rigid.tolist()

    def _solve(self, u: Array, start: PatchStart | None) -> ConeSolution:
        """Solve the frictional problem of a surface with these displacements (n, m, 3)."""
        problem = self._problem(u)
        if start is not None:
            try:
                return solve_cone(problem, *self._known(start), self.settled)
            except NoContact:  # the contact may be elsewhere
                pass
        smooth = self._smooth(problem)
        try:
            rigid = self._rolling_freely(problem, smooth)
            found = solve_cone(problem, smooth.values, rigid, self.settled)
        except NoContact:
            _check_rim(smooth.status)
            self._check_sliding(u)
            raise
        found.steps += smooth.steps
        return found

    @staticmethod
    def _kernel(apart: Array) -> Array:
        """Return slip and gap (w_x, g, w_s) by tractions, from displacements by tractions."""
        kernel = apart.copy()
        for axis in TANGENTS:
            motion = apart[:, :, axis]
            kernel[:, :, axis] = sum(
                weight * np.roll(motion, back, axis=0) for back, weight in enumerate(UPSTREAM)
            )
        return kernel

    @property
    def _free(self) -> list[int]:
        """Numbers of the rigid motions whose resultant is given: height and creepages."""
        given = (self.load.force, self.load.drive, self.load.lateral_force)
        return [number for number, value in enumerate(given) if value is not None]

    @cached_property
    def _sums(self) -> Array:
        """Weights (3, n, m, 3) of (q_x, p, q_s) in the forces along height and creepages."""
        rest, motions = self._rolling
        sin, cos = np.sin(self.grid.angle), np.cos(self.grid.angle)
        sums = np.zeros((3, *rest.shape))
        sums[0, ..., 1], sums[0, ..., 2] = cos, -sin
        sums[1] = -motions[1] / self.grid.spacing
        sums[2, ..., 1], sums[2, ..., 2] = sin, cos
        return sums * self.grid.area[:, None]

    def _offset(self, u: Array) -> Array:
        """Return slip and gap (n, m, 3) from displacements (n, m, 3) of the surface."""
        local = np.einsum("jab,cjb->cja", self._axes, u)
        moved = np.zeros_like(local)
        tangential = local[..., TANGENTS]
        before = 2 * tangential[:1] - tangential[1:2]  # one station upstream of the grid
        path = np.concatenate([before, tangential])
        moved[1:, :, TANGENTS] = sum(
            weight * path[2 - back : len(path) - back] for back, weight in enumerate(UPSTREAM)
        )
        moved[..., NORMAL] = -local[..., NORMAL]
        return moved

    def _global(self, values: Array) -> Array:
        """Return tractions (n, m, 3) in x, y, z from (q_x, p, q_s)."""
        return np.asarray(np.einsum("jab,cja->cjb", self._axes, values * _MIRROR))

    def _problem(self, u: Array) -> ConeProblem:
        """Return the frictional problem of a surface with these displacements (n, m, 3)."""
        free, load, (rest, motions) = self._free, self.load, self._rolling
        resultants = np.array([load.force, load.drive or 0.0, load.lateral_force or 0.0])
        given = self._given.copy()
        given[free] = 0.0
        return ConeProblem(
            influence=self._influence,
            offset=rest + self._offset(u) + np.tensordot(given, motions, 1),
            lines=self._lines,
            motions=motions[free],
            weights=self._sums[free],
            resultants=resultants[free],
        )

    def _known(self, start: PatchStart) -> tuple[Array, Array]:
        """Return values (n, m, 3) and free rigid motions of a contact."""
        values = np.einsum("jab,cjb->cja", self._axes, start.traction) * _MIRROR
        motions = (start.height, start.creepage, start.lateral_creepage)
        return values, np.array(motions)[self._free]

    def _smooth(self, problem: ConeProblem) -> ConeSolution:
        """Return the contact without friction; the undeformed bodies give the first points."""
        smooth = replace(
            problem, lines=BoundLines.none(1), motions=problem.motions[:1],
            weights=problem.weights[:1], resultants=problem.resultants[:1],
        )  # fmt: skip
        height = np.array([-self._expected_edge(problem)])
        return solve_cone(smooth, np.zeros_like(problem.offset), height)

    @staticmethod
    def _rolling_freely(problem: ConeProblem, smooth: ConeSolution) -> Array:
        """Return rigid motions (k,): free creepages make slip least, weighted with the pressure."""
        share = np.sqrt(np.maximum(smooth.values[..., NORMAL, None], 0.0))
        slip = (share * smooth.effects[..., TANGENTS]).ravel()
        motions = (share * problem.motions[1:][..., TANGENTS]).reshape(-1, slip.size)
        return np.append(smooth.rigid, np.linalg.lstsq(motions.T, -slip)[0])

    def _expected_edge(self, problem: ConeProblem) -> float:
        """Return the gap of undeformed bodies at the edge of the contact, roughly [mm].

        It is a share of the approach by a uniform pressure on the same area.
        """
        gap = (problem.offset[..., NORMAL] / problem.motions[0, ..., NORMAL]).ravel()
        nearest = np.argsort(gap)
        each = self.grid.area
        area = np.cumsum(np.broadcast_to(each, problem.offset.shape[:2]).ravel()[nearest])
        own = problem.influence.own()[:, NORMAL, NORMAL].mean()
        approach = own * self.load.force / np.sqrt(area * each.mean())
        inside = gap[nearest] - gap[nearest[0]] <= _PRESSED * approach
        return float(gap[nearest[np.flatnonzero(inside)[-1]]])

    def _check_sliding(self, u: Array) -> None:
        """Raise `Spins` if full slip carries less than moment and lateral force.

        Full slip may carry less than friction times load: spin turns shear, and shear on a slope
        carries a part of the load.
        """
        load = self.load
        if load.drive is None and load.lateral_force is None:
            return
        smooth = np.tensordot(self._sums[1:], self._smooth(self._problem(u)).values, 3)
        given = np.array([value is not None for value in (load.drive, load.lateral_force)])
        forces = np.array([load.drive or 0.0, load.lateral_force or 0.0])
        wanted = np.where(given, forces - smooth, 0.0)
        size = float(np.hypot(*wanted))
        if not size:
            return
        along, across = FULL_SLIP * wanted / size
        slides = replace(
            load, drive=None, lateral_force=None, creepage=load.creepage + float(along),
            lateral_creepage=load.lateral_creepage + float(across),
        )  # fmt: skip
        try:
            found = self.changed(load=slides)._solve(u, None)
        except NoContact:
            return
        forces = np.tensordot(self._sums[1:], found.values, 3) - smooth
        carried = float(forces @ wanted) / size**2
        if carried >= 1:
            return
        if load.lateral_force is not None:
            lateral = float(np.tensordot(self._sums[2], found.values, 3))
            wanted_force = load.lateral_force
            shown = f"{wanted_force:.0f}" if abs(wanted_force) >= 1 else f"{wanted_force:.2g}"
            much = f"with all of its contact slipping the lateral force is {lateral:.0f} N"
            much += f", not {shown}: give one that a wheel at this position can have"
            raise Spins(f"the wheel slides off: {much}", carried, 1.0)
        raise spinning(carried)


def _check_rim(status: Ints) -> None:
    """Raise `WindowTooSmall` if an outermost station or vertex (n, m) is closed."""
    rim = [status[0], status[-1], status[:, 0], status[:, -1]]
    if any((part != OPEN).any() for part in rim):
        raise WindowTooSmall("the contact reaches the outermost stations or vertices")


def _apart(grid: PatchGrid, compliance: Array, wheel: ProfiledWheel) -> Array:
    """Return the motion of the surface over the wheel, and the gap, by (q_x, p, q_s) of each point.

    The wheel has the same tractions; axes are those of `Influence`.
    """
    n, m = grid.stations, len(grid.z)
    distances = np.fft.ifftshift(np.arange(-n, n)) % len(compliance)
    turned = grid.axes @ compliance[distances].reshape(2 * n, m, 3, 3 * m)
    surface = turned.reshape(-1, m, 3).swapaxes(0, 1) @ grid.axes.transpose(0, 2, 1)
    mirrored = half_space(grid.hats.s, grid.spacing, n, wheel.elasticity)
    local = surface.swapaxes(0, 1).reshape(mirrored.shape)
    return np.asarray(local * _MIRROR[:, None, None] * _MIRROR + mirrored)
