"""Fields of bodies at their nodes, at integration points, at places and at those of a view."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any, Generic, NamedTuple, Protocol, TypeVar, runtime_checkable

import numpy as np
from scipy.sparse import csr_array

from solver.contact.state import BodyState, State
from solver.errors import ModelError
from solver.fem.discretisation import Discretisation
from solver.fem.fields import Sampler, recovered_beside
from solver.results.body_fields import BodyValues
from solver.results.mesh_fields import MeshFields, counterclockwise
from solver.results.view import Places, View
from solver.tensors import not_below_zero, to_tensor, von_mises
from solver.typing import Array, Ints

_MOST = 8
"""Number of values in a `Remembered` cache."""
T = TypeVar("T")


class Solved(Protocol):
    """A converged state."""

    @property
    def state(self) -> State | BodyState:
        """The unknowns, or the only body."""


class Bodies(Protocol):
    """Discretised bodies with converged states, such as a `System`."""

    @property
    def names(self) -> Sequence[str]:
        """Names of the bodies."""

    @property
    def n_unknowns(self) -> int:
        """Number of displacement unknowns of all bodies."""

    def full(self, name: str) -> Discretisation:
        """Return a discretised body."""

    def positions(self, name: str) -> Array:
        """Return the positions (n_axes, n_points) of the points of a body [mm]."""

    def sampler(self, name: str, X: Array) -> Sampler:
        """Return the interpolation of nodal fields of a body at positions (n_axes, n) [mm]."""

    def recovery(self, name: str) -> csr_array:
        """Return the matrix (n_nodes, n_points) from values at points to those at nodes."""

    def state(self, name: str, converged: Any) -> BodyState:
        """Return the state of a body."""


class StressCycle(NamedTuple):
    """Different cycles of the points of a body.

    Attributes
    ----------
    stress, strain : (n, n_instants, n_components), tensor components; NaN where not known
    grown : (n,) plastic strain that the cycle accumulates
    net : (n,) equivalent of the signed plastic strain that it leaves
    of : (n_points,) the cycle of each point
    """

    stress: Array
    strain: Array
    grown: Array
    net: Array
    of: Ints


@runtime_checkable
class Passed(Protocol):
    """A body of which one state under the load is a whole cycle."""

    def cycle(self, loaded: Any) -> StressCycle:
        """Return the cycle of a pass."""


_POSITIVE = ("mises", "plastic_strain")


class SystemFields:
    """Fields of the bodies of a system; those of the last states are cached."""

    def __init__(self, system: Bodies) -> None:
        self.system = system
        self.recovery = cache(system.recovery)
        self._at_nodes: Remembered[BodyValues] = Remembered()

    def recovered(self, body: str, points: Array) -> Array:
        """Return nodal values (..., n_nodes) of point values (..., n_points).

        Point values are NaN in removed elements; these are left out.
        """
        matrix = self.recovery(body)
        if any(load.removes for load in self.system.full(body).body.every_load):
            return recovered_beside(matrix, points)
        return np.asarray((matrix @ points.T).T)

    def at_nodes(self, at: Solved, body: str) -> BodyValues:
        """Return the fields at the nodes of a body."""
        return self._at_nodes.of(at, body, lambda: self._recovered(at, body))

    def _recovered(self, at: Solved, body: str) -> BodyValues:
        found, nodes = self.system.state(body, at), self.system.full(body).X.shape[1]
        moved = found.u.reshape(nodes, -1).T
        mises = not_below_zero(self.recovered(body, von_mises(found.stress)))
        return BodyValues(
            displacement=np.where(np.isnan(mises), np.nan, moved),
            stress=to_tensor(self.recovered(body, found.stress)),
            mises=mises,
            plastic_strain=not_below_zero(self.recovered(body, found.plastic.accumulated)),
            plastic_tensor=to_tensor(self.recovered(body, found.plastic.plastic_strain)),
            strain=to_tensor(self.recovered(body, found.strain)),
        )

    def at_points(self, at: Solved, body: str) -> tuple[Array, Array, Array]:
        """Return values at the integration points of a body.

        Returns
        -------
        positions (n_axes, n) [mm], von Mises stress (n,) [MPa] and equivalent plastic strain (n,)
        """
        found = self.system.state(body, at)
        return self.system.positions(body), von_mises(found.stress), found.plastic.accumulated

    def at_places(self, places: Places, states: Sequence[Solved]) -> list[BodyValues]:
        """Return the fields at places of a body in each state; NaN outside the body."""
        sampler = self.system.sampler(places.body, places.X)
        return [
            BodyValues(*(interpolated(sampler, values, name) for name in BodyValues._fields))
            for values in (self.at_nodes(at, places.body) for at in states)
        ]

    def on_mesh(
        self, states: Mapping[str, Solved], beside: Callable[[], MeshFields] | None = None
    ) -> MeshFields:
        """Return the fields of all bodies at the nodes of their meshes.

        Parameters
        ----------
        states : state at each stage
        beside : function that returns the fields of further bodies at the same stages
        """
        wholes = {name: self.system.full(name) for name in self.system.names}
        bodies, first = {}, 0
        for name, whole in wholes.items():
            cells = whole.basis.element_dofs.T
            if len(whole.X) == 2:  # cells in three dimensions have no orientation to correct
                cells = counterclockwise(cells, whole.X)
            bodies[name] = (whole.body.element, first + cells)
            first += whole.X.shape[1]
        stages = {}
        for stage, at in states.items():
            each = [self.at_nodes(at, name)._asdict() for name in wholes]
            stages[stage] = {
                name: np.concatenate([f[name] for f in each], axis=-1) for name in each[0]
            }
        X = np.hstack([whole.X for whole in wholes.values()])
        found = MeshFields(X=X, bodies=bodies, stages=stages)
        return found if beside is None else found.joined(beside())


def interpolated(sampler: Sampler, values: BodyValues, name: str) -> Array:
    """Return a field (..., n) interpolated between nodes; non-negative fields stay so."""
    found = sampler(getattr(values, name))
    return not_below_zero(found) if name in _POSITIVE else found


class Remembered(Generic[T]):
    """A cache of the values of the last states."""

    def __init__(self) -> None:
        self._known: dict[tuple[Any, ...], tuple[Any, T]] = {}

    def of(self, at: Solved, name: str, make: Callable[[], T]) -> T:
        """Return the value of this name in a state; ``make`` computes it if it is not cached."""
        key = (id(at.state), name)
        if key not in self._known:
            while len(self._known) >= _MOST:
                del self._known[next(iter(self._known))]
            # the state is kept so that its id is not reused; `at` with its tangents is too large
            self._known[key] = at.state, make()
        return self._known[key][1]


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
