"""Fields of bodies, sampled at the positions of a view."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from solver.errors import ModelError
from solver.results.fields import Bodies, Solved, SystemFields, interpolated
from solver.results.view import View
from solver.tensors import to_tensor
from solver.typing import Array


class Samples:
    """Samples a system at the positions of a view; the interpolation serves all its runs.

    Raises
    ------
    ModelError
        if no point of the map is inside a body
    """

    def __init__(self, system: Bodies, view: View) -> None:
        self.system, self.view = system, view
        self.fields = SystemFields(system)
        X, Y = np.meshgrid(*view.map_grid)
        grid = view.axis.place(X.ravel(), -Y.ravel())
        surface = view.axis.place(view.s, np.zeros_like(view.s))
        self._map = {name: system.sampler(name, grid) for name in view.surfaces}
        if X.size and not any(sampler.inside.any() for sampler in self._map.values()):
            across, up = view.map_axes
            raise ModelError(
                "map", _extent(view),
                f"must meet a body, from {across} to {across} and from {up} to {up} [mm]",
            )  # fmt: skip
        self._lines = system.sampler(view.profile_body, view.profiles)
        self._surface = {name: system.sampler(name, surface) for name in view.surfaces}

    def on_map(self, name: str, at: Solved) -> Array:
        """Return a field of `BodyValues` on the map (..., vertical, horizontal)."""
        return self._mapped({
            body: interpolated(sampler, self.fields.at_nodes(at, body), name)
            for body, sampler in self._map.items()
        })  # fmt: skip

    def nodal_on_map(self, nodal: Mapping[str, Array]) -> Array:
        """Return nodal values of bodies (n_nodes,) on the map; NaN in other bodies."""
        return self._mapped({
            body: sampler(nodal[body]) if body in nodal else np.full(sampler.inside.shape, np.nan)
            for body, sampler in self._map.items()
        })  # fmt: skip

    def _mapped(self, of_body: Mapping[str, Array]) -> Array:
        out: Array | None = None
        for here in of_body.values():
            out = here if out is None else np.where(np.isnan(out), here, out)
        assert out is not None
        across, up = self.view.map_grid
        return out.reshape(*out.shape[:-1], len(up), len(across))

    def on_surface(self, name: str, body: str, at: Solved) -> Array:
        """Return a field of a body along its surface (..., s)."""
        return interpolated(self._surface[body], self.fields.at_nodes(at, body), name)

    def along_depth(self, nodal: Array) -> Array:
        """Return nodal fields of the profile body along depth (..., station, depth)."""
        return self._over_depth(self._lines(nodal))

    def profile(self, name: str, at: Solved) -> Array:
        """Return a field of the profile body along depth (..., station, depth)."""
        values = self.fields.at_nodes(at, self.view.profile_body)
        return self._over_depth(interpolated(self._lines, values, name))

    def _over_depth(self, values: Array) -> Array:
        return values.reshape(*values.shape[:-1], len(self.view.station), len(self.view.depth))

    def flow(self, at: Solved) -> Array:
        """Return signed plastic strain (n_components, station, depth) in tensor components."""
        body = self.view.profile_body
        points = self.system.state(body, at).plastic.plastic_strain
        return to_tensor(self.along_depth(self.fields.recovered(body, points)))

    def surface_mises(self, at: Solved, centre: float) -> Array:
        """Return von Mises stress along s at the surface of the profile body [MPa].

        It is at most the largest value at an integration point.
        """
        name = self.view.profile_body
        body = self.system.full(name)
        nodes = body.boundary_nodes(self.view.surfaces[name])
        nodes = nodes[np.argsort(self.view.axis.reached(body.X[:, nodes]))]
        stress = self.fields.at_nodes(at, name).mises[nodes]
        stress = np.minimum(stress, np.nanmax(self.fields.at_points(at, name)[1]))
        x = self.view.axis.reached(body.X[:, nodes]) - centre
        return np.asarray(np.interp(self.view.s, x, stress, left=np.nan, right=np.nan))


def _extent(view: View) -> list[float]:
    """Return the horizontal range and then the vertical range of a map [mm]."""
    return [float(end) for grid in view.map_grid for end in (grid.min(), grid.max())]
