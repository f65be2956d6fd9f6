"""What a solution must satisfy, checked after the fact from the solution itself."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from solver.constitutive.mises import yield_function
from solver.contact.candidates import find_candidates
from solver.fields import Sampler, error_estimate, recovery

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from solver.outcome import Converged
    from solver.state import State
    from solver.system import System

_EQUILIBRIUM = 1e-6
_CONTACT = 1e-6
_YIELD = 1e-6
_LARGE_STRAIN = 0.10
_SURFACE_SHEAR = 1.1


@dataclass(frozen=True, slots=True)
class Audit:
    """Figures by name, the conditions violated, and warnings."""

    figures: Mapping[str, float]
    violations: tuple[str, ...] = ()
    warnings: tuple[str, ...] = field(default=())

    @property
    def passed(self) -> bool:
        """Whether no condition is violated."""
        return not self.violations


def contact_pressure(
    system: System, state: State, interface: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return pressure and shear on the slave's vertices (n,) [MPa]: means under each hat.

    The multiplier field is piecewise linear; its mean under the hat of a vertex has the same
    resultant and, next to a sharp corner, where the nodal values alternate about the right
    mean, not their ripple.
    """
    contact, chain = state.contacts[interface], system.interfaces[interface].slave_surface
    area = system.interfaces[interface].pairing(state.u).area
    safe = np.where(area > 0, area, 1.0)
    x = chain.X[:, chain.vertices]
    edge = np.linalg.norm(np.diff(x), axis=0)
    measure = chain.measure[chain.edges[:, :2]]
    # consistent mass of the hats on each edge, the depth varying linearly along it
    left = edge / 12 * (3 * measure[:, 0] + measure[:, 1])
    right = edge / 12 * (measure[:, 0] + 3 * measure[:, 1])
    cross = edge / 12 * (measure[:, 0] + measure[:, 1])
    mass = np.diag(np.append(left, 0) + np.append(0, right))
    mass += np.diag(cross, 1) + np.diag(cross, -1)
    total = mass.sum(axis=1)
    smooth = mass / np.where(total > 0, total, 1.0)[:, None]
    pressure, shear = contact.normal / safe, contact.tangential / safe
    return smooth @ pressure, smooth @ shear


def _imbalance(system: System, converged: Converged) -> float:
    """Return external, internal and contact forces out of balance over the force level.

    Computed anew from the stresses, displacements and contact forces of the state.
    """
    state = converged.state
    candidates = find_candidates(system, state, state.u, state.contacts)
    square = 0.0
    for i, (part, u, response) in enumerate(
        zip(system.parts, state.u, converged.responses, strict=True)
    ):
        force = part.residual(state.load, u, response)
        force += candidates.on_part(i, candidates.forces, part.n)
        square += float((force[part.free] ** 2).sum())
    return float(np.sqrt(square)) / (state.force_scale or 1.0)


def _largest(*values: float) -> float:
    """Return the largest value, or NaN where one is NaN, which no limit lets pass."""
    return float(np.max(values))


def _contact_figures(system: System, state: State) -> dict[str, float]:
    candidates = find_candidates(system, state, state.u, state.contacts)
    n, F = candidates.n, candidates.forces
    closed = F[:n] > 0
    gap = candidates.motion[:n]
    excess = 0.0
    if len(F) > n:
        bound = np.concatenate(
            [np.full(len(v), i.friction) for v, i in
             zip(candidates.vertices, system.interfaces, strict=True)]
        ) * np.maximum(F[:n], 0)  # fmt: skip
        excess = float((np.abs(F[n:]) - bound).max(initial=0.0))
    return {
        "audit_overlap": _largest(0.0, -gap.min(initial=0.0), -candidates.beyond),
        "audit_closed_gap": float(np.abs(gap[closed]).max(initial=0.0)),
        "audit_tension": _largest(0.0, -F[:n].min(initial=0.0)),
        "audit_friction_excess": excess,
    }


def audit(
    system: System, loaded: Converged, unloaded: Converged, least_dissipation: float
) -> Audit:
    """Check one run: its state under load and after unloading.

    Figures: relative out-of-balance force; overlap and gap of closed points [mm]; contact
    tension and friction beyond the bound [N]; surface shear over the shear yield stress; yield
    function over the yield stress; least plastic dissipation of an increment [N/mm2]; contact
    force left after unloading [N]; estimated relative discretisation error in the energy norm
    under load and of the residual stress.
    """
    state = loaded.state
    scale = state.force_scale or 1.0
    wholes = [system.full(body.name) for body in system.model.bodies]
    length = max(float(np.ptp(part.X, axis=1).max()) for part in wholes)
    figures = {"audit_residual": _largest(*(_imbalance(system, c) for c in (loaded, unloaded)))}
    figures |= _contact_figures(system, state)

    worst, shear = 0.0, 0.0
    errors = {"loaded": [0.0, 0.0], "residual": [0.0, 0.0]}
    for part in wholes:
        responses = [system.response(part.body.name, c) for c in (loaded, unloaded)]
        material = part.body.material
        for kind, response in zip(errors, responses, strict=True):
            for k, energy in enumerate(error_estimate(part, response.stress)):
                errors[kind][k] += energy
            if not material.elastic:
                f = yield_function(response.stress, response.state, material)
                worst = _largest(worst, float(f.max()) / material.yield_stress)
    for k, interface in enumerate(system.interfaces):
        tangential = np.abs(contact_pressure(system, state, k)[1])
        for number, _, _ in interface.sides:
            material = system.parts[number].body.material
            if not material.elastic:
                strength = material.yield_stress + material.plastic_modulus * float(
                    loaded.responses[number].state.accumulated.max()
                )
                shear = max(shear, float(tangential.max()) * np.sqrt(3) / strength)
    figures |= {
        "audit_surface_shear": shear,
        "audit_yield": worst,
        "audit_dissipation": least_dissipation,
        "audit_contact_after_unloading": float(
            sum(np.abs(c.normal).sum() + np.abs(c.tangential).sum()
                for c in unloaded.state.contacts)
        ),
    }  # fmt: skip
    for kind, (error, energy) in errors.items():
        figures[f"audit_error_{kind}"] = float(np.sqrt(error / energy)) if energy else 0.0

    limits = {
        "audit_residual": _EQUILIBRIUM,
        "audit_overlap": _CONTACT * length,
        "audit_closed_gap": _CONTACT * length,
        "audit_tension": _CONTACT * scale,
        "audit_friction_excess": _CONTACT * scale,
        "audit_yield": _YIELD,
        "audit_contact_after_unloading": _CONTACT * scale,
    }
    violations = [
        f"{name} = {figures[name]:.2e} exceeds {limit:.2e}"
        for name, limit in limits.items()
        if not figures[name] <= limit
    ]
    yield_stress = max(
        (p.body.material.yield_stress for p in system.parts if not p.body.material.elastic),
        default=1.0,
    )
    if not figures["audit_dissipation"] >= -_YIELD * yield_stress:
        violations.append(f"plastic dissipation is negative: {least_dissipation:.2e}")
    largest = max(float(p.accumulated.max(initial=0.0)) for p in unloaded.state.plastic)
    warnings = []
    if largest > _LARGE_STRAIN:
        warnings.append(
            f"equivalent plastic strain reaches {largest:.0%}: small-strain theory is stretched"
        )
    if shear > _SURFACE_SHEAR:
        warnings.append(
            f"surface shear reaches {shear:.2f} of the shear yield stress: refine the mesh"
        )
    return Audit(figures, tuple(violations), tuple(warnings))


def cut_force(
    system: System, body: str, stress: NDArray[np.float64], where: NDArray[np.float64]
) -> float:
    """Return the normal force on a plane cut over the force its area carries at yield.

    ``where`` (2, n) are points along the straight cut; ``stress`` (4, n_points) Mandel. Zero for
    a residual stress that holds itself, but for the discretisation error.
    """
    p = system.full(body)
    along = where[:, -1] - where[:, 0]
    length = float(np.linalg.norm(along))
    n = np.array([along[1], -along[0]]) / length
    s = Sampler(p, where)((recovery(p) @ stress.T).T)
    traction = n[0] ** 2 * s[0] + n[1] ** 2 * s[1] + np.sqrt(2) * n[0] * n[1] * s[3]
    t = np.linalg.norm(where - where[:, :1], axis=0)
    measure = np.broadcast_to(p.measure(where), len(t))
    area = float(np.trapezoid(measure, t))
    return float(np.trapezoid(traction * measure, t)) / (area * p.body.material.yield_stress)
