"""The prism of a steady pass as results see a body, at x = 0.

The body is the whole section, in x, y and z. Without load fields are known in the whole section,
under the load in the zone that may yield; elsewhere they are NaN.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.sparse import csr_array
from skfem import CellBasis

from solver.contact.state import BodyState
from solver.fem.fields import Sampler, recovery, sampler
from solver.materials.law import Law
from solver.materials.state import PlasticState
from solver.model.body import Body
from solver.results.acting import Acting
from solver.results.fields import StressCycle
from solver.results.mesh_fields import MeshFields, counterclockwise
from solver.rolling.load import LOADED, RELEASED
from solver.rolling.passing import Pass
from solver.rolling.rail.flow import PrismState
from solver.rolling.rail.patch_contact import PatchContact
from solver.rolling.rail.track import PrismTrack
from solver.rolling.results.stage import PassStage, SteadyBody
from solver.tensors import not_below_zero, to_tensor, von_mises
from solver.typing import Array, Ints


@dataclass(frozen=True, slots=True, kw_only=True)
class SectionInSpace:
    """A section as results see a body, in x, y and z at x = 0.

    Attributes
    ----------
    X : (3, n_nodes) positions of the nodes [mm]
    points : (3, n_points) positions of the points [mm]
    body : the body, with its name and its law
    basis, weights, boundary_nodes : those of the nodes in the plane (z, y), see `Nodes`
    """

    X: Array
    points: Array
    body: Body
    basis: CellBasis
    weights: Array
    boundary_nodes: Callable[[str], Ints]


class PrismBody(SteadyBody):
    """The section of a prism as results see a body, at x = 0 in x, y and z.

    Parameters
    ----------
    track : the prism
    law : its material
    name : name of the body
    """

    def __init__(self, track: PrismTrack, law: Law, name: str) -> None:
        self.track, self._law = track, law
        plane = track.section.plane
        part = SectionInSpace(
            X=in_space(plane.X), points=in_space(plane.positions),
            body=Body(name=name, mesh=plane.body.mesh, material=law), basis=plane.basis,
            weights=plane.weights, boundary_nodes=plane.boundary_nodes,
        )  # fmt: skip
        super().__init__(part, len(track.section.free))
        self._recovery = recovery(plane)

    def sampler(self, name: str, X: Array) -> Sampler:
        """Return the interpolation of nodal fields at positions (3, n) [mm]; x has no effect."""
        return sampler(self.track.section.plane, X[[2, 1]])

    def recovery(self, name: str) -> csr_array:
        """Return the matrix (n_nodes, n_points) from values at points to nodes."""
        return self._recovery

    def positions(self, name: str) -> Array:
        """Return positions (3, n) of the points [mm]."""
        return np.asarray(self.part.points)

    def under_load(self, found: Pass[PrismState]) -> PassStage:
        """Return the state under the load of a pass; NaN outside the zone."""
        track, before, middle = self.track, found.before, self.track.before
        applied: Any = found.loading
        inside = found.states.unpacked(found.states.packed[..., middle])
        strain = before.strain + found.strain[:, middle]
        u = np.full(track.section.n, np.nan)
        u[track.modes.unknowns] = track.beneath(applied.u)
        u[track.modes.unknowns] += track.left_by(before.plastic_strain)[track.modes.unknowns]
        whole = np.full((track.section.weights.size, 6), np.nan)
        whole[track.modes.points] = strain
        state = self._state(LOADED, u, whole, inside)
        lowest = self._along(found)[0].min(axis=(1, 2))
        return PassStage(state, applied.contact, lowest, found)

    def _along(self, found: Pass[PrismState]) -> tuple[Array, Array]:
        """Return stress and strain along the rows of a pass (6, n_rows, n_columns)."""
        strain = found.before.strain[:, None] + found.strain
        stress = np.einsum("ab,pcb->apc", self._law.stiffness(6), strain - found.plastic_strain)
        initial = self.track.initial_strain[self.track.modes.points, None]
        return to_tensor(stress), to_tensor(np.moveaxis(strain - initial, -1, 0))

    def cycle(self, loaded: PassStage) -> StressCycle:
        """Return what a pass does along the rows of the zone; NaN at other points."""
        found, points = loaded.found, self.track.modes.points
        stress, strain = (np.moveaxis(each, 0, 2) for each in self._along(found))
        added = found.after.plastic_strain - found.before.plastic_strain
        grown = found.after.accumulated - found.before.accumulated
        n = self.track.section.weights.size
        each = stress, strain, grown, np.sqrt(2 / 3 * (added**2).sum(axis=1))
        whole = [np.full((n, *values.shape[1:]), np.nan) for values in each]
        for values, own in zip(whole, each, strict=True):
            values[points] = own
        stress, strain, grown, net = whole
        return StressCycle(stress, strain, grown, net, np.arange(n))

    def left_by(self, found: Pass[PrismState]) -> PassStage:
        """Return the state after a pass, in the whole section."""
        track, after = self.track, found.after
        u = track.left_by(after.plastic_strain)
        strain = track.initial_strain + track.straight.strain(u)
        return PassStage(self._state(RELEASED, u, strain, after.state))

    def _state(self, time: float, u: Array, strain: Array, inside: PlasticState) -> BodyState:
        """Return a state with these displacements, strains and, in the zone, internal variables."""
        n, points = len(strain), self.track.modes.points
        whole = self._law.initial(n, 6)
        packed = whole.packed.copy()
        packed[..., points] = inside.packed
        plastic = whole.unpacked(packed)
        stress = self._law.stiffness(6) @ (strain.T - plastic.plastic_strain)
        found = self.state_of(time, u, stress, plastic)
        return replace(found, strain=found.strain - self.track.initial_strain.T)


def in_space(plane: Array) -> Array:
    """Return positions (3, n) in x, y and z, at x = 0, of positions (z, y) (2, n)."""
    z, y = plane
    return np.stack([np.zeros_like(z), y, z])


def of_patch(at: PassStage) -> Acting:
    """Return half the width across the track, peak and force of a patch; none along a line."""
    contact: PatchContact | None = at.touching
    if contact is None:
        return Acting()
    z = contact.grid.z[(contact.status != 0).any(axis=0)]
    peak = float(contact.pressure.max())
    return Acting(half_width=float(np.ptp(z)) / 2, peak=peak, force=float(contact.force[0]))


_CORNERS = 4
_ELEMENT = "hexahedron20"


def zone_fields(body: PrismBody, loaded: str, left: str, found: Pass[PrismState]) -> MeshFields:
    """Return stress and plastic strain at nodes of the zone, around the load and behind the pass.

    The 8-node quadrilaterals of the section are extruded over the stations of the window to
    hexahedra of 20 nodes: two distances of stations long, with corners and mid-sides at every other
    station, and mid-sides along x at those in between. Under the load displacements are not known
    everywhere: NaN.

    Parameters
    ----------
    loaded, left : names of the two stages
    """
    track, name = body.track, f"{body.names[0]} around the load"
    modes, plane = track.modes, track.section.plane
    n_points = track.section.weights.shape[1]
    elements = modes.points[::n_points] // n_points
    cells = counterclockwise(plane.basis.element_dofs.T[elements], plane.X)
    nodes, flat = np.unique(cells, return_inverse=True)
    cells = flat.reshape(cells.shape)
    corners = np.unique(cells[:, :_CORNERS])
    place = np.searchsorted(corners, cells[:, :_CORNERS])
    window = len(modes.x)
    main, between = np.arange(0, window, 2), np.arange(1, window - 1, 2)
    count, first = len(nodes), len(main) * len(nodes)

    layers = []
    for k in range(len(between)):
        near, far = (np.split(cells + at * count, [_CORNERS], axis=1) for at in (k, k + 1))
        sides = first + k * len(corners) + place
        layers.append(np.hstack([near[0], far[0], near[1], far[1], sides]))

    share = body.recovery(name)[nodes][:, modes.points]  # of the elements in the zone alone
    share = share.multiply(1 / share.sum(axis=1)[:, None]).tocsr()

    def at_nodes(values: Array) -> Array:
        """Return values (..., n) at the nodes of those at the points (..., n_points, stations)."""
        flat = np.moveaxis(values, -2, 0)
        each = (share @ flat.reshape(len(flat), -1)).reshape(count, *flat.shape[1:])
        each = np.moveaxis(each, 0, -1)  # (..., stations, nodes)
        both = each[..., main, :], each[..., between, :][..., corners]
        return np.concatenate([own.reshape(*own.shape[:-2], -1) for own in both], axis=-1)

    initial = track.initial_strain[modes.points, None]

    def stage(elastic: Array, plastic: Array, accumulated: Array, u: Array) -> Mapping[str, Array]:
        strain = np.moveaxis(elastic + plastic - initial, -1, 0)
        stress = np.einsum("ab,pcb->apc", found.law.stiffness(6), elastic)
        return {
            "displacement": u,
            "stress": to_tensor(at_nodes(stress)),
            "mises": not_below_zero(at_nodes(von_mises(stress))),
            "plastic_strain": not_below_zero(at_nodes(accumulated)),
            "plastic_tensor": to_tensor(at_nodes(np.moveaxis(plastic, -1, 0))),
            "strain": to_tensor(at_nodes(strain)),
        }

    x = track.before * (modes.length / modes.stations) + modes.x
    z, y = plane.X[:, nodes]
    X = np.hstack([
        np.stack([each.ravel() for each in np.broadcast_arrays(at[:, None], own[1], own[0])])
        for at, own in ((x[main], (z, y)), (x[between], (z[corners], y[corners])))
    ])  # fmt: skip
    before, after = found.before, found.after
    moved = track.left_by(after.plastic_strain).reshape(-1, 3)[nodes].T
    still = np.hstack([np.tile(moved, len(main)), np.tile(moved[:, corners], len(between))])

    def along(values: Array) -> Array:
        return np.repeat(values[:, None], window, axis=1)

    under = before.strain[:, None] + found.strain - found.plastic_strain
    behind, remains = along(after.strain - after.plastic_strain), along(after.plastic_strain)
    nothing = np.full_like(still, np.nan)
    stages = {
        loaded: stage(under, found.plastic_strain, found.accumulated, nothing),
        left: stage(behind, remains, along(after.accumulated), still),
    }
    return MeshFields(X=X, bodies={name: (_ELEMENT, np.vstack(layers))}, stages=stages)
