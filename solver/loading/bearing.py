"""Check prescribed shear against the shear yield stress of the material."""

from __future__ import annotations

import numpy as np

from solver.contact.system import System
from solver.errors import LimitLoad
from solver.materials.law import Law


def excess_shear(system: System) -> LimitLoad | None:
    """Return the error if a prescribed shear exceeds the shear yield stress, else None.

    The traction equals the stress at the surface. Without hardening the stress cannot leave the
    yield surface, so a larger shear has no equilibrium.
    """
    for body in system.model.bodies:
        travelling = body.travelling
        if travelling is None:
            continue
        times = np.union1d(travelling.amplitude.time, travelling.shear_ratio.time)
        now = (travelling.now(time) for time in times)
        shear = max(abs(share * ratio) for share, _, ratio in now) * travelling.peak
        if (limit := too_much_shear(body.material, shear)) is not None:
            return limit
    return None


def too_much_shear(material: Law, shear: float) -> LimitLoad | None:
    """Return the error if a shear [MPa] on a surface exceeds the shear yield stress, else None."""
    strength = material.ultimate_shear_stress
    if shear <= strength:
        return None
    return LimitLoad(
        f"the prescribed shear, {shear:.4g} MPa, is above the shear yield stress, "
        f"{strength:.4g} MPa: no equilibrium without hardening",
        strength / shear,
        1.0,
    )
