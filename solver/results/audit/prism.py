"""The audit of a steady pass over a prism: yield, history, and what the window cuts off."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.materials.state import Response
from solver.results.audit.report import Audit, broken, limits_at
from solver.results.audit.theory import largest_strain
from solver.steady.flow import INFLOW, LEAST
from solver.steady.passing import TOLERANCE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.materials.law import Law
    from solver.prism.state import PrismState
    from solver.prism.track import PrismTrack
    from solver.steady import Pass

    Array = NDArray[np.float64]

_LIMITS = {"audit_inflow": INFLOW, "audit_steadiness": TOLERANCE}


def audit_prism(
    track: PrismTrack, law: Law, found: Pass[PrismState], previous: Pass[PrismState] | None
) -> Audit:
    """Check a steady pass over a prism.

    Parameters
    ----------
    previous : the pass before it, None for the first one
    """
    strain = np.moveaxis(found.before.strain[:, None] + found.strain, 2, 0).reshape(6, -1)
    after, before = (
        each.unpacked(each.packed.reshape(len(each.packed), -1))
        for each in (found.states, found.ago)
    )
    stress = law.stiffness(6) @ (strain - after.plastic_strain)
    response = Response(stress, np.zeros((6, 6, 0)), after, np.zeros(0, dtype=bool))
    yield_strain = law.yield_stress / law.elasticity.youngs_modulus
    most = max(LEAST * yield_strain, found.most_added)
    double_shear = 2 * law.elasticity.shear_modulus
    left = law.initial(len(found.before.accumulated), 6) if previous is None else None
    earlier = left if previous is None else previous.after.state
    assert earlier is not None
    lost = np.abs(found.before.plastic_strain.T - earlier.plastic_strain).max()
    z, y = track.points
    large = largest_strain([("rail", np.stack([z, y]), found.after.accumulated)])
    figures = {
        "audit_law": _largest(law.misfit(strain, stress, before, after)) / law.yield_stress,
        "audit_yield": _largest(law.yield_value(stress, after)) / law.yield_stress,
        "audit_dissipation": float(law.dissipation(before, response).min()),
        "audit_history": float(lost) * double_shear / law.yield_stress,
        "audit_inflow": _largest(found.accumulated[:, 0] - found.before.accumulated) / most,
        "audit_outflow": _largest(found.after.accumulated - found.accumulated[:, -1]) / most,
        "audit_steadiness": double_shear * found.left_over / law.yield_stress,
        "audit_plastic_strain": large.value,
    }
    limits = {name: at for name, at in (limits_at(1.0) | _LIMITS).items() if name in figures}
    violations = broken(figures, limits, law.yield_stress)
    return Audit(figures, violations=violations, outside=large.outside)


def _largest(values: Array) -> float:
    """Return the largest value, not below zero, or NaN where one is NaN."""
    return float(np.maximum(values.max(), 0.0))
