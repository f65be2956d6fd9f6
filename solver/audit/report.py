"""The audit of one run: its figures, their limits, violations and warnings."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from solver.audit.bodies import (
    AuditedBody,
    action_reaction,
    imbalance,
    imbalance_released,
    misplaced,
    reactions,
)
from solver.audit.figures import LIMITS
from solver.audit.large_strain import large_strain
from solver.audit.links import least_energy, links_error, turned
from solver.audit.pairs import AuditedPair, contact_error
from solver.audit.plain import LEAST, PlainBody
from solver.audit.theory import accumulated_strain, elastic_strain, plastic_strain
from solver.contact.state import Converged
from solver.contact.system import System
from solver.fem.discretisation import Discretisation
from solver.fem.error import error_estimate
from solver.loading.integration import missed
from solver.typing import Array

_WARNED = {
    "audit_surface_shear": (
        1.1, "surface shear reaches {:.2f} of the shear yield stress: refine the mesh"
    ),
    "audit_error_contact": (
        0.1, "contact pressure has an estimated error of {:.0%}: use smaller elements there"
    ),
}  # fmt: skip
"""Figures with a warning: the value above which it is given, and its text."""
_REACTIONS, _MOVING = 1e-5, 5e-3
"""Limits of ``audit_reactions``; the second is for loads that move, such as a Hertz pressure: its
steep ends cause an error of integration."""
_ENERGY, _TURNING = 1e-5, 0.02
"""Limits of ``audit_energy``; the second is for finite sliding, whose normals rotate within an
increment."""
_FORCE = 1e-6
"""Limit of forces over the force level."""
_SEVERED = 1e-4
"""Force of removed elements over the force level, at most; with more they hold a part cut off."""


@dataclass(frozen=True, slots=True)
class Audit:
    """The audit of a run.

    Attributes
    ----------
    figures : values of the figures by name
    violations : messages on conditions that the solution violates
    warnings : messages on results that need attention
    outside : messages on strain, sliding or rotation too large for small-strain theory; the run is
        solved correctly, but its equations do not describe the bodies
    """

    figures: Mapping[str, float]
    violations: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    outside: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether no condition is violated; a run that passes may still be ``outside``."""
        return not self.violations


def _largest(*values: float) -> float:
    """Return the largest value, or NaN if one is NaN: NaN violates every limit."""
    return float(np.max(values))


def audit(
    system: System,
    loaded: Converged,
    unloaded: Converged | None,
    least_dissipation: float,
    lost: float = 0.0,
    stages: Iterable[Converged] = (),
) -> Audit:
    """Return the audit of a run: of its state under load and, if any, of that after unloading.

    ``least_dissipation`` [MPa] and ``lost`` are the extremes over all increments, see `Tally`.
    Strain is checked at the end of all ``stages``. In space there is no estimate of the error of
    the mesh, and large strain is estimated from plastic strain only.
    """
    states = (loaded, unloaded or loaded)
    plain = [PlainBody(system.full(body.name)) for body in system.model.bodies]
    bodies, released = (
        [AuditedBody(system, body, converged) for body in plain] for converged in states
    )
    pairs = [AuditedPair(system, k, loaded) for k in range(len(system.interfaces))]
    broken, beyond = _laws(bodies, released)
    every = list({id(each): each for each in (*stages, *states)}.values())
    names = ("audit_overlap", "audit_closed_gap", "audit_tension", "audit_friction_excess",
             "audit_slip", "audit_contact_resolution")  # fmt: skip
    figures = {
        "audit_residual": _largest(
            imbalance(system, bodies, loaded), imbalance(system, released, states[1])
        ),
        "audit_reactions": reactions(bodies, pairs, loaded),
        "audit_action_reaction": action_reaction(system, bodies, pairs, loaded),
        "audit_prescribed": misplaced(system, plain, every),
        "audit_law": broken,
        "audit_yield": beyond,
        "audit_increment_error": _largest(*(missed(system, converged) for converged in states)),
        **{name: _largest(0.0, *(pair.figures[name] for pair in pairs)) for name in names},
        "audit_links": _largest(*(links_error(system, converged) for converged in states)),
        "audit_energy": _energy_error(system, bodies, loaded),
        "audit_touch_time": loaded.timing.unknown,
        "audit_slip_resolution": loaded.timing.passage,
        "audit_dissipation": least_dissipation,
        "audit_history": lost,
        "audit_contact_after_unloading": imbalance_released(released) if unloaded else 0.0,
    }  # fmt: skip
    figures |= _strength(system, loaded)
    plane = all(body.dim == 2 for body in system.model.bodies)
    if plane:
        figures |= _discretisation(system, states, loaded.energy.scale)
    figures["audit_error_contact"] = contact_error(system, loaded)
    neglected = [plastic_strain(system, every).neglected]
    neglected += [large_strain(system, plain, every)] if plane else []
    fixed = any(body.of_small_strain or body.dim == 3 for body in system.model.bodies)
    mend = "" if fixed else ' or set strain = "large"'
    if any(body.large_region for body in system.model.bodies):
        mend = " or make the region of large strain larger"
    figures["audit_plastic_strain"] = accumulated_strain(system, states[1])
    figures["audit_large_strain"] = _largest(*(each.share for each in neglected))
    figures["audit_small_sliding"] = max(
        (p.left_out.sides for p in pairs if p.left_out), default=0.0
    )
    return Audit(
        figures,
        violations=_violations(system, figures, loaded, pairs) + _severed([*bodies, *released]),
        warnings=sum((pair.warnings for pair in pairs), warnings(figures))
        + system.distorted(loaded.state),
        outside=tuple(text + mend for each in neglected for text in each.outside)
        + elastic_strain(system, every).outside
        + sum((pair.outside for pair in pairs), turned(system, loaded)),
    )


def _laws(bodies: Sequence[AuditedBody], released: Sequence[AuditedBody]) -> tuple[float, float]:
    """Return the largest deviation from the law, and stress beyond yield, over the strength."""
    broken, beyond = 0.0, 0.0
    for both in zip(bodies, released, strict=True):
        strength = max(*(body.strength for body in both), 1e-300)
        for off, over in (body.law() for body in both):
            broken = _largest(broken, off / strength)
            beyond = _largest(beyond, over / strength)
    return broken, beyond


def _energy_error(system: System, bodies: Sequence[AuditedBody], loaded: Converged) -> float:
    """Return the error of the energy balance, over the largest term of the balance so far."""
    work, springs = loaded.energy, system.links.energy(loaded.state.links)
    terms = np.array([
        sum(body.stored() for body in bodies) + springs, -work.stored, work.plastic, work.friction,
        work.contact, -work.external,
    ])  # fmt: skip
    least = least_energy(system, loaded.state.force_scale)
    level = max(float(np.abs(terms).max()), work.scale, least)
    return abs(float(terms.sum())) / level if level else 0.0


def _strength(system: System, loaded: Converged) -> dict[str, float]:
    """Return contact shear, and the shear that friction permits, over the shear yield stress."""
    shear, friction = 0.0, 0.0
    for k, interface in enumerate(system.interfaces):
        state, start = loaded.state, loaded.start
        pressure, tangential = system.pressure(state, k)
        bound = system.bound(k, system.pairing(state, k), start, state.time).least(pressure)
        for number, _, _ in interface.sides:
            part = system.parts[number]
            if not isinstance(part, Discretisation):
                continue
            law = part.law(loaded.state.time)
            if law.elastic:
                continue
            strength = float(law.surface.shear(law.strength(loaded.responses[number].state)).max())
            shear = max(shear, float(np.abs(tangential).max()) / strength)
            friction = max(friction, float(bound.max()) / strength)
    return {"audit_surface_shear": shear, "audit_friction_over_strength": friction}


def _discretisation(
    system: System, states: tuple[Converged, Converged], scale: float
) -> dict[str, float]:
    """Return the estimated relative errors of stress in the energy norm.

    They refer to an energy of at least the rounding level of the run.
    """
    names = [body.name for body in system.model.bodies]
    return {
        f"audit_error_{kind}": estimated_error(
            ((system.full(name), system.state(name, converged).stress) for name in names),
            LEAST**2 * scale,
        )
        for kind, converged in zip(("loaded", "residual"), states, strict=True)
    }


def estimated_error(bodies: Iterable[tuple[Discretisation, Array]], least: float = 0.0) -> float:
    """Return the estimated relative error of the stress of bodies in the energy norm.

    A smaller energy than ``least`` [N mm] is replaced by it.
    """
    error, energy = 0.0, 0.0
    for body, stress in bodies:
        here = error_estimate(body, stress)
        error, energy = error + here[0], energy + here[1]
    level = max(energy, least)
    return float(np.sqrt(error / level)) if level else 0.0


def _violations(
    system: System,
    figures: Mapping[str, float],
    loaded: Converged,
    pairs: Sequence[AuditedPair],
) -> tuple[str, ...]:
    limits = limits_at(
        loaded.state.force_scale or 1.0,
        moving=any(load.moves for body in system.model.bodies for load in body.every_load),
        turning=system.model.large or any(contact.finite for contact in loaded.state.contacts),
    )
    yield_stress = max(
        (p.body.material.yield_stress for p in system.parts if not p.body.material.elastic),
        default=1.0,
    )
    found = sum((_beyond(pair.figures, pair.limits) for pair in pairs), ())
    return broken(figures, limits, yield_stress) + found


def _severed(bodies: Sequence[AuditedBody]) -> tuple[str, ...]:
    """Return messages on bodies whose removed elements still transmit force."""
    found: dict[str, float] = {}
    for body in bodies:
        share = body.force_of_removed / (body.force_level or 1)
        found[body.name] = _largest(found.get(body.name, 0.0), share)
    return tuple(
        f"removed elements of {name} transmit {share:.2g} of the force: nothing else holds the "
        "part that is cut off. Hold this part, or end its loads before"
        for name, share in found.items()
        if not share <= _SEVERED
    )


def limits_at(scale: float, *, moving: bool = False, turning: bool = False) -> dict[str, float]:
    """Return the limits of the figures that every kind of run has.

    Parameters
    ----------
    scale : force level [N]
    moving : whether a load moves along a body
    turning : whether contact normals or bodies rotate within an increment
    """
    return LIMITS | {
        "audit_reactions": _MOVING if moving else _REACTIONS,
        "audit_energy": _TURNING if turning else _ENERGY,
        "audit_tension": _FORCE * scale,
        "audit_friction_excess": _FORCE * scale,
        "audit_contact_after_unloading": _FORCE * scale,
    }


def broken(
    figures: Mapping[str, float], limits: Mapping[str, float], yield_stress: float
) -> tuple[str, ...]:
    """Return messages on violations: figures beyond their limits, and negative dissipation."""
    found = _beyond(figures, limits)
    if not figures["audit_dissipation"] >= -LIMITS["audit_yield"] * yield_stress:
        found += (f"plastic dissipation is negative: {figures['audit_dissipation']:.2e}",)
    return found


def _beyond(figures: Mapping[str, float], limits: Mapping[str, float]) -> tuple[str, ...]:
    return tuple(
        f"{name} = {figures[name]:.2e} exceeds {limit:.2e}"
        for name, limit in limits.items()
        if not figures[name] <= limit
    )


def warnings(figures: Mapping[str, float]) -> tuple[str, ...]:
    """Return the warnings that follow from figures."""
    return tuple(
        text.format(figures[name])
        for name, (limit, text) in _WARNED.items()
        if figures.get(name, 0.0) > limit
    )
