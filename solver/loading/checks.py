"""Loads that are refused before anything is computed: too much shear, or on bodies nothing holds.

If neither supports nor links hold a body, and its contact pairs are absent or the bodies separated,
a load that moves it has no equilibrium.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from solver.contact.system import System
from solver.errors import LimitLoad, ModelError, NotConverged, Runaway
from solver.fem.discretisation import Discretisation
from solver.fem.nodes import vectors
from solver.fem.part import Part
from solver.fem.rigid import RigidPart
from solver.fem.wheel import Wheel
from solver.loading.program import Program
from solver.loading.step import moving
from solver.materials.elastic_plastic import ElasticPlastic
from solver.materials.law import Law
from solver.model.loads import TravellingPressure
from solver.model.pairs import ContactPair
from solver.typing import Array

_FAR = 1.0
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


_LITTLE = 1e-6
"""Resultant over the largest load on its body: a smaller ratio is rounding."""
_ALONG = 0.1
"""Motion in one direction over the largest: messages name directions above this ratio."""


def uncarried(material: Law, shear: float) -> NotConverged | None:
    """Return the error if a shear [MPa] flows the surface without bound or very far, else None.

    Hardening that goes on carries any shear in the end, but a weak one only at a plastic strain
    that no small-strain analysis allows. Of laws that are not made of a curve and back stresses
    only a shear without bound is known.
    """
    if not (material.hardens and isinstance(material, ElasticPlastic)):
        return too_much_shear(material, shear)
    flowed = replace(material.initial(1, 6), accumulated=np.full(1, _FAR))
    carried = material.surface.shear(material.strength(flowed).item())
    if shear <= carried:
        return None
    return Runaway(
        f"the prescribed shear, {shear:.4g} MPa, is above {carried:.4g} MPa, which the surface "
        f"carries at a plastic strain of {_FAR:.0%}, far beyond small strains; the material "
        "hardens, this is not its limit"
    )


def check_freed(system: System, program: Program) -> None:
    """Raise `ModelError` if a load of a program would move a body while nothing holds it."""
    for number, linked in enumerate(system.links.rows):
        part = system.parts[number]
        if not part.rigid.shape[1] or linked is not None:
            continue
        name = part.body.name
        if name in system.names and not isinstance(part, Wheel):
            part = system.full(name)  # saves the condensation
        pairs = [i.declared for i in system.interfaces if number in (i.slave, i.master)]
        targets, least = program.targets, None
        times = [program.laps[0].start, *(target.time for target in targets)]
        for before, target in zip(times, targets, strict=False):
            held = not target.apart and not all(pair.absent(target.time) for pair in pairs)
            if held or not part.force_level(target.time):
                continue
            own = part.during(before, part.start()) if isinstance(part, RigidPart) else part
            pushed = moving(own, own.external(target.time))
            least = least or _LITTLE * max(part.force_level(time) for time in times)
            if np.linalg.norm(pushed) > least:
                raise ModelError(
                    "supports", getattr(part.body, "supports", {}),
                    f"body {name!r} is free to move {_ways(part, pushed)} at "
                    f"{program.place(target.time)}, but its load acts in this direction: no "
                    "support or link holds it, and "
                    f"{'bodies are separated' if target.apart else _gone(pairs)}. "
                    "End the load before, or hold the body",
                )  # fmt: skip


def _gone(pairs: list[ContactPair]) -> str:
    each = [f"{'.'.join(pair.slave)} and {'.'.join(pair.master)}" for pair in pairs]
    return f"there is no contact between {', or between '.join(each)}"


def _ways(part: Part, pushed: Array) -> str:
    """Return the directions in which a body would move, in words."""
    sizes = np.abs(pushed[-3:])  # motion of a rigid body or a hub
    if isinstance(part, Discretisation):
        each = vectors(pushed, len(part.nodes))
        sizes = np.append(np.abs(each.mean(axis=1)), np.ptp(each, axis=1).max() / 2)
    ways = zip(("along x", "along y", "in rotation"), sizes, strict=True)
    return " and ".join(way for way, size in ways if size > _ALONG * sizes.max())
