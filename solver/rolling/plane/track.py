"""The half-plane over which a steady load passes, factorised once for many passes; its fields."""

from __future__ import annotations

from functools import cached_property
from typing import Self

import numpy as np
from scipy.spatial import cKDTree

from solver.contact.state import BodyState
from solver.fem.discretisation import Discretisation
from solver.fem.loads import moving_forces
from solver.fem.surface import Surface, extract
from solver.materials.elastic_plastic import Material
from solver.materials.elasticity import Elasticity
from solver.materials.law import Law
from solver.materials.state import PlasticState
from solver.memory import kept
from solver.mesh.grids import grid, within
from solver.model.amplitude import Amplitude
from solver.model.body import Body
from solver.model.loads import TravellingPressure
from solver.rolling.load import LOADED, RELEASED, Given
from solver.rolling.passing import Pass
from solver.rolling.plane.layers import Layers
from solver.rolling.plane.lines import track_lines, window_depth, window_elements
from solver.rolling.plane.rows import CondensedTrack, FlowRows, RowFlow
from solver.tensors import SQRT2
from solver.typing import Array, Ints

CONTACT = 2.0
"""Half the length of the surface that may come into contact, over the half-width."""
_BLOCKS = 8
"""Number of parts in which the compliance of the surface is computed: all displacements at once
would take as much memory as the rest of a track."""


class Track:
    """An elastic half-plane y < 0 with rows of points around a load at x = 0.

    It does not depend on the load or on the yield stress: passes of any load with the same
    half-width share it, for any friction and hardening.

    Parameters
    ----------
    half_width : half-width a of the contact [mm]
    element_size : side of the elements in the window [mm]
    growth : ratio of neighbouring element sides in depth
    elasticity : elastic constants of the half-plane
    reach : factor of the usual length and depth of the window

    Attributes
    ----------
    part : the body
    rows : the points of the window

    Raises
    ------
    ModelError
        if the elements are larger than half the half-width, or too many
    """

    def __init__(
        self,
        half_width: float,
        element_size: float,
        growth: float,
        elasticity: Elasticity,
        reach: float = 1.0,
    ) -> None:
        a, h = half_width, element_size
        ahead, behind = window_elements(a, h, reach)
        self.half_width = a
        self._lines = track_lines(a, h, growth, reach)
        self._contact = CONTACT * reach * a
        self.part = Discretisation(half_space_body(*self._lines, self._contact, elasticity))
        self._window = h * ahead, h * behind, window_depth(a, reach)
        self.rows = FlowRows(self.part, self.operator, *self._window)

    @cached_property
    def mirrored(self) -> Discretisation:
        """The half-plane seen along -x."""
        x, y = self._lines
        return Discretisation(half_space_body(-x[::-1], y, self._contact, self.elasticity))

    @cached_property
    def mirror(self) -> tuple[Ints, Ints]:
        """Numbers of the points, and of the nodes, at the mirrored places."""
        own, seen = self.part, self.mirrored
        both = ((own.points.reshape(2, -1), seen.points.reshape(2, -1)), (own.X, seen.X))
        points, nodes = (
            cKDTree(of.T).query((at * [[-1.0], [1.0]]).T)[1].astype(np.int64) for of, at in both
        )
        return points, nodes

    @property
    def elasticity(self) -> Elasticity:
        """Elastic constants."""
        return self.part.body.law.elasticity

    @cached_property
    def operator(self) -> CondensedTrack:
        """The inverse of the elastic stiffness, condensed to the m unknowns of the window."""
        x, y = self.part.X
        ahead, behind, deep = self._window
        edge = 1e-6 * deep
        inside = (x < ahead + edge) & (x > -behind - edge) & (y > -deep - edge)
        return CondensedTrack(self.part, np.flatnonzero(inside))

    def virgin(self, law: Law) -> Layers:
        """Return the state before any load."""
        return self.rows.virgin(law)

    @property
    def at_rest(self) -> Array:
        """Displacements (m,) of the window without plastic strain and load: zero [mm]."""
        return np.zeros(len(self.operator.kept))

    @property
    def weights(self) -> Array:
        """Volume of the points (n_rows, n_columns) of the window [mm3]."""
        return self.rows.weights

    @property
    def rough(self) -> Self:
        """The track itself: see `PassedBody`."""
        return self

    def solve(self, force: Array) -> Array:
        """Return displacements (m,) for the condensed forces of plastic strain (m,) [mm]."""
        return self.operator.solve(force)

    def strain(self, u: Array) -> Array:
        """Return the strains (n_rows, n_columns, 4) of displacements (m,)."""
        return self.rows.strain(u)

    def flow(self, law: Law, before: Layers, added: Array, parts: int) -> RowFlow:
        """Return the flow of a material along the rows, see `RowFlow`."""
        return RowFlow(self.rows, law, before, added, parts)

    @cached_property
    def at_surface(self) -> Ints:
        """Positions of the surface's unknowns among those of the window."""
        return self.operator.place(self.surface.dofs)

    def under(self, forces: Array) -> Array:
        """Return displacements (m,) or (m, k) for forces (n,) or (n, k) on the surface [mm]."""
        every = np.zeros((len(self.operator.kept), *forces.shape[1:]))
        every[self.at_surface] = forces
        return self.operator.solve(every)

    @cached_property
    def compliance(self) -> Array:
        """Displacements (n, n) of the surface's unknowns for forces on them [mm/N]."""
        each = np.array_split(np.eye(len(self.at_surface)), _BLOCKS, axis=1)
        return np.hstack([self.under(forces)[self.at_surface] for forces in each])

    @cached_property
    def surface(self) -> Surface:
        """The part of the top that may come into contact, as a chain of edges downstream."""
        return extract(self.part, "contact")

    def hertz(
        self, peak: float, shear_ratio: float = 0.0, half_width: float | None = None
    ) -> Given:
        """Return a Hertz pressure with proportional shear.

        Parameters
        ----------
        peak : p0 [MPa]
        shear_ratio : ratio of the shear along +x, the motion of the load, to the pressure; positive
            when braking
        half_width : half-width of the pressure [mm]; that of the track by default
        """
        pressure = standing_pressure(half_width or self.half_width, peak, shear_ratio)
        force = moving_forces(self.part, [pressure], 0.0)
        return Given(force=force, u=self.operator.solve(self.operator.condense(force)))


def standing_pressure(half_width: float, peak: float, shear_ratio: float) -> TravellingPressure:
    """Return a Hertz pressure at x = 0, with factor 1 at time 0 and factor 0 at time 1.

    Parameters
    ----------
    half_width, peak : a [mm] and p0 [MPa]
    shear_ratio : ratio of the shear along +x to the pressure
    """
    return TravellingPressure(
        boundary="top",
        half_width=half_width,
        peak=peak,
        amplitude=Amplitude(np.array([0.0, 1.0]), np.array([1.0, 0.0])),
        shear_ratio=Amplitude.constant(shear_ratio),
    )


def half_space_body(x: Array, y: Array, contact: float, elasticity: Elasticity) -> Body:
    """Return the half-plane with grid lines x, y, which may touch within ``contact`` of x = 0."""
    return Body(
        name="half_space",
        mesh=within(grid(x, y), "contact", ["top"], x=(-contact, contact)),
        material=Material(
            youngs_modulus=elasticity.youngs_modulus, poisson_ratio=elasticity.poisson_ratio
        ),
        supports={"left": "x", "right": "x", "bottom": "xy"},
    )


track_of = kept(Track)
"""(arguments of `Track`) -> the track with these dimensions, made once in a process."""


def of_layers(track: Track, law: Law, layers: Layers) -> BodyState:
    """Return the state of a half-plane that is a function of depth alone.

    Its points are followed by the places at the surface above `FlowRows.highest`.
    """
    rows, n = track.rows, track.part.weights.size
    virgin = law.initial(n + len(rows.highest), 4)
    strain, packed = np.zeros_like(virgin.plastic_strain), virgin.packed
    for every, own in ((rows.every, layers), (n + rows.above, layers.top)):
        strain[:, every] = own.strain(track.elasticity).T[:, :, None]
        packed[:, every] = own.state.packed[:, :, None]
    return _state(track, RELEASED, _sunk(track, layers), strain, virgin.unpacked(packed))


def under_load(track: Track, found: Pass[Layers]) -> BodyState:
    """Return the state under the load of a pass, which moves along +x; for points `of_layers`."""
    rows, before, after = track.rows, of_layers(track, found.law, found.before), found.after
    n, columns, grown = track.part.weights.size, rows.shape[1], after.plastic_strain
    grown = grown - found.before.plastic_strain
    u = track.operator.expand(found.loading.u, rows.force_behind(grown))
    added, strain, packed = track.part.strain(u), before.strain.copy(), before.plastic.packed
    strain[:, :n] += added
    uppermost = np.moveaxis(added[:, rows.every[: 2 * rows.uppermost]], 0, 2)
    strain[:, n + rows.above] += np.moveaxis(rows.onto_surface(uppermost), 2, 0)
    # before the window as before the pass, in the window as it flows, behind it as after the pass
    each = (rows.every, found.states, after), (n + rows.above, found.surface, after.top)
    for every, flow, own in each:
        packed[:, every[:, :columns]] = flow.packed
        packed[:, every[:, columns + rows.ahead.shape[1] :]] = own.state.packed[:, :, None]
    return _state(track, LOADED, before.u + u, strain, before.plastic.unpacked(packed))


def _state(track: Track, time: float, u: Array, strain: Array, plastic: PlasticState) -> BodyState:
    stress = track.part.body.law.stiffness(4) @ (strain - plastic.plastic_strain)
    return BodyState(time, u, stress, strain, plastic)


def _sunk(track: Track, layers: Layers) -> Array:
    """Return the nodal displacements (n,) of a layered state, relative to depth [mm]."""
    strain = layers.strain(track.elasticity)
    edges = np.append(0.0, np.cumsum(layers.thickness))
    u = np.zeros_like(track.part.X)
    for axis, rate in enumerate((SQRT2 * strain[:, 3], strain[:, 1])):
        below = np.append(0.0, np.cumsum((rate * layers.thickness)[::-1]))[::-1]
        u[axis] = np.interp(-track.part.X[1], edges, below)
    return np.asarray(u.T.ravel())
