"""The last part of the audit: compare the stored results of a run with recomputed values.

Of each quantity of a record some values are taken, and the largest. They are computed again at the
places that view and scene file declare, from displacements, internal variables, contact forces and
declared loads (`sources`). The samplers, the recovery and the outputs that made the record are not
used.

Quantities that a scene computes itself are left out, because nothing is declared about them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from solver.results.audit.compared import LEAST_STRAIN, LIMIT, MEASURED, STEADY, Compared, some
from solver.results.audit.figures import AUDIT
from solver.results.audit.named import NamedPlacesCheck
from solver.results.audit.recomputed import Recomputed
from solver.results.audit.sources import OfStates, along, between
from solver.results.audit.values import Located, at_nodes, flowed
from solver.results.body_fields import BODY_FIELDS, STORED
from solver.results.named_places import NamedPlaces
from solver.results.record import Record
from solver.results.run import FinishedRun
from solver.results.view import View
from solver.tensors import AXES, components
from solver.typing import Array

_FIGURE = AUDIT["audit_stored"].name
_NEAR = 0.1
"""Ratio of the gap to the largest motion or gap; below it gaps by different projections are
compared."""


@dataclass(frozen=True, slots=True)
class Stored:
    """The figure, the message on a violation if any, and the names of compared quantities."""

    figure: float
    violations: tuple[str, ...]
    names: frozenset[str]


def stored(run: FinishedRun, record: Record, view: View, places: NamedPlaces | None) -> Stored:
    """Compare a record with recomputed values.

    Parameters
    ----------
    run : the finished run
    record : the stored results
    view, places : the places of its results, as its parameters declare them
    """
    source = run.source or OfStates(run)
    viewed = _Viewed(run, record, view, source)
    found = viewed.compared()
    if places is not None and isinstance(source, OfStates):
        NamedPlacesCheck(run, record, places, source, found, viewed.stress_scale).compare()
    violations: tuple[str, ...] = ()
    if not found.figure <= LIMIT:
        text = f"{_FIGURE} = {found.figure:.2e} exceeds {LIMIT:.2e}"
        violations = (f"{text}: {found.name} differs from its recomputed value",)
    return Stored(found.figure, violations, frozenset(found.seen))


class _Viewed:
    """Comparison of the results at the places of the view."""

    def __init__(self, run: FinishedRun, record: Record, view: View, source: Recomputed) -> None:
        self._run, self._record, self._view, self._source = run, record, view, source
        self._out = Compared()

    def compared(self) -> Compared:
        """Return the comparison of all declared results."""
        self._held()
        self._coordinates()
        self._maps()
        self._profiles()
        self._surfaces()
        self._contact()
        self._extremes()
        return self._out

    # -- stored values -----------------------------------------------------------------------

    def _stored(self, name: str) -> Array | None:
        """Return a field, after the last pass if it has the dimension of passes."""
        if name not in self._record.fields:
            return None
        dims, values = self._record.fields[name]
        return np.asarray(values)[-1] if dims[0] == "pass" else np.asarray(values)

    def _axis(self, name: str) -> Array:
        return np.asarray(self._record.coordinates.get(name, np.zeros(0)), dtype=float)

    def _coordinates(self) -> None:
        """Compare the coordinates in the record with the declared places."""
        for name, declared in self._view.coordinates.items():
            recorded = self._record.coordinates.get(name, np.zeros(0))
            if declared.dtype.kind != "f":
                same = recorded.shape == declared.shape and bool((recorded == declared).all())
                self._out.add(name, float(same), 1.0, 1.0)
            elif recorded.shape != declared.shape:
                self._out.add(name, 0.0, 1.0, 1.0)
            else:
                self._out.add(name, recorded, declared, float(np.abs(declared).max()))

    def _held(self) -> None:
        """Compare displacements with those that supports and loads prescribe."""
        source = self._source
        if not isinstance(source, OfStates):
            return
        for name in self._run.system.names:
            for stage in self._view.stages:
                found, declared = source.held(name, stage)
                scale = float(np.nanmax(np.abs(found)))
                self._out.add("displacement", found, declared, scale)

    # -- scales --------------------------------------------------------------------------------

    @cached_property
    def stress_scale(self) -> float:
        """The largest stress under load, at least `LEAST_STRAIN` times Young's modulus [MPa]."""
        names = self._view.surfaces or dict.fromkeys(self._run.system.names, "")
        each = [self._source.fields(name, self._view.loaded) for name in names]
        most = max(float(np.nanmax(np.abs(fields.stress))) for fields in each)
        E = max(f.plain.body.material.elasticity.youngs_modulus for f in each)
        return max(most, LEAST_STRAIN * E)

    def _strain_scale(self, values: Array) -> float:
        return max(float(np.nanmax(values, initial=0.0)), LEAST_STRAIN)

    # -- fields at places ----------------------------------------------------------------------

    def _place(self, s: Array, depth: Array) -> Array:
        """Return places (n_axes, n) along the axis of the view and below it [mm]."""
        axis = self._view.axis
        each = zip(*axis, axis.down, strict=True)
        return np.stack([x0 + s * ax + depth * down for x0, ax, down in each])

    def _against(
        self,
        name: str,
        stored: Array,
        own: Array,
        places: tuple[Located, ...],
        scale: float,
        stage: str = "",
    ) -> None:
        """Compare values (..., n) at places of one body or of several."""
        exact = self._source.exact(stage or self._view.unloaded)
        self._out.add(name, stored, own, scale, 1.0 if exact else LIMIT / STEADY)
        self._out.absent(name, stored, np.all([p.outside for p in places], axis=0))

    def _maps(self) -> None:
        view = self._view
        x, y = (self._axis(name) for name in view.map_axes)
        single = {
            "residual_stress": (view.unloaded, _itself),
            "stress_difference": (view.loaded, self._difference),
        }
        staged = {f"map_{field}": (field, view.stages) for field in STORED}
        staged["plastic_strain"] = "plastic_strain", (view.unloaded,)
        names = [*single, *staged]
        there = {name: values for name in names if (values := self._stored(name)) is not None}
        if not there:
            return
        flat = {name: v.reshape(*v.shape[:-2], -1) for name, v in there.items()}
        at = some(len(x) * len(y), *flat.values())
        X = self._place(x[at % len(x)], -y[at // len(x)])
        places = {name: Located(self._source.plain(name), X) for name in view.surfaces}
        bodies = tuple(places.values())

        def sampled(field: str, stage: str) -> Array:
            """Return a field (..., n), each value of the first body that contains the place."""
            out = np.full(len(at), np.nan)
            unsure = np.zeros(len(at), dtype=bool)
            for name, where in places.items():
                here = where.of(at_nodes(self._source.fields(name, stage), field))
                here = np.where(unsure, np.nan, here)
                out = np.where(np.isnan(out), here, out)
                unsure |= ~where.inside & ~where.outside
            return np.asarray(out)

        for name, (stage, of) in single.items():
            if name in flat:
                own = of(sampled("stress", stage))
                self._against(name, flat[name][..., at], own, bodies, self.stress_scale, stage)
        for name, (field, stages) in staged.items():
            declared = BODY_FIELDS[field]
            for k, stage in enumerate(stages if name in flat else ()):
                own = sampled(field, stage)
                own = own if declared.over else np.maximum(own, 0.0)
                values = flat[name] if name == "plastic_strain" else flat[name][k]
                strains = declared.units == "1"
                scale = self._strain_scale(np.abs(values)) if strains else self.stress_scale
                # equivalent plastic strain is exact in all stages
                judged = "" if field == "plastic_strain" else stage
                self._against(name, values[..., at], own, bodies, scale, judged)

    def _difference(self, stress: Array) -> Array:
        """Return the difference of the principal stresses in the plane of the map (n,)."""
        axes = self._view.map_axes
        one, other = (stress[AXES.index(axis)] for axis in axes)
        shear = stress[components(len(stress)).index("".join(sorted(axes)))]
        return np.asarray(np.sqrt((one - other) ** 2 + 4 * shear**2))

    def _profiles(self) -> None:
        stress, strain = self._stored("residual_profile"), self._stored("profile_plastic_strain")
        if stress is None or strain is None:
            return
        station, depth, view = self._axis("station"), self._axis("depth"), self._view
        flat = np.moveaxis(stress, 1, 0).reshape(stress.shape[1], -1)
        at = some(strain.size, flat, strain.ravel())
        where = self._place(station[at // len(depth)], depth[at % len(depth)])
        places = Located(self._source.plain(view.profile_body), where)
        fields = self._source.fields(view.profile_body, view.unloaded)
        own = places.of(fields.stress)
        self._against("residual_profile", flat[:, at], own, (places,), self.stress_scale)
        # the state behind a steady pass is interpolated from recovered values
        steady = self._run.source is not None
        own = np.maximum(places.of(fields.accumulated if steady else flowed(fields)), 0.0)
        scale = self._strain_scale(strain)
        name = "profile_plastic_strain"
        self._against(name, strain.ravel()[at], own, (places,), scale)

    def _surfaces(self) -> None:
        s, view = self._axis("s"), self._view
        residual, mises = self._stored("surface_residual"), self._stored("surface_mises")
        for k, name in enumerate(view.surfaces if residual is not None else ()):
            assert residual is not None
            at = some(len(s), residual[k])
            places = Located(self._source.plain(name), self._place(s[at], np.zeros(len(at))))
            own = places.of(self._source.fields(name, view.unloaded).stress)
            self._against("surface_residual", residual[k][:, at], own, (places,),
                          self.stress_scale)  # fmt: skip
        for k, stage in enumerate(view.stages if mises is not None else ()):
            assert mises is not None
            fields, name = self._source.fields(view.profile_body, stage), view.profile_body
            nodes = fields.plain.part.boundary_nodes(view.surfaces[name])
            reached = along(self._view, fields.plain.part.X[:, nodes])
            order = np.argsort(reached)
            most = float(np.max(fields.at_points[1]))
            values = np.minimum(fields.mises[nodes][order], most)
            centre = self._source.centre(stage)
            own = between(s + centre, reached[order], values)
            self._out.add("surface_mises", mises[k], own, self.stress_scale)

    # -- contact and extremes ----------------------------------------------------------------

    def _contact(self) -> None:
        """Compare pressure, shear and gap along the surface, half-width and peak."""
        if not len(self._view.s):
            return
        lines = [self._stored(f"contact_{name}") for name in ("pressure", "shear", "gap")]
        if any(line is None for line in lines):
            return
        pressure, shear, gap = (np.asarray(line) for line in lines)
        for k, stage in enumerate(self._view.stages):
            x = self._axis("s") + self._source.centre(stage)
            own = self._source.acting(stage, x)
            least, most, peak = self._source.extent(stage)
            scale = max(peak, LEAST_STRAIN * self.stress_scale)
            self._out.add("contact_pressure", pressure[k], own.pressure, scale)
            self._out.add("contact_shear", shear[k], own.shear, scale)
            share = LIMIT / MEASURED if own.measured else 1.0
            # far from contact a gap, and whether it exists, depends on the projection
            near = np.isfinite(gap[k]) & (np.abs(own.gap) < _NEAR * own.way)
            faced = np.where(near | ~np.bool_(own.measured), own.gap, np.nan)
            self._out.add("contact_gap", gap[k], faced, own.way, share)
            if stage == self._view.loaded:
                self._number("peak_contact_pressure", peak, peak)
                # the edge of contact is found from gaps
                width = np.clip(self._record.scalars["contact_half_width"], least, most)
                self._number("contact_half_width", width, most, share)

    def _number(self, name: str, own: float, scale: float, share: float = 1.0) -> None:
        if name in self._record.scalars:
            self._out.add(name, self._record.scalars[name], own, scale, share)

    def _extremes(self) -> None:
        """Compare the largest and smallest residual stresses, and the largest plastic strain."""
        numbers = self._record.scalars
        bodies = self._run.system.names
        if "max_plastic_strain" in numbers:
            each = [self._source.fields(name, self._view.unloaded).at_points for name in bodies]
            y = np.concatenate([X[1] for X, _, _ in each])
            flow = np.concatenate([strain for _, _, strain in each])
            scale = self._strain_scale(flow)
            self._number("max_plastic_strain", float(np.nanmax(flow)), scale)
            depth = numbers.get("depth_of_max_plastic_strain", np.nan)
            if np.isfinite(depth):
                there = np.abs(y + depth) <= np.abs(y + depth).min()
                most = np.nanmax(flow[there]), np.nanmax(flow)
                self._out.add("depth_of_max_plastic_strain", *most, scale)
        if "peak_residual_tension" in numbers:
            normal = np.concatenate(
                [self._source.fields(n, self._view.unloaded).stress[:3].ravel() for n in bodies]
            )
            self._number("peak_residual_tension", np.nanmax(normal), self.stress_scale)
            self._number("peak_residual_compression", np.nanmin(normal), self.stress_scale)
        for k, (name, boundary) in enumerate(self._view.surfaces.items()):
            if self._stored("residual_max") is None:
                return
            fields = self._source.fields(name, self._view.unloaded)
            X = fields.plain.part.X
            surface = fields.plain.part.boundary_nodes(boundary)
            s = along(self._view, X[:, surface])
            for kind, of in (("max", np.nanmax), ("min", np.nanmin)):
                for prefix, stress, places, axes in (
                    ("residual", fields.stress, X, AXES[: len(X)]),
                    ("surface_residual", fields.stress[:, surface], s[None], ("s",)),
                ):
                    own = of(stress, axis=1)
                    self._extreme(f"{prefix}_{kind}", k, own, stress, places, axes)

    def _extreme(
        self, name: str, body: int, own: Array, stress: Array, places: Array, axes: tuple[str, ...]
    ) -> None:
        """Compare extremes (n,), and the stress (n, n_nodes) at the places that are stored."""
        recorded = self._stored(name)
        at = [self._stored(f"{name}_{axis}") for axis in axes]
        if recorded is None or any(one is None for one in at):
            return
        self._out.add(name, recorded[body], own, self.stress_scale)
        where = np.stack([np.asarray(one)[body] for one in at])  # (n_axes, n)
        for component in np.flatnonzero(np.isfinite(where).all(axis=0)):
            off = np.abs(places - where[:, component, None]).max(axis=0)
            there = stress[component, off <= off.min() + 1e-9 * np.abs(places).max()]
            near = np.nanmin(np.abs(there - own[component]))
            self._out.add(f"{name}_{axes[0]}", near, 0.0, self.stress_scale)


def _itself(values: Array) -> Array:
    return values
