"""Check prescribed shear against the shear that the surface of a body can carry."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from solver.contact.system import System
from solver.errors import LimitLoad, NotConverged, Runaway
from solver.materials.law import Law
from solver.model.loads import TravellingPressure

FAR = 1.0
"""Equivalent plastic strain beyond which no search for a pass has an answer."""


def excess_shear(system: System, targets: Sequence[float]) -> LimitLoad | None:
    """Return the error if a prescribed shear exceeds the shear yield stress, else None.

    Without an amplitude the load factor is the time, up to the farthest of the ``targets``.

    The traction equals the stress at the surface. Without hardening the stress cannot leave the
    yield surface, so a larger shear has no equilibrium.
    """
    for body in system.model.bodies:
        for load in body.every_load:
            if not isinstance(load, TravellingPressure):
                continue
            if load.amplitude is None:
                times = np.union1d(targets, load.shear_ratio.time)
                times = times[np.abs(times) <= np.abs(targets).max(initial=0.0)]
            else:
                times = np.union1d(load.amplitude.time, load.shear_ratio.time)
            now = (load.now(time) for time in times)
            shear = max((abs(share * ratio) for share, _, ratio in now), default=0.0) * load.peak
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


def uncarried(material: Law, shear: float) -> NotConverged | None:
    """Return the error if a shear [MPa] flows the surface without bound or very far, else None.

    Linear hardening carries any shear in the end, but a small modulus only at a plastic strain that
    no small-strain analysis allows.
    """
    linear = material.linear_hardening
    if linear is None or not linear.modulus:
        return too_much_shear(material, shear)
    carried = material.surface.shear(linear.yield_stress + linear.modulus * FAR)
    if shear <= carried:
        return None
    return Runaway(
        f"the prescribed shear, {shear:.4g} MPa, is above {carried:.4g} MPa, which the surface "
        f"carries at a plastic strain of {FAR:.0%}, far beyond small strains; the material "
        "hardens, this is not its limit"
    )
