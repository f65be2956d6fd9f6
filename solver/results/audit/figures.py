"""The figures of the audit, which every run has; `docs/audit.md` explains them."""

from __future__ import annotations

from solver.results.quantities import Quantity, declare

_DECLARED = [
    declare("audit_residual", "force out of balance / largest force"),
    declare("audit_reactions", "loads, contact and reactions of a body out of balance / force"),
    declare(
        "audit_action_reaction",
        "contact force minus the force by the stress of either body / contact force",
    ),
    declare("audit_law", "deviation of stress from the material law / yield stress"),
    declare(
        "audit_increment_error",
        "change of stress if the last increment is divided into four / yield stress",
    ),
    declare(
        "audit_overlap", "mean overlap of the deformed bodies, or mean gap where they press", "mm"
    ),
    declare("audit_closed_gap", "mean gap or overlap where the bodies press", "mm"),
    declare(
        "audit_contact_resolution",
        "longest edge in the contact of curved surfaces / width of the contact",
    ),
    declare("audit_slip", "friction work missing in slip / friction work"),
    declare(
        "audit_touch_time",
        "friction of vertices that touched at unknown times, summed / largest friction of contact",
    ),
    declare(
        "audit_slip_resolution",
        "motion of a contact along a surface in an increment / width, weighted with its force",
    ),
    declare("audit_energy", "work missing in the energy balance / work"),
    declare("audit_tension", "largest tensile contact force", "N"),
    declare("audit_friction_excess", "largest tangential force above the friction bound", "N"),
    declare("audit_surface_shear", "largest contact shear / shear yield stress"),
    declare(
        "audit_friction_over_strength",
        "largest shear that friction allows under the contact pressure / shear yield stress: above "
        "1 the surface shears instead of slipping",
    ),
    declare("audit_yield", "largest stress beyond the yield surface / yield stress"),
    declare(
        "audit_dissipation",
        "smallest plastic dissipation of an increment per unit of volume", "MPa",
    ),
    declare(
        "audit_history",
        "difference between the end of an increment or pass and the beginning of the next / yield "
        "stress",
    ),
    declare(
        "audit_contact_after_unloading",
        "force out of balance with the stress of the released bodies", "N",
    ),
    declare(
        "audit_inflow",
        "plastic strain added where material enters the window of a steady pass / largest plastic "
        "strain added by the pass, at least 0.05 yield strains",
    ),
    declare(
        "audit_outflow",
        "plastic strain added behind the window of a steady pass / largest plastic strain added",
    ),
    declare(
        "audit_steadiness",
        "difference between the strain in the material law and that of equilibrium in a steady "
        "pass, its deviator times 2 G / yield stress",
    ),
    declare(
        "audit_plastic_strain", "largest equivalent plastic strain away from singular points"
    ),
    declare(
        "audit_small_sliding",
        "motion along the partner that small sliding leaves out / side of an element",
    ),
    declare(
        "audit_stored",
        "difference between stored and recomputed results of a run / scale of the quantity",
    ),
    declare("audit_error_loaded", "estimated relative error of stress under load, energy norm"),
    declare(
        "audit_error_contact",
        "estimated error of contact pressure under load, absolute, integrated / contact force",
    ),
    declare("audit_error_residual", "estimated relative error of residual stress, energy norm"),
]  # fmt: skip

AUDIT: dict[str, Quantity] = {figure.name: figure for figure in _DECLARED}
"""The figures, by name."""
