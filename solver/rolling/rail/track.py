"""A prism over which a load passes, as `solver.rolling.passing` uses it.

Stations are numbered downstream from ``ahead`` of the load at x = 0. Only a zone of the section and
a window of stations may yield. Behind the window plastic strain goes on as at its last station and
fades to nothing where the length begins again: so the fields of the pass are periodic. The state
before the pass, constant along x, is no wave: it is the section's own problem, k = 0.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from solver.errors import ModelError
from solver.materials.elasticity import Elasticity
from solver.materials.law import Law
from solver.rolling.rail.far_field import FarField
from solver.rolling.rail.flow import PrismFlow, PrismState
from solver.rolling.rail.modes import Modes
from solver.rolling.rail.patch_grid import RunningSurface
from solver.rolling.rail.section import Section
from solver.rolling.rail.straight import SettledStress, StraightPrism, check_elastic
from solver.typing import Array, Bools


class PrismTrack:
    """The prism, its stations, and the grid where a load may act.

    Parameters
    ----------
    section : the cross-section
    zone : (n_elements,) elements that may yield
    boundary : chain of edges of the zone on which the load acts
    length : L, after which the waves repeat [mm]
    spacing : distance h of stations [mm]; L is an even number of them
    ahead, behind : the window extends from x = ahead to x = -behind [mm]
    reach : half the length of the surface where the load may act [mm]
    levels : levels of the far field; with 0 the prism repeats itself
    loads : number of equal loads on the length, at equal distances; plastic strain is that of one
    span : length of a prism that is clamped at both ends, the load in its middle [mm]; None if it
        is endless

    Attributes
    ----------
    section : the cross-section
    boundary : chain of edges on which a load may act
    before : number of the station at x = 0, where a load is
    weights : (n_points, window) volume of the points [mm3]
    grid : stations and vertices where the load may act
    loads : number of equal loads on the length
    rim : numbers of the points beside elements outside the zone, which must not yield
    initial : initial stress, None without

    Raises
    ------
    ModelError
        for lengths that do not fit together
    """

    def __init__(
        self,
        section: Section,
        zone: Bools,
        boundary: str,
        *,
        length: float,
        spacing: float,
        ahead: float,
        behind: float,
        reach: float,
        levels: int,
        loads: int = 1,
        span: float | None = None,
    ) -> None:
        stations, before = round(length / spacing), round(ahead / spacing)
        window = before + round(behind / spacing) + 1
        if window > stations:
            raise ModelError("length", length, f"must be at least {window * spacing:g} mm")
        near = int(round(reach / spacing, 6))
        if (2 if levels else 1) * near > min(before, window - 1 - before):
            allowed = "must be at most what the window has ahead and behind, with far field half"
            raise ModelError("reach", reach, allowed)
        self.section, self.boundary, self.before = section, boundary, before
        self._near, self.loads = near, loads
        surface = RunningSurface(section, boundary)
        self.grid = surface.grid(spacing, near * spacing, 2 * near + 1)
        self.modes = Modes(
            section, zone, length, stations, window=window,
            behind=_fading(stations - window), loads=loads, surface=surface.rows(self.grid),
        )  # fmt: skip
        if span is not None and not levels:
            raise ModelError("span", span, "needs levels of far field")
        self.far = FarField(self.modes, -before * spacing, levels, span) if levels else None
        self._width = np.tile(self.grid.hats.width, 3)
        self.weights = np.repeat(spacing * self.modes.weights[:, None], window, axis=1)
        beside = np.flatnonzero(np.isin(section.dofs, section.dofs[~zone]).any(axis=1))
        self.rim = np.flatnonzero(np.isin(self.modes.points // section.weights.shape[1], beside))
        self.initial: SettledStress | None = None

    @property
    def elasticity(self) -> Elasticity:
        """Elastic constants."""
        return self.section.elasticity

    @property
    def points(self) -> Array:
        """Positions (2, n_points) of the rows of points in the section: z, y [mm]."""
        return self.section.points.reshape(2, -1)[:, self.modes.points]

    def stressed(self, initial: SettledStress) -> PrismTrack:
        """Return the same prism, its set-up shared, with an initial stress.

        Displacements count from the section with this stress.
        """
        _ = self.compliance  # computed once for both
        other = copy(self)
        other.initial = initial
        return other

    @property
    def initial_strain(self) -> Array:
        """Elastic strain (n, 6) of the initial stress at all points of the section, Mandel."""
        none = np.zeros((self.section.weights.size, 6))
        return none if self.initial is None else self.initial.strain

    def virgin(self, law: Law) -> PrismState:
        """Return the state before any load.

        Raises
        ------
        ModelError
            for an initial stress that is beyond the yield stress in the zone
        """
        virgin = self._virgin(law)
        check_elastic(law, virgin.strain, self.points)
        return virgin

    def _virgin(self, law: Law) -> PrismState:
        """Return the state before any load, which may be beyond the yield stress."""
        strain = self.initial_strain[self.modes.points]
        state = law.initial(len(self.weights), 6)
        return PrismState(state, strain, np.zeros((len(self.grid.z), 3)))

    # -- what a pass asks for ------------------------------------------------------------------

    @property
    def at_rest(self) -> PrismField:
        """The prism without eigenstress and load; not cached, since it refers to its prism."""
        return PrismField(self)

    def flow(self, law: Law, before: PrismState, added: Array, parts: int) -> PrismFlow:
        """Return the flow of a material along the rows of points."""
        return PrismFlow(
            self.modes, self.rim, law, partial(self._virgin, law), before, added, parts
        )

    @cached_property
    def rough(self) -> PrismTrack:
        """The same prism, in single precision."""
        other = copy(self)
        other.modes = self.modes.single
        return other

    def solve(self, eigenstress: Array) -> PrismField:
        """Return the field of an eigenstress (n_points, window, 6), Mandel [MPa]."""
        eigenstress = eigenstress.astype(self.modes.precision, copy=False)
        return PrismField(self, eigenstress if eigenstress.any() else None)

    def strain(self, field: PrismField) -> Array:
        """Return the strain (n_points, window, 6) of a field, Mandel."""
        if field.eigenstress is None and field.traction is None:
            return np.zeros((*self.weights.shape, 6))
        strain = self.modes.strain(field.amplitudes)
        if self.far is not None and field.traction is not None:
            far = self.far.strain.reshape(-1, 4) @ field.resultants
            strain += far.reshape(strain.shape)
        return strain

    def beneath(self, field: PrismField) -> Array:
        """Return the displacement (m,) of the zone's unknowns by a field, at x = 0 [mm]."""
        moved = self.modes.at_station(self.before, field.amplitudes)
        if self.far is not None and field.traction is not None:
            moved += self.far.beneath @ field.resultants
        return moved

    @cached_property
    def straight(self) -> StraightPrism:
        """The prism without load, constant along x."""
        return StraightPrism(self.section)

    def left_by(self, plastic_strain: Array) -> Array:
        """Return the displacement (section.n,) that plastic strain leaves without load [mm].

        Parameters
        ----------
        plastic_strain : (n_points, 6) in the zone, constant along x, Mandel
        """
        at = np.zeros((self.section.weights.size, 6))
        at[self.modes.points] = (2 * self.elasticity.shear_modulus) * plastic_strain
        return self.straight.displacement(at)

    # -- the surface ---------------------------------------------------------------------------

    @property
    def near(self) -> slice:
        """The stations of the window at which the load may act."""
        return slice(self.before - self._near, self.before + self._near + 1)

    def on_grid(self, moved: Array) -> Array:
        """Return the displacement (n, m, 3) of the grid from that of the rows (n_rows, window)."""
        return moved[:, self.near].reshape(3, len(self.grid.z), -1).transpose(2, 1, 0)

    def on_rows(self, traction: Array) -> Array:
        """Return the forces (n_rows, window) of tractions (n, m, 3), per length [N/mm]."""
        shape = len(self._width), self.weights.shape[1]
        forces = np.zeros(shape, self.modes.precision)
        each = traction.transpose(2, 1, 0).reshape(len(forces), -1)
        forces[:, self.near] = self._width[:, None] * each
        return forces

    @cached_property
    def compliance(self) -> Array:
        """Displacements by tractions, as `solver.rolling.rail.patch.RollingPatch` takes them."""
        kernel = self.modes.kernel * self._width[:, None]
        if self.far is not None:
            unit = np.zeros((len(self._width), len(self._width), 1))
            unit[np.arange(len(unit)), np.arange(len(unit)), 0] = self._width
            resultants = np.stack([self.far.resultants(each) for each in unit])
            for apart in range(-2 * self._near, 2 * self._near + 1):
                moved = self.far.displacement[:, self.before + apart] @ resultants.T
                kernel[:, :, apart] += moved
        m = len(self.grid.z)
        return np.ascontiguousarray(kernel.reshape(3, m, 3, m, -1).transpose(4, 1, 0, 3, 2))


@dataclass(frozen=True, eq=False)
class PrismField:
    """The field of eigenstress and tractions in a prism; solved when it is used.

    Attributes
    ----------
    eigenstress : (n_points, window, 6) Mandel [MPa], None where there is none
    traction : (n, m, 3) tractions on the grid [MPa], None where there are none
    """

    prism: PrismTrack
    eigenstress: Array | None = None
    traction: Array | None = None

    @cached_property
    def nodal(self) -> Array:
        """Nodal forces of the eigenstress, as of `Modes.nodal` [N/mm]."""
        modes = self.prism.modes
        if self.eigenstress is None:
            return np.zeros((len(modes.wavenumbers), 2, len(modes.unknowns)))
        return modes.nodal(self.eigenstress)

    @cached_property
    def forces(self) -> Array:
        """Forces (n_rows, window) of the tractions, as of `PrismTrack.on_rows` [N/mm]."""
        assert self.traction is not None
        return self.prism.on_rows(self.traction)

    @cached_property
    def amplitudes(self) -> Array:
        """Amplitudes (waves, 2, m) of the zone, as of `Modes.solved` [mm]."""
        modes = self.prism.modes
        if self.traction is None:
            return modes.solved(self.nodal)
        if self.eigenstress is None:
            return modes.moved_by(self.forces)
        return modes.solved(self.nodal + modes.pushed(self.forces))

    @property
    def resultants(self) -> Array:
        """Resultants (4,) of the tractions, as of `FarField.resultants`."""
        assert self.prism.far is not None
        return self.prism.far.resultants(self.forces)

    @cached_property
    def displacement(self) -> Array:
        """Displacement (n, m, 3) of the grid by the eigenstress alone [mm]."""
        if self.eigenstress is None:
            return np.zeros((self.prism.grid.stations, len(self.prism.grid.z), 3))
        return self.prism.on_grid(self.prism.modes.displacement(self.nodal))

    def loaded(self, traction: Array) -> PrismField:
        """Return the field with tractions; fields of the eigenstress are not computed again."""
        other = replace(self, traction=traction)
        for name in {"nodal", "displacement"} & vars(self).keys():
            vars(other)[name] = vars(self)[name]
        return other


def _fading(count: int) -> Array:
    """Return the factors (count,) of plastic strain behind the window: from 1 down to 0."""
    t = np.arange(1, count + 1) / (count + 1)
    return np.asarray(1 - t**3 * (10 - 15 * t + 6 * t**2))
