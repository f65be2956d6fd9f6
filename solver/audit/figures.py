"""The figures of the audit, which every run has; `docs/explanation/audit.md` explains them."""

from __future__ import annotations

from solver.results.quantities import Quantity, declare

_DECLARED = [
    declare("audit_residual", "ratio of the force out of balance to the largest force"),
    declare(
        "audit_reactions",
        "ratio of the sum of loads, contact forces and reactions of a body to the largest force",
    ),
    declare(
        "audit_action_reaction",
        "ratio of the difference between contact force and stress of either body to the force",
    ),
    declare(
        "audit_prescribed",
        "ratio of the largest difference from displacements that supports, loads and motions "
        "prescribe to the largest displacement",
    ),
    declare(
        "audit_links",
        "ratio of the motion that links should prevent, or of their force out of balance, to the "
        "largest motion of what they join, or to the largest force",
    ),
    declare(
        "audit_law", "ratio of the deviation of stress from the material law to the yield stress"
    ),
    declare(
        "audit_increment_error",
        "ratio of the estimated error of stress that the length of all increments makes, root mean "
        "square where plastic strain grew, to the yield stress",
    ),
    declare(
        "audit_overlap", "mean overlap of the deformed bodies, or mean gap where they press", "mm"
    ),
    declare("audit_closed_gap", "mean gap or overlap where the bodies press", "mm"),
    declare(
        "audit_contact_resolution",
        "ratio of the longest edge in the contact of curved surfaces to the width of the contact",
    ),
    declare("audit_slip", "ratio of the friction work that slip lacks to the friction work"),
    declare(
        "audit_touch_time",
        "ratio of the friction of vertices that touched at unknown times to the largest friction",
    ),
    declare(
        "audit_slip_resolution",
        "ratio of the motion of a contact in an increment to its width, weighted with its force",
    ),
    declare("audit_energy", "ratio of the work missing in the energy balance to the largest work"),
    declare("audit_tension", "largest tensile contact force", "N"),
    declare("audit_friction_excess", "largest tangential force above the friction bound", "N"),
    declare("audit_surface_shear", "ratio of the largest contact shear to the shear yield stress"),
    declare(
        "audit_friction_over_strength",
        "ratio of the largest shear that friction allows under the contact pressure to the shear "
        "yield stress: above 1 the surface shears instead of slipping",
    ),
    declare(
        "audit_yield", "ratio of the largest stress beyond the yield surface to the yield stress"
    ),
    declare(
        "audit_dissipation",
        "smallest plastic dissipation of an increment per unit of volume", "MPa",
    ),
    declare(
        "audit_history",
        "ratio of the difference between the end of an increment or pass and the beginning of the "
        "next to the yield stress",
    ),
    declare(
        "audit_contact_after_unloading",
        "force out of balance with the stress of the released bodies", "N",
    ),
    declare(
        "audit_inflow",
        "ratio of the plastic strain added where material enters the window of a steady pass to "
        "the largest that the pass adds, at least 0.05 yield strains",
    ),
    declare(
        "audit_outflow",
        "ratio of the plastic strain added behind the window of a steady pass to the largest added",
    ),
    declare(
        "audit_steadiness",
        "2 G times the deviator of the difference between the strain in the material law and that "
        "of equilibrium in a steady pass, as a ratio to the yield stress",
    ),
    declare(
        "audit_length",
        "ratio of the stress that the longest length of the far field of a prism adds to the yield "
        "stress",
    ),
    declare(
        "audit_initial_stress",
        "ratio of the largest change of the given initial stress of a prism, on its way to "
        "equilibrium, to the yield stress",
    ),
    declare(
        "audit_plastic_strain", "largest accumulated plastic strain away from singular points"
    ),
    declare(
        "audit_large_strain",
        "share of stress or of plastic strain that small-strain theory leaves out, largest at the "
        "stages",
    ),
    declare(
        "audit_small_sliding",
        "ratio of the motion along the partner that small sliding leaves out to the side of an "
        "element",
    ),
    declare("audit_error_loaded", "estimated relative error of stress under load, energy norm"),
    declare(
        "audit_error_contact",
        "ratio of the integrated estimated error of contact pressure under load to the force",
    ),
    declare("audit_error_residual", "estimated relative error of residual stress, energy norm"),
]  # fmt: skip

AUDIT: dict[str, Quantity] = {figure.name: figure for figure in _DECLARED}
"""The figures, by name."""

LIMITS = {
    "audit_residual": 1e-6,
    "audit_action_reaction": 1e-3,
    "audit_prescribed": 1e-6,
    "audit_links": 1e-3,
    "audit_law": 1e-6,
    "audit_yield": 1e-6,
    "audit_increment_error": 0.15,
    "audit_slip": 0.03,
    "audit_touch_time": 0.1,
    "audit_slip_resolution": 0.5,
    "audit_history": 1e-6,
}
"""Limits that are the same for all runs; `solver.audit.report.limits_at` adds those of a run."""
