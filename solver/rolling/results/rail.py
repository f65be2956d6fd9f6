"""Adapter of a steady pass over a prism to samples and outputs: states of one body at x = 0.

The body is the whole section, in x, y and z. Without load its fields are those of the section. At
the load they are known in the zone that may yield; elsewhere they are NaN.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from solver.contact.state import State
from solver.fem.fields import Sampler, recovery
from solver.materials.law import Law
from solver.materials.state import PlasticState, Response
from solver.memory import kept
from solver.model.body import Body
from solver.rolling.passing import Pass
from solver.rolling.rail.patch_contact import PatchContact
from solver.rolling.rail.section import Section
from solver.rolling.rail.state import PrismState
from solver.rolling.rail.track import PrismTrack
from solver.tensors import to_tensor
from solver.typing import Array

_LOADED, _RELEASED = 0.0, 1.0


@dataclass(frozen=True, slots=True)
class PrismStage:
    """A state of the section at x = 0.

    Attributes
    ----------
    state : displacements; its time is 0 under the load and 1 after it
    response : stress and internal variables at the points of the section
    touching : the contact, None after it
    lowest : (6,) smallest stress components at any station of the window, None after it [MPa]
    """

    state: State
    response: Response
    touching: PatchContact | None = None
    lowest: Array | None = None


class PrismBody:
    """The section of a prism as results see a body, at x = 0 in x, y and z.

    Parameters
    ----------
    track : the prism
    law : its material
    name : name of the body
    """

    def __init__(self, track: PrismTrack, law: Law, name: str) -> None:
        self.track, self._law = track, law
        self.names = (name,)
        plane = track.section.plane
        self._part = SimpleNamespace(
            X=in_space(plane.X), basis=plane.basis,
            weights=track.section.weights, points=in_space(plane.points.reshape(2, -1)),
            body=Body(name=name, mesh=plane.body.mesh, material=law),
            boundary_nodes=plane.boundary_nodes,
        )  # fmt: skip
        self._recovery = recovery(self._part)  # type: ignore[arg-type]

    @property
    def n_unknowns(self) -> int:
        """Number of displacement unknowns of the section."""
        return len(self.track.section.free)

    def full(self, name: str) -> Any:
        """Return the body: ``X`` (3, n_nodes), ``basis`` in the plane (z, y), ``body``."""
        del name
        return self._part

    def sampler(self, name: str, X: Array) -> Sampler:
        """Return the interpolation of nodal fields at positions (3, n) [mm]; x has no effect."""
        del name
        return _sampler(self.track.section, np.ascontiguousarray(X[[2, 1]]).tobytes())

    def recovery(self, name: str) -> csr_array:
        """Return the matrix (n_nodes, n_points) from values at points to nodes."""
        del name
        return self._recovery

    def positions(self, name: str) -> Array:
        """Return positions (3, n) of the points [mm]."""
        del name
        return np.asarray(self._part.points)

    def response(self, name: str, converged: PrismStage) -> Response:
        """Return stress and internal variables at the points."""
        del name
        return converged.response

    def strain(self, name: str, converged: PrismStage) -> Array:
        """Return the strain (6, n, Mandel) at the points, without that of an initial stress."""
        del name
        found = converged.response
        strain = self._law.elastic_strain(found.stress) + found.state.plastic_strain
        return strain - self.track.initial_strain.T

    def displacement(self, name: str, state: State) -> Array:
        """Return the displacements (n,) [mm]."""
        del name
        return state.u[0]

    def axle(self, converged: PrismStage) -> None:
        """Return None: the wheel has no mesh."""
        del converged

    def under_load(self, found: Pass[PrismState]) -> PrismStage:
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
        stage = self._stage(_LOADED, u, whole, inside)
        elastic = before.strain[:, None] + found.strain - found.plastic_strain
        stress = np.einsum("ab,pcb->apc", self._law.stiffness(6), elastic)
        lowest = to_tensor(stress.reshape(6, -1)).min(axis=1)
        return replace(stage, touching=applied.contact, lowest=lowest)

    def left_by(self, found: Pass[PrismState]) -> PrismStage:
        """Return the state after a pass, in the whole section."""
        track, after = self.track, found.after
        u = track.left_by(after.plastic_strain)
        strain = track.initial_strain + track.straight.strain(u)
        return self._stage(_RELEASED, u, strain, after.state)

    def _stage(self, time: float, u: Array, strain: Array, inside: PlasticState) -> PrismStage:
        """Return a state with these displacements, strains and, in the zone, internal variables."""
        n, points = len(strain), self.track.modes.points
        whole = self._law.initial(n, 6)
        packed = whole.packed.copy()
        packed[..., points] = inside.packed
        plastic = whole.unpacked(packed)
        stress = self._law.stiffness(6) @ (strain.T - plastic.plastic_strain)
        nothing = np.zeros((6, 6, 0)), np.zeros(0, dtype=bool)
        response = Response(stress, nothing[0], plastic, nothing[1])
        return PrismStage(State(time, (u,), (plastic,), ()), response)


@kept
def _sampler(section: Section, positions: bytes) -> Sampler:
    """Return the interpolation at positions (2, n) in a section; runs over a prism share it."""
    x = np.frombuffer(positions).reshape(2, -1)
    return Sampler(section.plane, x)  # type: ignore[arg-type]


def in_space(plane: Array) -> Array:
    """Return positions (3, n) in x, y and z, at x = 0, of positions (z, y) (2, n)."""
    z, y = plane
    return np.stack([np.zeros_like(z), y, z])


class PatchTractions:
    """Resultants of a contact in a patch; see `solver.results.tractions.SurfaceTractions`.

    The contact is a surface, so that there is no pressure along a line.
    """

    def along(self, converged: PrismStage, x: Array) -> tuple[Array, Array, Array]:
        """See `SurfaceTractions`: NaN."""
        del converged
        nowhere = np.full_like(x, np.nan)
        return nowhere, nowhere, nowhere

    def extent(self, converged: PrismStage) -> tuple[float, float]:
        """See `SurfaceTractions`: half the width across the track."""
        assert converged.touching is not None
        contact = converged.touching
        z = contact.grid.z[(contact.status != 0).any(axis=0)]
        return float(np.ptp(z)) / 2, float(contact.pressure.max())

    def force(self, converged: PrismStage) -> float:
        """See `SurfaceTractions`."""
        assert converged.touching is not None
        return float(converged.touching.force[0])

    def centre(self, converged: PrismStage) -> float:
        """See `SurfaceTractions`."""
        del converged
        return 0.0

    def points(self, converged: PrismStage) -> None:
        """See `SurfaceTractions`."""
        del converged
