"""The stiffness along a step: low in a plastic mechanism, not in other failures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np

from solver.tensors import deviator

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from solver.fem.discretisation import Discretisation
    from solver.fem.part import Part
    from solver.materials import Law, PlasticState, Response

_FLOWING = 0.02
"""Ratio of the tangent to the elastic stiffness along a late step; below it the structure flows."""
_EXHAUSTED = 0.99
"""Ratio of the flow stress to its limit in a law; above it little hardening is left."""
_MECHANISM = 1e-2
"""Like `_FLOWING`, for bodies without load."""
_MOVES = 1e-3
"""Ratio of the elastic energy of a part in a step to that of all; above it the part moves."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SoftestStep:
    """The step with the least stiffness along it.

    ``stiffness`` is the ratio of the tangent to the elastic stiffness along the step. ``body`` and
    ``place`` (x, y) [mm] are where it strains most. ``proves`` says whether vanishing stiffness
    proves a limit load: no hardening is left, and the stress is at no corner of the yield surface.
    ``excludes`` says that the kinematic theorem excludes any equilibrium at this load
    (`collapses`), whatever the state before.
    """

    stiffness: float = 1.0
    body: str = ""
    place: tuple[float, float] = (0.0, 0.0)
    proves: bool = False
    excludes: bool = False

    @property
    def limit(self) -> bool:
        """Whether the step was a plastic mechanism that no hardening resists."""
        return self.stiffness < _FLOWING and (self.proves or self.excludes)

    def __str__(self) -> str:
        x, y = self.place
        return (
            f"body {self.body!r} flows around x = {x:.4g}, y = {y:.4g} mm with "
            f"{self.stiffness:.1%} of its elastic stiffness"
        )


def _forms(
    parts: Sequence[Part], step: Sequence[NDArray[np.float64]], responses: Sequence[Response]
) -> NDArray[np.float64]:
    """Return ``step' K step`` of each part, with tangent and elastic stiffness (n_parts, 2)."""
    each = zip(parts, step, responses, strict=True)
    return np.array([part.stiffness_along(du, response) for part, du, response in each])


def softer(
    than: SoftestStep,
    parts: Sequence[Part],
    step: Sequence[NDArray[np.float64]],
    responses: Sequence[Response],
) -> SoftestStep:
    """Return the softest step: this one (displacements of each part) or ``than``."""
    forms = _forms(parts, step, responses)
    tangent, elastic = forms.sum(axis=0)
    if not elastic > 0 or tangent / elastic >= than.stiffness:
        return than
    most = int((forms[:, 1] - forms[:, 0]).argmax())
    law, at = parts[most].body.law, parts[most].most_strained(step[most])
    return SoftestStep(
        stiffness=max(float(tangent / elastic), 0.0),  # less is rounding
        body=parts[most].body.name,
        place=parts[most].place(at),
        proves=not (law.hardens or law.has_corners) and _exhausted(law, responses[most].state, at),
    )


def _exhausted(law: Law, state: PlasticState, point: int) -> bool:
    """Whether the flow stress at a point is close to its limit, of a law that has one."""
    bound = law.ultimate_shear_stress
    strength = law.shear_strength(state.at(np.array([point])))[0] if np.isfinite(bound) else bound
    return bool(strength >= _EXHAUSTED * bound)


def collapses(
    parts: Sequence[Part],
    time: float,
    moved: Sequence[NDArray[np.float64]],
    forces: Sequence[NDArray[np.float64]],
    responses: Sequence[Response],
) -> bool:
    """Whether the work of out-of-balance forces exceeds the largest plastic dissipation.

    This is the kinematic theorem of limit analysis, which also holds at corners of a yield surface.
    If the forces do more work on a motion than any stress inside the yield surface can do beyond
    the present stress, no equilibrium exists. If the motion changes volume, a mean stress that
    differs by the tensile strength is also admitted.

    Parameters
    ----------
    moved : displacements of each part, with little strain outside the flowing region [mm]
    forces : out-of-balance nodal forces of each part, with contact forces [N]
    """
    elastic = _forms(parts, moved, responses)[:, 1]
    excess = sum(float(force @ u) for force, u in zip(forces, moved, strict=True))
    for part, u, response, share in zip(parts, moved, responses, elastic, strict=True):
        law = part.law(time)
        if share <= _MOVES * elastic.sum():
            continue
        if not part.meshed or np.isinf(law.ultimate_shear_stress):
            return False
        body = cast("Discretisation", part)
        strain = body.strain(u)
        if body.body.kinematics == "plane_stress":
            strain[2] = -strain[0] - strain[1]
        strength = law.ultimate_shear_stress / law.surface.shear(1.0)
        most = strength * (law.surface.power(strain) + np.abs(strain[:3].sum(axis=0)))
        excess -= float((most - (response.stress * deviator(strain)).sum(axis=0)) @ part.volumes)
    return excess > 0


def is_mechanism(
    parts: Sequence[Part],
    time: float,
    step: Sequence[NDArray[np.float64]],
    responses: Sequence[Response],
) -> bool:
    """Whether a step is a plastic mechanism in a part, although no body has a load.

    Overlapping bodies push each other apart by a given distance. Without stiffness the plastic
    strain that achieves this is not unique, and rounding would determine it.
    """
    if any(part.external(time).any() for part in parts):
        return False
    tangent, elastic = _forms(parts, step, responses).T
    moves = elastic > _MOVES * elastic.sum()
    return bool((tangent < _MECHANISM * elastic)[moves].any())
