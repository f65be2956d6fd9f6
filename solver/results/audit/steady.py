"""The audit of a steady pass, in the frame of the load, and its recomputed results."""

from __future__ import annotations

from dataclasses import fields
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from solver.materials.state import Response
from solver.results.audit.plain import PlainBody, load_factor
from solver.results.audit.recomputed import Acting
from solver.results.audit.report import (
    TRAVELLING,
    Audit,
    broken,
    estimated_error,
    limits_at,
    warnings,
)
from solver.results.audit.sources import between, hertz
from solver.results.audit.theory import Strained, largest_strain
from solver.results.audit.values import PassFields
from solver.steady import RollingContact
from solver.steady.fields import of_layers, under_load
from solver.steady.flow import INFLOW, LEAST
from solver.steady.passing import TOLERANCE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.materials.law import Law
    from solver.materials.state import PlasticState
    from solver.model.motion import TravellingPressure
    from solver.results.audit.recomputed import BodyFields
    from solver.results.steady import TrackBody
    from solver.steady import Pass, Track
    from solver.steady.layers import Layers

    Array = NDArray[np.float64]

_LIMITS = {
    "audit_reactions": TRAVELLING,
    "audit_inflow": INFLOW,
    "audit_steadiness": TOLERANCE,
}


def audit_pass(
    track: Track, material: Law, found: Pass[Layers], previous: Pass[Layers] | None, direction: int
) -> Audit:
    """Check a steady pass: the state under load, the state behind it, and the flow of material.

    Parameters
    ----------
    previous : the pass before it, None for the first one
    direction : declared direction of the pass, 1 along +x, -1 along -x
    """
    plain, C = PlainBody(track.part), material.stiffness(4)
    loaded, left = under_load(track, found), of_layers(track, material, found.after)
    stress, residual = (C @ (f.strain - f.plastic.plastic_strain) for f in (loaded, left))
    load = found.loading.force.reshape(-1, 2)
    held = np.ones_like(load, dtype=bool)
    held.ravel()[track.part.free] = False
    lacking = plain.forces(stress) - load
    level = float(np.abs(load).sum(axis=0).max()) or 1.0
    way, strain = _Way(track, material, found), _strain(track, found)
    figures = {
        "audit_residual": float(np.linalg.norm(lacking[~held])) / level,
        "audit_reactions": _largest(abs((load + np.where(held, lacking, 0)).sum(axis=0))) / level,
        "audit_law": max(way.misfit(), way.retraced()) / material.yield_stress,
        "audit_yield": way.beyond() / material.yield_stress,
        "audit_dissipation": way.dissipation(),
        "audit_history": way.lost(previous, direction),
        "audit_inflow": way.inflow(),
        "audit_outflow": way.outflow(),
        "audit_steadiness": (
            2 * material.elasticity.shear_modulus * found.left_over / material.yield_stress
        ),
        "audit_contact_after_unloading": float(np.linalg.norm(plain.forces(residual)[~held])),
        "audit_error_loaded": estimated_error([(track.part, stress)]),
        "audit_error_residual": estimated_error([(track.part, residual)]),
        "audit_plastic_strain": strain.value,
        **_of_contact(material, found),
    }
    limits = {name: at for name, at in (limits_at(level) | _LIMITS).items() if name in figures}
    return Audit(
        figures,
        violations=broken(figures, limits, material.yield_stress),
        warnings=warnings(figures),
        outside=strain.outside,
    )


def _strain(track: Track, found: Pass[Layers]) -> Strained:
    """Return the largest plastic strain behind the pass, which does not depend on x."""
    layers = found.after.whole
    places = np.stack([np.zeros_like(layers.depth), -layers.depth])
    return largest_strain([(track.part.body.name, places, layers.accumulated)])


class _Way:
    """The flow of material through the window: for each column, the last increment before it."""

    def __init__(self, track: Track, material: Law, found: Pass[Layers]) -> None:
        self._material, self._found, self._elasticity = material, found, track.elasticity
        at_rest = found.before.strain(track.elasticity)[:, None]
        self._at_rest = np.moveaxis(at_rest, 2, 0)
        self._strain = np.moveaxis(at_rest + found.strain, 2, 0).reshape(4, -1)
        self._after, self._before = (
            each.unpacked(_flat(each.packed)) for each in (found.states, found.ago)
        )
        self._stress = material.stiffness(4) @ (self._strain - self._after.plastic_strain)

    def misfit(self) -> float:
        """Return the misfit of the increments to the law [MPa]."""
        off = self._material.misfit(self._strain, self._stress, self._before, self._after)
        return _largest(off)

    def retraced(self) -> float:
        """Return the difference of the states from those of the law, column by column [MPa].

        All increments between two columns are repeated with the law, from the state at the upstream
        column. The first column starts from the state before the pass. The state behind the load is
        one increment from the last column.
        """
        found, law = self._found, self._material
        states = found.states.packed
        strain = self._strain.reshape(4, *states.shape[1:])
        before = np.concatenate([found.before.state.packed[..., None], states], axis=2)
        first = _flat(np.concatenate([self._at_rest, strain[..., :-1]], axis=2))
        state = self._after.unpacked(_flat(before[..., :-1]))
        for part in range(1, found.parts + 1):
            share = part / found.parts
            state = law.respond(first + share * (self._strain - first), state).state
        last = found.before.state.unpacked(before[..., -1])
        left = law.respond(found.after.strain(self._elasticity).T, last)
        across = float(np.abs(left.stress[[1, 3]]).max())
        return max(
            across,
            self._difference(self._after, state),
            self._difference(found.after.state, left.state),
        )

    def _difference(self, one: PlasticState, other: PlasticState) -> float:
        """Return the largest difference of internal variables, as stress [MPa].

        Strain is multiplied by 2 G; any other variable counts relative to its largest value.
        """
        double_shear, worst = 2 * self._material.elasticity.shear_modulus, []
        for name in (f.name for f in fields(one)):
            values, others = getattr(one, name), getattr(other, name)
            off = float(np.abs(values - others).max(initial=0.0))
            if name in ("plastic_strain", "accumulated"):
                worst.append(off * double_shear)
            elif off:
                size = max(np.abs(values).max(), np.abs(others).max())
                worst.append(off / float(size) * self._material.yield_stress)
        return float(np.max(worst))

    def beyond(self) -> float:
        """Return the stress beyond yield [MPa]."""
        return _largest(self._material.yield_value(self._stress, self._after))

    def dissipation(self) -> float:
        """Return the least plastic dissipation of an increment [N mm/mm3]."""
        nothing = np.zeros((4, 4, 0)), np.zeros(0, dtype=bool)
        response = Response(self._stress, nothing[0], self._after, nothing[1])
        return float(self._material.dissipation(self._before, response).min())

    def lost(self, previous: Pass[Layers] | None, direction: int) -> float:
        """Return the difference between the state before the pass and that behind the last one.

        It is the largest difference of internal variables, as stress over the yield stress. In the
        opposite direction shear has the opposite sign.
        """
        found = self._found
        before = found.before.whole.state
        if previous is None:
            left = self._material.initial(len(before.accumulated), 4)
        else:
            left = previous.after.whole.state
            left = left if previous.direction == direction else left.mirrored
        turned = float(found.direction != direction)
        return max(turned, self._difference(before, left) / self._material.yield_stress)

    def inflow(self) -> float:
        """Return the plastic strain added in the first column, over that of the pass."""
        found = self._found
        return _largest(found.accumulated[:, 0] - found.before.accumulated) / self._most_added

    def outflow(self) -> float:
        """Return the plastic strain added behind the window, over that of the pass."""
        found = self._found
        return _largest(found.after.accumulated - found.accumulated[:, -1]) / self._most_added

    @property
    def _most_added(self) -> float:
        """The largest plastic strain that the pass adds, at least `LEAST` of the yield strain."""
        yield_strain = self._material.yield_stress / self._elasticity.youngs_modulus
        return max(LEAST * yield_strain, self._found.most_added)


def _flat(values: Array) -> Array:
    """Return values (n, n_points) of points in rows (n, n_rows, n_columns)."""
    return values.reshape(len(values), -1)


def _largest(values: Array) -> float:
    """Return the largest value, not below zero, or NaN where one is NaN."""
    return float(np.maximum(values.max(), 0.0))


def _of_contact(material: Law, found: Pass[Layers]) -> dict[str, float]:
    """Return the figures of the contact with a wheel; empty without a wheel."""
    touching = found.loading
    if not isinstance(touching, RollingContact):
        return {}
    strength = float(material.shear_strength(found.after.state).max())
    return {
        "audit_tension": _largest(-touching.normal),
        "audit_friction_excess": _largest(
            np.abs(touching.tangential) - np.nan_to_num(touching.bound)
        ),
        "audit_surface_shear": _largest(np.abs(touching.shear)) / strength,
        "audit_friction_over_strength": _largest(touching.most_shear) / strength,
    }


class OfPass:
    """Recomputed results of a steady pass (see `Recomputed`).

    Parameters
    ----------
    moving : the travelling pressure, None if the load is a wheel
    released : name of the state behind the pass
    """

    def __init__(
        self,
        half_plane: TrackBody,
        found: Pass[Layers],
        moving: TravellingPressure | None,
        released: str,
    ) -> None:
        self._half_plane, self._found = half_plane, found
        self._moving, self._released = moving, released
        self.fields = cache(self._fields)
        self.plain = cache(lambda name: PlainBody(half_plane.full(name)))

    def _fields(self, name: str, stage: str) -> BodyFields:
        del name
        return PassFields(self._half_plane, self._found, loaded=stage != self._released)

    def exact(self, stage: str) -> bool:
        """See `Recomputed`; under the load two strains differ, by `audit_steadiness`."""
        return stage == self._released

    def centre(self, stage: str) -> float:
        """See `Recomputed`."""
        del stage
        return 0.0

    @property
    def _vertices(self) -> tuple[Array, Array, Array]:
        """Positions along x, pressure and shear there, in the coordinates of the track."""
        touching, chain = self._found.loading, self._half_plane.track.surface
        assert isinstance(touching, RollingContact)
        x, way = chain.X[0, chain.vertices], self._found.direction
        side = np.abs(np.diff(x)) / 2
        area = np.append(side, 0.0) + np.append(0.0, side)
        order = np.argsort(way * x)
        pressure, shear = touching.normal / area, -way * touching.tangential / area
        return (way * x)[order], pressure[order], shear[order]

    def acting(self, stage: str, x: Array) -> Acting:
        """See `Recomputed`."""
        nowhere = np.full_like(x, np.nan)
        if self._moving is not None:
            time = float(stage == self._released)
            return Acting(*hertz(self._moving, time, x, 0.0), nowhere)
        if stage == self._released:
            return Acting(np.zeros_like(x), np.zeros_like(x), nowhere)
        at, pressure, shear = self._vertices
        return Acting(between(x, at, pressure), between(x, at, shear), nowhere)

    def extent(self, stage: str) -> tuple[float, float, float]:
        """See `Recomputed`."""
        if self._moving is not None:
            share = load_factor(self._moving.amplitude, float(stage == self._released))
            return self._moving.half_width, self._moving.half_width, share * self._moving.peak
        if stage == self._released:
            return np.nan, np.nan, 0.0
        at, pressure, _ = self._vertices
        width, side = np.ptp(at[pressure > 0]) / 2, np.diff(at).max()  # gaps are not available
        return float(width - side), float(width + side), float(pressure.max())
