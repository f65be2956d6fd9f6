"""Fields of a system, sampled at the positions of a view."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.fem.fields import Sampler, recovery
from solver.tensors import to_tensor, von_mises

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray
    from scipy.sparse import csr_array

    from solver.contact.state import Converged
    from solver.contact.system import System
    from solver.results.view import View

    Array = NDArray[np.float64]


class Nodal:
    """Fields at the nodes of a system's bodies; the recovery operators are built once."""

    def __init__(self, system: System) -> None:
        self.system = system
        self._recovery: dict[str, csr_array] = {}

    def of_points(self, body: str, points: Array) -> Array:
        """Return recovered nodal values (..., n_nodes) of point values (..., n_points)."""
        if body not in self._recovery:
            self._recovery[body] = recovery(self.system.full(body))
        return np.asarray((self._recovery[body] @ points.T).T)

    def stress(self, body: str, converged: Converged) -> Array:
        """Return recovered nodal stress (4, n_nodes), Mandel [MPa]."""
        return self.of_points(body, self.system.response(body, converged).stress)

    def plastic_strain(self, body: str, converged: Converged) -> Array:
        """Return recovered equivalent plastic strain (n_nodes,), not below zero."""
        strain = self.system.response(body, converged).state.accumulated
        return np.maximum(self.of_points(body, strain), 0.0)


class Samples(Nodal):
    """Samples one system; the interpolation is set up once for all its runs."""

    def __init__(self, system: System, view: View) -> None:
        super().__init__(system)
        self.view = view
        X, Y = np.meshgrid(view.x, view.y)
        S, D = np.meshgrid(view.station, -view.depth, indexing="ij")
        grid, lines = np.stack([X.ravel(), Y.ravel()]), np.stack([S.ravel(), D.ravel()])
        surface = np.stack([view.s, np.zeros_like(view.s)])
        wholes = {name: system.full(name) for name in view.surfaces}
        self._map = {name: Sampler(whole, grid) for name, whole in wholes.items()}
        self._lines = Sampler(system.full(view.profile_body), lines)
        self._surface = {name: Sampler(whole, surface) for name, whole in wholes.items()}

    def on_map(self, values: Callable[[str], Array]) -> Array:
        """Return nodal fields of the bodies (..., n_nodes) on the map (..., y, x)."""
        out: Array | None = None
        for body, sampler in self._map.items():
            here = sampler(values(body))
            out = here if out is None else np.where(np.isnan(out), here, out)
        assert out is not None
        return out.reshape(*out.shape[:-1], len(self.view.y), len(self.view.x))

    def on_surface(self, body: str, converged: Converged) -> Array:
        """Return surface stress (4, n_s) of a body, tensor components [MPa]."""
        return to_tensor(self._surface[body](self.stress(body, converged)))

    def profile(self, converged: Converged) -> tuple[Array, Array]:
        """Return stress (station, 4, depth) [MPa] and plastic strain (station, depth)."""
        body, shape = self.view.profile_body, (len(self.view.station), len(self.view.depth))
        stress = self._lines(self.stress(body, converged)).reshape(4, *shape)
        strain = self._lines(self.plastic_strain(body, converged)).reshape(shape)
        return to_tensor(stress).swapaxes(0, 1), strain

    def flow(self, converged: Converged) -> Array:
        """Return signed plastic strain (station, 4, depth), tensor components."""
        body, view = self.view.profile_body, self.view
        points = self.system.response(body, converged).state.plastic_strain
        strain = self._lines(self.of_points(body, points))
        return to_tensor(strain.reshape(4, len(view.station), -1)).swapaxes(0, 1)

    def displacement(self, converged: Converged) -> Array:
        """Return the displacement (2, station) of the surface [mm]."""
        u = self.system.displacement(self.view.profile_body, converged.state).reshape(-1, 2).T
        return np.asarray(self._lines(u).reshape(2, len(self.view.station), -1)[:, :, 0])

    def surface_mises(self, converged: Converged, centre: float) -> Array:
        """Return von Mises stress along s at the surface of the profile body [MPa].

        Von Mises stress is recovered from the points; that of recovered stress would go far
        beyond the strength.
        """
        name = self.view.profile_body
        body = self.system.full(name)
        nodes = body.boundary_nodes(self.view.surfaces[name])
        nodes = nodes[np.argsort(body.X[0, nodes])]
        points = von_mises(self.system.response(name, converged).stress)
        stress = np.clip(self.of_points(name, points)[nodes], 0.0, points.max())
        x, beyond = body.X[0, nodes] - centre, {"left": np.nan, "right": np.nan}
        way = {"period": body.period} if body.period else beyond
        return np.asarray(np.interp(self.view.s, x, stress, **way))
