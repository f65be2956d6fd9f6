"""The audit of a steady pass over a prism, in the frame of the load."""

from __future__ import annotations

import numpy as np

from solver.audit.report import Audit, limits_at
from solver.audit.theory import largest_strain
from solver.materials.law import Law
from solver.rolling.audit.flow import (
    INFLOW,
    STEADINESS,
    AuditedFlow,
    deviation,
    difference,
    judged,
    largest,
)
from solver.rolling.audit.patch import AuditedPatch
from solver.rolling.audit.plain_rail import PlainPrism
from solver.rolling.passing import Pass
from solver.rolling.rail.flow import PrismState
from solver.rolling.rail.patch_contact import AppliedPatch
from solver.rolling.rail.track import PrismTrack
from solver.typing import Array, Ints

_LENGTH = 0.01
"""Largest stress of the last level of the far field, over the yield stress."""
_ROWS = 16
"""Number of rows of points along which the law is repeated: those that yield most, and others."""
_LIMITS = {"audit_inflow": INFLOW, "audit_steadiness": STEADINESS, "audit_length": _LENGTH}


def audit_prism(
    track: PrismTrack,
    law: Law,
    found: Pass[PrismState],
    previous: Pass[PrismState] | None,
    plain: PlainPrism | None = None,
) -> Audit:
    """Check a steady pass over a prism: the state under load, that behind it, and the flow.

    Parameters
    ----------
    law : the declared law of the prism
    previous : the pass before it, None for the first one
    plain : second evaluation of the track, to be shared by passes over it

    Returns
    -------
    The figures, those of the contact only for a wheel.
    """
    loading = found.loading
    assert isinstance(loading, AppliedPatch)
    plain = plain or PlainPrism(track)
    traction = loading.contact.traction
    before, after = found.before, found.after
    stiff = 2 * law.elasticity.shear_modulus
    waves = plain.waves(stiff * (found.plastic_strain - before.plastic_strain[:, None]), traction)
    surface = plain.surface(waves, traction) + before.displacement
    patch = AuditedPatch(
        law, loading.load, loading.contact, plain.width, surface,
        strength=float(law.surface.shear(law.strength(after.state)).max()),
    )  # fmt: skip
    # behind of all passes, not of this one: what each leaves over must not add up
    left_strain, left_surface = plain.constant(stiff * after.plastic_strain)
    left_strain += track.initial_strain
    under_load = np.delete(_left_before(track, plain, before), track.modes.points, axis=0)
    under_load += plain.beside(waves)
    left_outside = np.delete(left_strain, track.modes.points, axis=0)
    unsteady = deviation(plain.strain(waves) - found.strain)
    unsteady_behind = deviation(left_strain[track.modes.points] - after.strain)
    residual = law.stiffness(6) @ (after.strain - after.plastic_strain).T
    flow = AuditedFlow(law, found, before.strain)
    rim = (found.accumulated - before.accumulated[:, None])[track.rim]
    strain = largest_strain([("section", track.points, flow.strained())])
    neglected = strain.neglected, flow.large_strain("section", track.weights)
    figures = {
        "audit_residual": plain.unbalanced(waves) / patch.force,
        "audit_reactions": max(
            patch.missing(), largest(np.abs(plain.reactions(waves))[:3]) / patch.force
        ),
        "audit_law": max(flow.misfit(), flow.retraced(_rows(found)), _released(law, found))
        / law.yield_stress,
        "audit_yield": max(
            flow.beyond(),
            largest(law.yield_value(residual, after.state)),
            *(_beyond_outside(law, each) for each in (left_outside, under_load)),
        )
        / law.yield_stress,
        "audit_dissipation": flow.dissipation(),
        "audit_history": max(
            _lost(track, law, found, previous),
            _unsettled(track, plain) / law.yield_stress,
            _apart(after.displacement, left_surface),
        ),
        "audit_inflow": max(flow.inflow(), flow.over_most(rim) if rim.size else 0.0),
        "audit_outflow": flow.outflow(),
        "audit_steadiness": stiff * max(unsteady, unsteady_behind) / law.yield_stress,
        "audit_length": _far(track, law, plain.resultants(waves.pulled)) / law.yield_stress,
        "audit_initial_stress": track.initial.change / law.yield_stress if track.initial else 0.0,
        "audit_plastic_strain": largest(after.accumulated),
        **patch.figures,
    }  # fmt: skip
    limits = limits_at(patch.force) | _LIMITS
    if patch.figures:
        limits |= patch.limits
    return judged(law, figures, limits, neglected)


def _rows(found: Pass[PrismState]) -> Ints:
    """Return the rows along which the law is repeated: half yield most, half lie anywhere."""
    added = (found.accumulated - found.before.accumulated[:, None]).max(axis=1)
    count = min(_ROWS, len(added)) // 2
    anywhere = np.linspace(0, len(added) - 1, count).astype(np.int64)
    return np.unique(np.append(np.argsort(-added)[:count], anywhere))


def _left_before(track: PrismTrack, plain: PlainPrism, before: PrismState) -> Array:
    """Return the strain (n, 6) before the pass at all points of the section."""
    if not before.plastic_strain.any():
        return track.initial_strain
    stress = 2 * track.elasticity.shear_modulus * before.plastic_strain
    return plain.constant(stress)[0] + track.initial_strain


def _beyond_outside(law: Law, elastic: Array) -> float:
    """Return the stress beyond yield where no point may flow, outside the zone [MPa].

    Parameters
    ----------
    elastic : (n, 6) strain at points there
    """
    virgin = law.initial(len(elastic), 6)
    return largest(law.yield_value(law.stiffness(6) @ elastic.T, virgin))


def _released(law: Law, found: Pass[PrismState]) -> float:
    """Return the difference of the state behind from that of the law [MPa].

    It follows from the last station, on the way to the strain without load.
    """
    before, after, parts = found.before, found.after, found.parts
    start = (before.strain + found.strain[:, -1]).T
    state = after.state.unpacked(found.states.packed[..., -1])
    for part in range(1, parts + 1):
        state = law.respond(start + part / parts * (after.strain.T - start), state).state
    return difference(law, after.state, state)


def _unsettled(track: PrismTrack, plain: PlainPrism) -> float:
    """Return the difference of the initial stress from that of the second evaluation [MPa]."""
    if track.initial is None:
        return 0.0
    stress = plain.initial_stress(track.initial.given, track.initial.held)
    own = track.initial_strain @ track.elasticity.stiffness(6)
    return float(np.abs(own - stress).max())


def _lost(
    track: PrismTrack, law: Law, found: Pass[PrismState], previous: Pass[PrismState] | None
) -> float:
    """Return the difference between the state before the pass and that behind the last one.

    It is the largest difference of internal variables and strain, as stress over the yield stress,
    or of displacement, over the largest. A pass in the opposite direction begins with the mirrored
    state. The first one begins with the initial stress.
    """
    before, displacement = found.before, np.zeros_like(found.before.displacement)
    if previous is None:
        state = law.initial(len(before.strain), 6)
        strain = track.initial_strain[track.modes.points]
    else:
        left = previous.left if found.direction == 1 else previous.left.mirrored
        state, strain, displacement = left.state, left.strain, left.displacement
    off = 2 * law.elasticity.shear_modulus * float(np.abs(before.strain - strain).max())
    off = max(difference(law, before.state, state), off) / law.yield_stress
    return max(off, _apart(before.displacement, displacement))


def _apart(one: Array, other: Array) -> float:
    """Return the largest difference of displacements, over the largest of them."""
    off = float(np.abs(one - other).max())
    return off / max(float(np.abs(each).max()) for each in (one, other)) if off else 0.0


def _far(track: PrismTrack, law: Law, resultants: Array) -> float:
    """Return the stress that the last level of the far field adds where the load is [MPa]."""
    if track.far is None:
        return 0.0
    return float(np.abs((track.far.last @ resultants) @ law.stiffness(6)).max())
