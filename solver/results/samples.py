"""Fields of a system, sampled at the positions of a view."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from solver.errors import ModelError
from solver.fem.fields import Sampler
from solver.tensors import not_below_zero, to_tensor, von_mises

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray
    from scipy.sparse import csr_array

    from solver.contact.state import State
    from solver.fem.discretisation import Discretisation
    from solver.fem.frame import RigidMotion
    from solver.materials.state import Response
    from solver.results.view import View

    Array = NDArray[np.float64]


class Solved(Protocol):
    """A state that was found."""

    @property
    def state(self) -> State:
        """Its unknowns."""


class Bodies(Protocol):
    """Bodies of which states were found, each body a whole mesh: a `System`, for one."""

    @property
    def names(self) -> Sequence[str]:
        """Names of the bodies."""

    @property
    def n_unknowns(self) -> int:
        """Displacement unknowns of all bodies."""

    def full(self, name: str) -> Discretisation:
        """Return a body."""

    def positions(self, name: str) -> Array:
        """Return where the points of a body are (2, n_points) [mm]."""

    def recovery(self, name: str) -> csr_array:
        """Return the matrix (n_nodes, n_points) from values at points to those at nodes."""

    def response(self, name: str, converged: Any) -> Response:
        """Return stress and internal variables at the points of a body."""

    def displacement(self, name: str, state: State) -> Array:
        """Return the displacements (n,) of a body [mm]."""

    def axle(self, converged: Any) -> RigidMotion | None:
        """Return the motion of the first wheel, where there is one."""


class Nodal:
    """Fields at the nodes of bodies; the recovery operators are built once."""

    def __init__(self, system: Bodies) -> None:
        self.system = system
        self._recovery: dict[str, csr_array] = {}

    def of_points(self, body: str, points: Array) -> Array:
        """Return recovered nodal values (..., n_nodes) of point values (..., n_points)."""
        if body not in self._recovery:
            self._recovery[body] = self.system.recovery(body)
        return np.asarray((self._recovery[body] @ points.T).T)

    def stress(self, body: str, converged: Solved) -> Array:
        """Return recovered nodal stress (4, n_nodes), Mandel [MPa]."""
        return self.of_points(body, self.system.response(body, converged).stress)

    def plastic_strain(self, body: str, converged: Solved) -> Array:
        """Return recovered equivalent plastic strain (n_nodes,), not below zero."""
        strain = self.system.response(body, converged).state.accumulated
        return not_below_zero(self.of_points(body, strain))


class Samples(Nodal):
    """Samples one system; the interpolation is set up once for all its runs.

    Raises
    ------
    ModelError
        when the map of the view meets no body
    """

    def __init__(self, system: Bodies, view: View) -> None:
        super().__init__(system)
        self.view = view
        X, Y = np.meshgrid(view.x, view.y)
        S, D = np.meshgrid(view.station, view.depth, indexing="ij")
        grid, lines = view.axis.place(X.ravel(), -Y.ravel()), view.axis.place(S.ravel(), D.ravel())
        surface = view.axis.place(view.s, np.zeros_like(view.s))
        wholes = {name: system.full(name) for name in view.surfaces}
        self._map = {name: Sampler(whole, grid) for name, whole in wholes.items()}
        if view.x.size and not any(sampler.inside.any() for sampler in self._map.values()):
            raise ModelError(
                "map", _extent(view), "must meet a body, from x to x and from y to y [mm]"
            )
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

    def on_surface(self, body: str, converged: Solved) -> Array:
        """Return surface stress (4, n_s) of a body, tensor components [MPa]."""
        return to_tensor(self._surface[body](self.stress(body, converged)))

    def along_depth(self, nodal: Array) -> Array:
        """Return nodal fields of the profile body along depth (..., station, depth)."""
        values = self._lines(nodal)
        return values.reshape(*values.shape[:-1], len(self.view.station), len(self.view.depth))

    def profile(self, converged: Solved) -> tuple[Array, Array]:
        """Return stress (station, 4, depth) [MPa] and plastic strain (station, depth)."""
        body = self.view.profile_body
        stress = self.along_depth(self.stress(body, converged))
        strain = not_below_zero(self.along_depth(self.plastic_strain(body, converged)))
        return to_tensor(stress).swapaxes(0, 1), strain

    def flow(self, converged: Solved) -> Array:
        """Return signed plastic strain (station, 4, depth), tensor components."""
        body = self.view.profile_body
        points = self.system.response(body, converged).state.plastic_strain
        return to_tensor(self.along_depth(self.of_points(body, points))).swapaxes(0, 1)

    def displacement(self, converged: Solved) -> Array:
        """Return the displacement (2, station) of the surface [mm]."""
        u = self.system.displacement(self.view.profile_body, converged.state).reshape(-1, 2).T
        return np.asarray(self.along_depth(u)[:, :, 0])

    def surface_mises(self, converged: Solved, centre: float) -> Array:
        """Return von Mises stress along s at the surface of the profile body [MPa].

        Von Mises stress is recovered from the points; that of recovered stress would go far
        beyond the strength.
        """
        name = self.view.profile_body
        body = self.system.full(name)
        nodes = body.boundary_nodes(self.view.surfaces[name])
        nodes = nodes[np.argsort(self.view.axis.reached(body.X[:, nodes]))]
        points = von_mises(self.system.response(name, converged).stress)
        stress = np.clip(self.of_points(name, points)[nodes], 0.0, points.max())
        x = self.view.axis.reached(body.X[:, nodes]) - centre
        beyond = {"left": np.nan, "right": np.nan}
        way = {"period": body.period} if body.period else beyond
        return np.asarray(np.interp(self.view.s, x, stress, **way))


def _extent(view: View) -> list[float]:
    """Return from where to where a map reaches along x, and along y [mm]."""
    return [float(end) for grid in (view.x, view.y) for end in (grid.min(), grid.max())]
