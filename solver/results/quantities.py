"""What the variables of a data set mean: names and units, for every scene."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Quantity:
    """What a variable means; `count` marks whole numbers."""

    long_name: str
    units: str = "1"
    standard_name: str = ""
    count: bool = False

    @property
    def attributes(self) -> dict[str, str]:
        """CF attributes."""
        given = {
            "long_name": self.long_name,
            "units": self.units,
            "standard_name": self.standard_name,
        }
        return {key: value for key, value in given.items() if value}


QUANTITIES: Mapping[str, Quantity] = {
    "x": Quantity("position along the surface from its middle", "mm"),
    "y": Quantity("height above the surface", "mm"),
    "depth": Quantity("depth below the surface", "mm", "depth"),
    "station": Quantity("position of a depth profile along the surface", "mm"),
    "s": Quantity("distance along the surface from the middle, of the contact if loaded", "mm"),
    "residual_stress": Quantity("residual stress", "MPa"),
    "residual_mises": Quantity("von Mises stress of the residual stress", "MPa"),
    "plastic_strain": Quantity("equivalent plastic strain"),
    "mises_loaded": Quantity("von Mises stress under load", "MPa"),
    "residual_profile": Quantity("residual stress along depth", "MPa"),
    "plastic_strain_profile": Quantity("equivalent plastic strain along depth"),
    "surface_residual": Quantity("residual stress at the contact surface", "MPa"),
    "contact_pressure": Quantity("contact pressure", "MPa"),
    "contact_shear": Quantity("contact shear traction on the lower body along x", "MPa"),
    "contact_gap": Quantity("gap between the contact surfaces under load", "mm"),
    "surface_mises": Quantity("von Mises stress at the surface of the lower body", "MPa"),
    "contact_half_width": Quantity("half-width of the contact under load", "mm"),
    "peak_contact_pressure": Quantity("largest contact pressure under load", "MPa"),
    "max_plastic_strain": Quantity("largest equivalent plastic strain"),
    "max_plastic_strain_punch": Quantity("largest equivalent plastic strain in the punch"),
    "max_plastic_strain_half_plane": Quantity(
        "largest equivalent plastic strain in the half-plane"
    ),
    "depth_of_max_plastic_strain": Quantity(
        "depth of the largest plastic strain; negative in the upper body", "mm"
    ),
    "plastic_work": Quantity("plastic work of the computed part of the bodies", "N mm"),
    "peak_residual_tension": Quantity("largest normal component of the residual stress", "MPa"),
    "peak_residual_compression": Quantity(
        "smallest normal component of the residual stress", "MPa"
    ),
    "residual_x_half_plane": Quantity(
        "residual stress xx on the half-plane, 0.005 half-widths inside the corner", "MPa"
    ),
    "residual_x_punch": Quantity(
        "residual stress xx on the punch, 0.028 half-widths inside the corner", "MPa"
    ),
    "pass": Quantity("number of the pass", count=True),
    "pass_creepage": Quantity("creepage of a pass: 1 + R d(rotation) / d(advance)"),
    "pass_max_plastic_strain": Quantity("largest equivalent plastic strain after a pass"),
    "plastic_flow_profile": Quantity("signed plastic strain along depth"),
    "pass_plastic_increment": Quantity(
        "largest equivalent plastic strain accumulated in a cycle, mid-track"
    ),
    "pass_net_increment": Quantity(
        "largest equivalent of the signed plastic strain a cycle leaves, mid-track"
    ),
    "pass_net_shear": Quantity("largest plastic shear (engineering) a cycle leaves, mid-track"),
    "pass_surface_advance": Quantity("displacement along x a cycle gives the surface", "mm"),
    "shakedown_state": Quantity("shakedown state that the passes tend to", count=True),
    "steady_plastic_increment": Quantity("plastic strain accumulated in a cycle, in the end"),
    "steady_net_increment": Quantity("signed plastic strain a cycle leaves, in the end"),
    "creepage": Quantity("creepage of the last pass"),
    "advance": Quantity("advance of an increment that was taken", "mm"),
    "advance_error": Quantity(
        "estimated error of residual stress under mid-track that the advance leaves", "MPa"
    ),
    "travel": Quantity("length rolled in the last pass", "mm"),
    "surface_residual_x": Quantity(
        "residual stress xx at the surface, mid-track, extrapolated to its nodes", "MPa"
    ),
    "surface_residual_z": Quantity(
        "residual stress zz at the surface, mid-track, extrapolated to its nodes", "MPa"
    ),
    "first_row_residual_x": Quantity(
        "residual stress xx at the first row of integration points, mid-track", "MPa"
    ),
    "first_row_residual_z": Quantity(
        "residual stress zz at the first row of integration points, mid-track", "MPa"
    ),
    "first_row_depth": Quantity("depth of the first row of integration points, mid-track", "mm"),
    "free_surface_residual_x": Quantity(
        "residual stress xx at the surface, mid-track, by the conditions of a free surface", "MPa"
    ),
    "free_surface_residual_z": Quantity(
        "residual stress zz at the surface, mid-track, by the conditions of a free surface", "MPa"
    ),
    "lowest_residual_x": Quantity("smallest residual stress xx under mid-track", "MPa"),
    "lowest_residual_z": Quantity("smallest residual stress zz under mid-track", "MPa"),
    "depth_of_lowest_residual_x": Quantity("depth of the smallest residual stress xx", "mm"),
    "depth_of_lowest_residual_z": Quantity("depth of the smallest residual stress zz", "mm"),
    "surface_plastic_strain": Quantity("equivalent plastic strain at the surface, mid-track"),
    "highest_plastic_strain": Quantity("largest equivalent plastic strain under mid-track"),
    "depth_of_highest_plastic_strain": Quantity(
        "depth of the largest plastic strain under mid-track", "mm"
    ),
    "unsteadiness": Quantity(
        "largest difference of residual stress between stations / largest residual stress"
    ),
    "axle_height": Quantity("displacement of the axle at mid-track", "mm"),
    "axle_rotation": Quantity(
        "rotation of the wheel at mid-track, counter-clockwise, from how it is meshed there", "rad"
    ),
    "longitudinal_force": Quantity("longitudinal force on the track along x, mid-track", "N"),
    "increments": Quantity("load increments", count=True),
    "cut_increments": Quantity("load increments that were cut", count=True),
    "iterations": Quantity("Newton iterations", count=True),
    "median_iterations": Quantity("median Newton iterations an increment"),
    "inner_fallbacks": Quantity("iterations whose contact problem needed pivoting", count=True),
    "blended_tangents": Quantity("iterations with a stiffened tangent", count=True),
    "cpu_seconds": Quantity("processor time", "s"),
    "degrees_of_freedom": Quantity("degrees of freedom", count=True),
    "audit_residual": Quantity("force out of balance / largest force"),
    "audit_reactions": Quantity("loads, contact and reactions of a body out of balance / force"),
    "audit_action_reaction": Quantity(
        "contact force less what the stress of either body holds / contact force"
    ),
    "audit_law": Quantity("stress off the material law, stated anew / yield stress"),
    "audit_increment_error": Quantity(
        "change of stress that four steps for one make in the last increment / yield stress"
    ),
    "audit_overlap": Quantity(
        "mean overlap of the deformed bodies, or mean gap where they press", "mm"
    ),
    "audit_closed_gap": Quantity("mean gap or overlap where the bodies press", "mm"),
    "audit_slip": Quantity("friction work that slip lacks / friction work"),
    "audit_energy": Quantity("work of the loads not found again / work"),
    "audit_tension": Quantity("largest tensile contact force", "N"),
    "audit_friction_excess": Quantity("largest tangential force beyond friction", "N"),
    "audit_surface_shear": Quantity("largest contact shear / shear yield stress"),
    "audit_friction_over_strength": Quantity(
        "friction times contact pressure / shear yield stress: above 1 the surface shears instead "
        "of slipping"
    ),
    "audit_yield": Quantity("largest stress beyond the yield surface / yield stress"),
    "audit_dissipation": Quantity(
        "smallest plastic dissipation of an increment in a unit of volume", "MPa"
    ),
    "audit_contact_after_unloading": Quantity(
        "force that the stress of the released bodies still needs from loads or contact", "N"
    ),
    "audit_error_loaded": Quantity("estimated relative error of stress under load, energy norm"),
    "audit_error_residual": Quantity("estimated relative error of residual stress, energy norm"),
    "audit_free_surface": Quantity("residual stress across the free side / yield stress"),
    "audit_self_equilibrium": Quantity("net residual force on a cut plane, relative"),
}
