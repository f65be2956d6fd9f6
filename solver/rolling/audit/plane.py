"""The audit of a steady pass over a track, in the frame of the load."""

from __future__ import annotations

import numpy as np

from solver.audit.plain import PlainBody
from solver.audit.report import Audit, estimated_error, limits_at
from solver.audit.theory import Neglected, equivalent, largest_strain
from solver.materials.law import Law
from solver.rolling.audit.flow import INFLOW, STEADINESS, AuditedFlow, difference, judged, largest
from solver.rolling.passing import Pass
from solver.rolling.plane.layers import Layers
from solver.rolling.plane.track import Track, of_layers, under_load
from solver.rolling.plane.wheel import RollingContact

_LIMITS = {"audit_inflow": INFLOW, "audit_steadiness": STEADINESS}


def audit_pass(
    track: Track, material: Law, found: Pass[Layers], left: Layers | None, direction: int
) -> Audit:
    """Check a steady pass: the state under load, the state behind it, and the flow of material.

    Parameters
    ----------
    left : state that the pass before it left, in the coordinates of the track; None for the first
    direction : declared direction of the pass, 1 along +x, -1 along -x
    """
    plain, n = PlainBody(track.part), track.part.weights.size
    loaded, behind = under_load(track, found), of_layers(track, material, found.after)
    stress, residual = loaded.stress[:, :n], behind.stress[:, :n]
    load = found.loading.force.reshape(-1, 2)
    held = np.ones_like(load, dtype=bool)
    held.ravel()[track.part.free] = False
    lacking = plain.forces(stress) - load
    level = float(np.abs(load).sum(axis=0).max()) or 1.0
    flow = AuditedFlow(material, found, found.before.strain(track.elasticity))
    neglected = _neglected(track, found, flow)
    figures = {
        "audit_residual": float(np.linalg.norm(lacking[~held])) / level,
        "audit_reactions": largest(abs((load + np.where(held, lacking, 0)).sum(axis=0))) / level,
        "audit_law": max(flow.misfit(), flow.retraced(), _released(track, material, found))
        / material.yield_stress,
        "audit_yield": flow.beyond() / material.yield_stress,
        "audit_dissipation": flow.dissipation(),
        "audit_history": _lost(material, found, left, direction),
        "audit_inflow": flow.inflow(),
        "audit_outflow": flow.outflow(),
        "audit_steadiness": (
            2 * material.elasticity.shear_modulus * found.left_over / material.yield_stress
        ),
        "audit_contact_after_unloading": float(np.linalg.norm(plain.forces(residual)[~held])),
        "audit_error_loaded": estimated_error([(track.part, stress)]),
        "audit_error_residual": estimated_error([(track.part, residual)]),
        "audit_plastic_strain": largest(found.after.whole.accumulated),
        **_of_contact(material, found),
    }
    limits = limits_at(level, moving=True) | _LIMITS
    return judged(material, figures, limits, neglected)


def _neglected(track: Track, found: Pass[Layers], flow: AuditedFlow) -> tuple[Neglected, Neglected]:
    """Return the strain and stress that small-strain theory neglects, in the window and behind."""
    depth, surface = found.after.whole.depth, (found.surface, found.after.top.state)
    top, name = max(float(equivalent(state).max()) for state in surface), track.part.body.name
    places = np.stack([np.zeros_like(depth), -depth])
    strain = largest_strain([(name, places, np.append(top, flow.strained()))])
    return strain.neglected, flow.large_strain(name, track.weights)


def _released(track: Track, material: Law, found: Pass[Layers]) -> float:
    """Return the difference of the state behind the load from that of the law [MPa].

    The state behind follows in one increment from the last column; planes y = const must be free of
    stress.
    """
    states = found.states.packed
    last = found.before.state.unpacked(states[..., -1])
    left = material.respond(found.after.strain(track.elasticity).T, last)
    across = float(np.abs(left.stress[[1, 3]]).max())
    return max(across, difference(material, found.after.state, left.state))


def _lost(material: Law, found: Pass[Layers], left: Layers | None, way: int) -> float:
    """Return the difference between the state before the pass and that behind the last one.

    The largest difference of internal variables counts, as stress over the yield stress. In the
    opposite direction shear has the opposite sign.
    """
    before = found.before.whole.state
    if left is None:
        state = material.initial(len(before.accumulated), 4)
    else:
        state = left.whole.state
        state = state if way == 1 else state.mirrored
    return max(
        float(found.direction != way), difference(material, before, state) / material.yield_stress
    )


def _of_contact(material: Law, found: Pass[Layers]) -> dict[str, float]:
    """Return the figures of the contact with a wheel; empty without a wheel."""
    touching = found.loading
    if not isinstance(touching, RollingContact):
        return {}
    strength = float(material.surface.shear(material.strength(found.after.state)).max())
    return {
        "audit_tension": largest(-touching.normal),
        "audit_friction_excess": largest(
            np.abs(touching.tangential) - np.nan_to_num(touching.bound)
        ),
        "audit_surface_shear": largest(np.abs(touching.shear)) / strength,
        "audit_friction_over_strength": largest(touching.most_shear) / strength,
    }
