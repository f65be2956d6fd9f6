"""Turns the end of a branch into the labelled arrays of a record."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from solver.errors import LimitLoad
from solver.fem.fields import Sampler, recovery
from solver.results.audit import audit
from solver.results.record import Record, Status
from solver.results.touch import touch_of
from solver.tensors import COMPONENTS, to_tensor, von_mises

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    from solver.contact.state import Converged
    from solver.contact.system import System
    from solver.errors import NotConverged
    from solver.loading.stepper import Tally

    Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """Where a scene is looked at; independent of its mesh, so that runs can be compared.

    Attributes
    ----------
    x, y : map grid [mm]
    depth, station : profiles go down to ``depth`` below the surface at x = ``station`` [mm]
    s : positions along the contact surface from its centre [mm]
    profile_body : the body whose profiles are taken
    surfaces : body -> boundary that is its contact surface, in the order of the dimension
    stages : labels of the states whose contact is recorded
    """

    x: Array
    y: Array
    depth: Array
    station: Array
    s: Array
    profile_body: str
    surfaces: dict[str, str]
    stages: tuple[str, ...] = ("loaded", "unloaded")

    @property
    def coordinates(self) -> dict[str, Any]:
        """The record's coordinates."""
        return {
            "component": np.array(COMPONENTS),
            "stage": np.array(self.stages),
            "body": np.array(list(self.surfaces)),
            "x": self.x,
            "y": self.y,
            "depth": self.depth,
            "station": self.station,
            "s": self.s,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class End:
    """How a run ended, and what its scene adds to the record.

    ``stages`` are the states of the dimension ``stage`` with the position of the contact's
    centre [mm]; ``loaded`` and ``unloaded`` are judged and drawn, and absent after an ``error``.
    """

    tally: Tally
    error: NotConverged | None = None
    loaded: Converged | None = None
    unloaded: Converged | None = None
    stages: tuple[tuple[Converged, float], ...] = ()
    coordinates: Mapping[str, Any] = field(default_factory=dict)
    fields: Mapping[str, Any] = field(default_factory=dict)
    scalars: Mapping[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()


class Harvest:
    """Samples one system; the interpolation is set up once for all its runs."""

    def __init__(self, system: System, layout: Layout) -> None:
        self.system = system
        self.layout = layout
        self.touch = touch_of(system)
        X, Y = np.meshgrid(layout.x, layout.y)
        S, D = np.meshgrid(layout.station, -layout.depth, indexing="ij")
        grid, lines = np.stack([X.ravel(), Y.ravel()]), np.stack([S.ravel(), D.ravel()])
        surface = np.stack([layout.s, np.zeros_like(layout.s)])
        wholes = {body.name: system.full(body.name) for body in system.model.bodies}
        self._recover = {name: recovery(part) for name, part in wholes.items()}
        self._map = {name: Sampler(wholes[name], grid) for name in layout.surfaces}
        self._lines = Sampler(wholes[layout.profile_body], lines)
        self._surface = {name: Sampler(wholes[name], surface) for name in layout.surfaces}

    def record(self, parameters: object, end: End) -> Record:
        """Return the record of a run."""
        scalars = _cost(end.tally) | {"degrees_of_freedom": float(self.system.n_unknowns)}
        if end.error is not None or end.loaded is None or end.unloaded is None:
            limit = isinstance(end.error, LimitLoad)
            return Record(
                parameters=parameters,
                status=Status.LIMIT_LOAD if limit else Status.NOT_CONVERGED,
                message=str(end.error),
                coordinates=self.layout.coordinates | dict(end.coordinates),
                scalars=scalars | dict(end.scalars),
            )
        check = audit(self.system, end.loaded, end.unloaded, end.tally.dissipation)
        scalars |= dict(check.figures) | self._scalars(end.loaded, end.unloaded)
        scalars |= {"plastic_work": end.tally.plastic_work} | dict(end.scalars)
        return Record(
            parameters=parameters,
            status=Status.OK if check.passed else Status.AUDIT_FAILED,
            message="; ".join(check.violations + check.warnings + end.warnings),
            coordinates=self.layout.coordinates | dict(end.coordinates),
            fields=self._fields(end) | dict(end.fields),
            scalars=scalars,
        )

    # -- nodal fields --------------------------------------------------------------------------

    def stress(self, body: str, converged: Converged) -> Array:
        """Return recovered nodal stress (4, n_nodes), Mandel [MPa]."""
        points = self.system.response(body, converged).stress
        return np.asarray((self._recover[body] @ points.T).T)

    def plastic(self, body: str, converged: Converged) -> Array:
        """Return recovered equivalent plastic strain (n_nodes,), not below zero."""
        points = self.system.response(body, converged).state.accumulated
        return np.maximum(self._recover[body] @ points, 0.0)

    def on_surface(self, body: str, converged: Converged) -> Array:
        """Return surface stress (4, n_s) of a body, tensor components [MPa]."""
        return to_tensor(self._surface[body](self.stress(body, converged)))

    def profile(self, converged: Converged) -> tuple[Array, Array]:
        """Return stress (station, 4, depth) [MPa] and plastic strain (station, depth)."""
        body, shape = self.layout.profile_body, (len(self.layout.station), len(self.layout.depth))
        stress = self._lines(self.stress(body, converged)).reshape(4, *shape)
        strain = self._lines(self.plastic(body, converged)).reshape(shape)
        return to_tensor(stress).swapaxes(0, 1), strain

    def flow(self, converged: Converged) -> Array:
        """Return signed plastic strain (station, 4, depth), tensor components."""
        body, layout = self.layout.profile_body, self.layout
        points = self.system.response(body, converged).state.plastic_strain
        strain = self._lines((self._recover[body] @ points.T).T)
        return to_tensor(strain.reshape(4, len(layout.station), -1)).swapaxes(0, 1)

    def moved(self, converged: Converged) -> Array:
        """Return the displacement (2, station) of the surface [mm]."""
        body, layout = self.layout.profile_body, self.layout
        u = self.system.displacement(body, converged.state).reshape(-1, 2).T
        return np.asarray(self._lines(u).reshape(2, len(layout.station), -1)[:, :, 0])

    # -- the record's variables ----------------------------------------------------------------

    def _on_map(self, values: Callable[[str], Array]) -> Array:
        out: Array | None = None
        for body, sampler in self._map.items():
            here = sampler(values(body))
            out = here if out is None else np.where(np.isnan(out), here, out)
        assert out is not None
        return out.reshape(*out.shape[:-1], len(self.layout.y), len(self.layout.x))

    def _fields(self, end: End) -> dict[str, Any]:
        loaded, unloaded = end.loaded, end.unloaded
        assert loaded is not None
        assert unloaded is not None
        residual = self._on_map(lambda body: self.stress(body, unloaded))
        under_load = self._on_map(lambda body: self.stress(body, loaded))
        strain = self._on_map(lambda body: self.plastic(body, unloaded))
        stress_profile, strain_profile = self.profile(unloaded)
        contact = [self.touch.along(c, self.layout.s + centre) for c, centre in end.stages]
        surface = np.stack([self.on_surface(body, unloaded) for body in self.layout.surfaces])
        return {
            "residual_stress": (("component", "y", "x"), to_tensor(residual)),
            "residual_mises": (("y", "x"), von_mises(residual)),
            "plastic_strain": (("y", "x"), strain),
            "mises_loaded": (("y", "x"), von_mises(under_load)),
            "residual_profile": (("station", "component", "depth"), stress_profile),
            "plastic_strain_profile": (("station", "depth"), strain_profile),
            "surface_residual": (("body", "component", "s"), surface),
            **{
                name: (("stage", "s"), np.stack([c[k] for c in contact]))
                for k, name in enumerate(("contact_pressure", "contact_shear", "contact_gap"))
            },
            "surface_mises": (
                ("stage", "s"),
                np.stack([self._surface_mises(c, x) for c, x in end.stages]),
            ),
        }

    def _surface_mises(self, converged: Converged, centre: float) -> Array:
        """Return von Mises stress along s at the surface whose profiles are taken.

        It is recovered itself: that of a recovered stress would go far beyond the strength.
        """
        name = self.layout.profile_body
        body = self.system.full(name)
        nodes = body.boundary_nodes(self.layout.surfaces[name])
        nodes = nodes[np.argsort(body.X[0, nodes])]
        points = von_mises(self.system.response(name, converged).stress)
        stress = np.clip((self._recover[name] @ points)[nodes], 0.0, points.max())
        x, beyond = body.X[0, nodes] - centre, {"left": np.nan, "right": np.nan}
        way = {"period": body.period} if body.period else beyond
        return np.asarray(np.interp(self.layout.s, x, stress, **way))

    def _scalars(self, loaded: Converged, unloaded: Converged) -> dict[str, float]:
        names = [body.name for body in self.system.model.bodies]
        strains = {n: self.system.response(n, unloaded).state.accumulated for n in names}
        most = max(names, key=lambda name: strains[name].max())
        points = self.system.full(most).points.reshape(2, -1)
        where = points[1, strains[most].argmax()]
        residual = [self.stress(name, unloaded)[:3] for name in names]
        width, peak = self.touch.extent(loaded)
        return {
            "contact_half_width": width,
            "peak_contact_pressure": peak,
            "max_plastic_strain": float(strains[most].max()),
            "depth_of_max_plastic_strain": float(-where) if strains[most].max() > 0 else np.nan,
            "peak_residual_tension": float(max(r.max() for r in residual)),
            "peak_residual_compression": float(min(r.min() for r in residual)),
        }


def _cost(tally: Tally) -> dict[str, float]:
    return {
        "increments": len(tally.iterations),
        "cut_increments": tally.cuts,
        "iterations": sum(tally.iterations),
        "median_iterations": float(np.median(tally.iterations)) if tally.iterations else 0.0,
        "inner_fallbacks": tally.pivoted,
        "blended_tangents": tally.blended,
        "cpu_seconds": tally.seconds,
    }
