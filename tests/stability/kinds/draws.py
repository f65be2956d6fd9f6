"""What seeded families draw from, and how they tell what they drew."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from solver.scenes.material_parameters import MaterialParameters

RULES = ("none", "isotropic", "kinematic", "mixed")
RATIOS = (0.0, 1e-6, 1e-4, 0.01, 0.024, 0.1, 0.5)
POISSON = (0.0, 0.3, 0.3, 0.45, 0.49, 0.4999)


def changed(parameters: MaterialParameters) -> str:
    """Return the parameters that differ from the defaults of their scene."""
    default = type(parameters)()
    given = {f.name: getattr(parameters, f.name) for f in fields(parameters)}
    return ", ".join(f"{k}={v!r}" for k, v in given.items() if v != getattr(default, k))
