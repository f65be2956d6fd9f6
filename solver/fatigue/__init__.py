"""Fatigue: criteria on paths of stress and strain over a cycle, at points.

It knows arrays alone, neither bodies nor scenes::

    DangVan(torsion=352.0, bending=541.0).assess(Paths(stress)).safety_factor
"""

from __future__ import annotations

from solver.late import front

_HOMES = {
    "Assessment": "criterion", "Criterion": "criterion", "PlaneCriterion": "criterion",
    "TwoLimits": "criterion", "CRITERIA": "criteria", "Paths": "paths", "OnPlanes": "planes",
    "critical_planes": "planes",
    "Crossland": "crossland", "DangVan": "dang_van", "Findley": "findley", "Matake": "matake",
    "FatemiSocie": "fatemi_socie", "SmithWatsonTopper": "smith_watson_topper",
    "BrownMiller": "brown_miller",
    "stress_intensity": "cracks", "opened_range": "cracks", "arrest": "cracks",
    "surface_index": "rolling", "subsurface_index": "rolling", "t_gamma": "rolling",
    "crack_damage": "rolling",
}  # fmt: skip
__all__ = sorted(_HOMES)  # noqa: PLE0605
__getattr__ = front(__name__, _HOMES)
