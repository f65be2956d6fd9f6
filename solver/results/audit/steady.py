"""The audit of a steady pass, in the frame of the load, and what its record is compared with."""

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

    Array = NDArray[np.float64]

_LIMITS = {
    "audit_reactions": TRAVELLING,
    "audit_inflow": INFLOW,
    "audit_steadiness": TOLERANCE,
}


def audit_pass(
    track: Track, material: Law, found: Pass, previous: Pass | None, direction: int
) -> Audit:
    """Check a steady pass: the state under load, what it leaves, and how material came there.

    Parameters
    ----------
    previous : the pass before it, None of the first one
    direction : its way along x, as declared
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


def _strain(track: Track, found: Pass) -> Strained:
    """Return the largest strain that the pass leaves; it is the same all along x."""
    layers = found.after.whole
    places = np.stack([np.zeros_like(layers.depth), -layers.depth])
    return largest_strain([(track.part.body.name, places, layers.accumulated)])


class _Way:
    """The way of material through the window: at each column, the last increment before it."""

    def __init__(self, track: Track, material: Law, found: Pass) -> None:
        self._material, self._found, self._elasticity = material, found, track.elasticity
        at_rest = found.before.strain(track.elasticity)[:, None]
        self._at_rest = np.moveaxis(at_rest, 2, 0)
        self._strain = np.moveaxis(at_rest + found.strain, 2, 0).reshape(4, -1)
        self._after, self._before = (
            each.unpacked(_flat(each.packed)) for each in (found.states, found.ago)
        )
        self._stress = material.stiffness(4) @ (self._strain - self._after.plastic_strain)

    def misfit(self) -> float:
        """Return how far the increments are from the law [MPa]."""
        off = self._material.misfit(self._strain, self._stress, self._before, self._after)
        return _largest(off)

    def retraced(self) -> float:
        """Return how far states are from those that the law gives, from column to column [MPa].

        The law is asked for all increments to each column, from the state at the one upstream;
        that at the first one begins with what was there before the pass, and what is left begins
        with the state at the last one, in one increment.
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
            across, self._apart(self._after, state), self._apart(found.after.state, left.state)
        )

    def _apart(self, one: PlasticState, other: PlasticState) -> float:
        """Return the largest difference of internal variables, as stress [MPa].

        Strain counts times 2 G, any other variable as a share of its largest value.
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
        """Return the least work that an increment turns into heat [N mm/mm3]."""
        nothing = np.zeros((4, 4, 0)), np.zeros(0, dtype=bool)
        response = Response(self._stress, nothing[0], self._after, nothing[1])
        return float(self._material.dissipation(self._before, response).min())

    def lost(self, previous: Pass | None, direction: int) -> float:
        """Return how far the state before the pass is from that which the last one left.

        It is the largest difference of internal variables / yield stress. Seen along the other way
        shear has the other sign.
        """
        found = self._found
        before = found.before.whole.state
        if previous is None:
            left = self._material.initial(len(before.accumulated), 4)
        else:
            left = previous.after.whole.state
            left = left if previous.direction == direction else left.mirrored
        turned = float(found.direction != direction)
        return max(turned, self._apart(before, left) / self._material.yield_stress)

    def inflow(self) -> float:
        """Return the plastic strain gathered in the first column / that of the pass."""
        found = self._found
        return _largest(found.accumulated[:, 0] - found.before.accumulated) / self._gathered

    def outflow(self) -> float:
        """Return the plastic strain gathered behind the window / that of the pass."""
        found = self._found
        return _largest(found.after.accumulated - found.accumulated[:, -1]) / self._gathered

    @property
    def _gathered(self) -> float:
        """The most plastic strain that the pass gathers, or what is nothing to speak of."""
        yield_strain = self._material.yield_stress / self._elasticity.youngs_modulus
        return max(LEAST * yield_strain, self._found.gathered)


def _flat(values: Array) -> Array:
    """Return values (n, n_points) of points in rows (n, n_rows, n_columns)."""
    return values.reshape(len(values), -1)


def _largest(values: Array) -> float:
    """Return the largest value, not below zero, or NaN where one is NaN."""
    return float(np.maximum(values.max(), 0.0))


def _of_contact(material: Law, found: Pass) -> dict[str, float]:
    """Return the figures of the contact with a wheel, none without a wheel."""
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
    """A steady pass.

    Parameters
    ----------
    moving : the pressure as it really goes, where no wheel makes it
    released : name of the state that the pass leaves
    """

    def __init__(
        self,
        half_plane: TrackBody,
        found: Pass,
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
        """See `Recomputed`: under the load there are two strains, see `audit_steadiness`."""
        return stage == self._released

    def centre(self, stage: str) -> float:
        """See `Recomputed`."""
        del stage
        return 0.0

    @property
    def _vertices(self) -> tuple[Array, Array, Array]:
        """Places along x, and pressure and shear there, as one sees them who stands beside."""
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
        width, side = np.ptp(at[pressure > 0]) / 2, np.diff(at).max()  # gaps are not known here
        return float(width - side), float(width + side), float(pressure.max())
