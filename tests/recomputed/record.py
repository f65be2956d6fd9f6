"""One loop over the declared quantities of a record: each is compared with its own value.

Own values follow from displacements, internal variables, contact forces and declared loads at the
places that view and scene file declare. The samplers, the recovery and the outputs that made the
record are not used. Of a field some values are computed, and the largest. `RULES` has the rule of
each quantity; `FORMULAS` names those that a formula of their own makes, with tests of their own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from solver.results.body_fields import STORED
from solver.results.named_places import NamedPlaces
from solver.results.record import Record
from solver.results.run import FinishedRun
from solver.results.view import View
from solver.tensors import AXES
from tests.recomputed.numbers import of_number
from tests.recomputed.rules import Own, Rules


def differences(
    run: FinishedRun, record: Record, view: View, places: NamedPlaces | None
) -> Iterator[str]:
    """Yield each quantity of a record that differs from its own value."""
    rules = Rules(run, record, view, places)
    numbers = {q.name: number for number in rules.numbers for q in number.quantities}
    fields = {name: (dims, np.asarray(values)) for name, (dims, values) in record.fields.items()}
    fields |= {name: ((name,), np.asarray(given)) for name, given in record.coordinates.items()}
    fields |= {name: ((), np.asarray(value)) for name, value in record.scalars.items()}
    for name, (dims, values) in fields.items():
        stored = (
            values[-1] if dims and dims[0] == "pass" and name not in record.coordinates else values
        )
        if name in numbers:
            own = of_number(rules, numbers[name]).get(name)
        else:
            own = RULES[name](rules) if name in RULES else None
        if own is not None and (text := difference(stored, own)):
            yield f"{name} {text}"
    vars(rules).clear()  # its caches hold it in a circle, and with it the run


def difference(stored: Any, own: Own) -> str:
    """What is wrong with stored values; empty if nothing is."""
    values = np.asarray(own.values)
    if stored.shape != values.shape:
        return f"has the shape {stored.shape}, not {values.shape}"
    if values.dtype.kind not in "fiub":
        return "" if (stored == values).all() else f"is {stored}, not {values}"
    known, nothing = np.isfinite(values), np.isinf(values)
    if np.isfinite(stored[nothing]).any():
        return "has values outside the bodies"
    off = np.abs(stored[known] - values[known]) - np.broadcast_to(own.allowed, values.shape)[known]
    worst = np.argmax(np.where(np.isnan(off), np.inf, off)) if off.size else 0
    if not off.size or off[worst] <= 0:
        return ""
    return f"is {stored[known][worst]:.9g}, not {values[known][worst]:.9g}"


RULES: dict[str, Callable[[Rules], Own | None]] = {
    "residual_stress": lambda own: own.map("residual_stress", "stress"),
    "plastic_strain": lambda own: own.map("plastic_strain", "plastic_strain"),
    "stress_difference": Rules.stress_difference,
    "residual_profile": lambda own: own.profile("stress"),
    "profile_plastic_strain": lambda own: own.profile("plastic_strain"),
    "surface_residual": Rules.surface_residual,
    "surface_mises": Rules.surface_mises,
    "peak_contact_pressure": Rules.peak,
    "contact_half_width": Rules.half_width,
    "max_plastic_strain": Rules.most_strained,
    **{
        f"max_plastic_strain_{body}": partial(Rules.most_strained, bodies=(body,))
        for body in ("punch", "half_plane")
    },
    "depth_of_max_plastic_strain": Rules.depth_of_most,
    "peak_residual_tension": lambda own: own.peak_residual(np.nanmax),
    "peak_residual_compression": lambda own: own.peak_residual(np.nanmin),
    "line_s": Rules.line_s,
}  # fmt: skip
for _field in STORED:
    RULES[f"map_{_field}"] = partial(Rules.map, name=f"map_{_field}", field=_field)
    for _kind in ("line", "point"):
        RULES[f"{_kind}_{_field}"] = partial(Rules.at_places, kind=_kind, field=_field)
for _kind in ("pressure", "shear", "gap"):
    RULES[f"contact_{_kind}"] = partial(Rules.contact_line, kind=_kind)
for _kind in ("pressure_deformed", "slip", "x", "y", "s"):
    RULES[f"contact_{_kind}"] = partial(Rules.contact, kind=_kind)
for _name in ("residual_max", "residual_min", "surface_residual_max", "surface_residual_min"):
    RULES[_name] = partial(Rules.extreme, name=_name)
    for _axis in "s" if _name.startswith("surface") else AXES:
        RULES[f"{_name}_{_axis}"] = partial(Rules.extreme, name=_name, axis=_axis)
for _name in ("contact_normal_force", "contact_tangential_force", "reaction_x", "reaction_y",
              "motion_x", "motion_y", "motion_rotation"):  # fmt: skip
    RULES[_name] = partial(Rules.course, name=_name)
for _name in ("x", "y", "z", "depth", "station", "s", "component", "stage", "body", "line", "point",
              "contact", "part"):  # fmt: skip
    RULES[_name] = partial(Rules.coordinate, name=_name)
for _k, _axis in enumerate(AXES):
    RULES[f"point_displacement_{_axis}"] = partial(Rules.displacement, axis=_k)
    for _kind in ("line", "point"):
        RULES[f"{_kind}_{_axis}"] = partial(Rules.place, kind=_kind, axis=_k)

_FORMULAS = """
    singular_power singular_power_error singular_intensity apparent_power fraction
    peak_contact_pressure_s increment increment_time force approach mean_contact_pressure
    crater_depth pile_up pile_up_radius surface_displacement increment_force increment_approach
    increment_radius loading_curvature irreversible_work
    pressure_error stick_half_width stick_fraction plastic_work increments
    cut_increments iterations median_iterations inner_fallbacks blended_tangents cpu_seconds
    degrees_of_freedom hoop_stress outline outline_x outline_y singular singular_x singular_y
    singular_s singular_radius residual_x_half_plane residual_x_punch cycle
    cycle_plastic_increment cycle_net_increment cycle_dissipation shakedown_state
    steady_plastic_increment steady_net_increment pass plastic_flow_profile pass_creepage
    pass_max_plastic_strain pass_plastic_increment pass_net_increment pass_net_shear
    pass_surface_advance creepage travel advance advance_error surface_residual_x
    surface_residual_z first_row_residual_x first_row_residual_z free_surface_residual_x
    free_surface_residual_z lowest_residual_x lowest_residual_z depth_of_lowest_residual_x
    depth_of_lowest_residual_z first_row_depth surface_plastic_strain highest_plastic_strain
    depth_of_highest_plastic_strain unsteadiness longitudinal_force axle_height axle_rotation
    patch_pressure patch_shear_x patch_shear_z patch_slip_x patch_slip_z patch_status
    peak_patch_pressure peak_patch_pressure_z patch_area patch_left patch_right lateral_force
    running_surface_residual lowest_loaded highest_mises highest_mises_depth most_strained_z
    least_yielded_depth most_yielded_depth pass_residual_min mean_plastic_increment
    mean_net_increment hertz_pressure hertz_a hertz_b hertz_approach axle_lateral_creepage
    map_fatigue_utilisation fatigue_utilisation_profile line_fatigue_utilisation
    fatigue_utilisation fatigue_safety_factor fatigue_x fatigue_y fatigue_z fatigue_plane_x
    fatigue_plane_y fatigue_plane_z fatigue_plastic_strain fatigue_applies
    instant fatigue_path_hydrostatic fatigue_path_shear fatigue_path_limit
    crack_K_largest crack_K_smallest crack_K_range crack_arrest_depth crack_least_range
    crack_applies
    wear_depth slip_length slip_work slip_share fretting_parameter
    tip tip_x tip_y tip_z K_I K_II K_I_faces K_II_faces
    computed_accuracy spin_moment wheel_surface pass_load pass_lateral_position pass_traction
    outline_z
"""
FORMULAS = _FORMULAS.split()
"""Quantities that a formula makes of fields, history or cost of a run."""
