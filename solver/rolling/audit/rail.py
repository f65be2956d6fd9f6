"""The audit of a steady pass over a prism: its load on a patch of contact, and the pass."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from solver.audit.pairs import COARSE, GAP, OVERLAP, PRESSED, STILL
from solver.audit.report import Audit, limits_at
from solver.audit.theory import largest_strain
from solver.materials.law import Law
from solver.model.friction import pressure_lines
from solver.rolling.audit.flow import (
    INFLOW,
    STEADINESS,
    AuditedFlow,
    deviation,
    difference,
    judged,
    largest,
)
from solver.rolling.audit.plain_rail import PlainPrism
from solver.rolling.passing import Pass
from solver.rolling.rail.flow import PrismState
from solver.rolling.rail.friction_cone import NORMAL, TANGENTS
from solver.rolling.rail.half_space import half_space
from solver.rolling.rail.patch import RollingPatch
from solver.rolling.rail.patch_contact import AppliedPatch, EllipticPatch, PatchContact, PatchLoad
from solver.rolling.rail.track import PrismTrack
from solver.typing import Array, Ints

_FORCE = 1e-6
"""Limit of tension and of friction excess, over the force."""


class AuditedPatch:
    """Tractions on the surface of a prism, and the load that causes them.

    Parameters
    ----------
    law : law of the prism
    width : (m,) integrals of the hats [mm]
    surface : (n, m, 3) displacement of the surface under the load [mm]
    strength : shear yield stress behind the load [MPa]

    Attributes
    ----------
    force : sum of the sizes of the normal forces [N]
    """

    def __init__(
        self,
        law: Law,
        load: PatchLoad,
        contact: PatchContact,
        width: Array,
        surface: Array,
        *,
        strength: float,
    ) -> None:
        self._law, self._load, self._contact, self._strength = law, load, contact, strength
        self._area = contact.grid.spacing * width
        angle = contact.grid.angle
        cos, sin = np.cos(angle), np.sin(angle)
        self._axes = np.zeros((len(angle), 3, 3))
        self._axes[:, 0, 0] = 1.0
        self._axes[:, 1, 1:] = np.stack([cos, -sin], axis=1)
        self._axes[:, 2, 1:] = np.stack([sin, cos], axis=1)
        self._local = np.einsum("jab,cjb->cja", self._axes, contact.traction)
        self._surface = np.einsum("jab,cjb->cja", self._axes, surface)
        self._pressure = -self._local[..., NORMAL]
        self._normal = self._pressure * self._area
        self.force = float(np.abs(self._normal).sum())
        self._closed = self._normal > PRESSED * self.force

    def missing(self) -> float:
        """Return the largest difference of a resultant from the prescribed one, over the force."""
        load, contact = self._load, self._contact
        given: list[float] = []
        if isinstance(load, EllipticPatch):
            wanted = load.load.force * np.array([load.shear[0], -1.0, load.shear[1]])
            given = list((self._local * self._area[:, None]).sum(axis=(0, 1)) - wanted)
        elif isinstance(load, RollingPatch):
            force = (contact.traction * self._area[:, None]).sum(axis=(0, 1))
            given = [force[1] + load.load.force]
            if load.load.lateral_force is not None:
                given.append(force[2] - load.load.lateral_force)
            if load.load.drive is not None:  # the moment on the axle, over its radius
                _, motions = load.wheel.rolling(contact.grid)
                arm = -motions[1][..., TANGENTS] / contact.grid.spacing
                work = (arm * self._local[..., TANGENTS] * self._area[:, None]).sum()
                given.append(work - load.load.drive)
        return float(np.abs(given).max(initial=0.0)) / self.force

    @cached_property
    def figures(self) -> dict[str, float]:
        """The figures of a wheel; empty for a load that is given."""
        if not isinstance(self._load, RollingPatch):
            return {}
        shear = np.linalg.norm(self._local[..., TANGENTS], axis=-1)
        lines = pressure_lines(self._load.friction, 1, self._law.shear_yield_stress)
        bound = lines.least(self._pressure.ravel()).reshape(self._pressure.shape)
        gap = self._effects[..., NORMAL]
        pressed = np.where(self._closed, self._normal, 0.0)
        area = float((self._area * self._closed).sum())
        mean = float((np.abs(gap) * pressed).sum() / pressed.sum())
        deep = float((np.maximum(-gap, 0.0) * self._area).sum())
        return {
            "audit_overlap": max(deep / area, mean),
            "audit_closed_gap": mean,
            "audit_tension": largest(-self._normal),
            "audit_friction_excess": largest((shear - bound) * self._area),
            "audit_slip": self._wrong_slip(bound),
            "audit_contact_resolution": self._coarseness(),
            "audit_surface_shear": largest(shear) / self._strength,
            "audit_friction_over_strength": largest(bound) / self._strength,
        }

    @property
    def limits(self) -> dict[str, float]:
        """Limits of the figures that depend on the contact."""
        return {
            "audit_overlap": OVERLAP[0] * self.approach,
            "audit_closed_gap": GAP * self.approach,
            "audit_tension": _FORCE * self.force,
            "audit_friction_excess": _FORCE * self.force,
            "audit_contact_resolution": COARSE,
        }

    @cached_property
    def approach(self) -> float:
        """Peak pressure over contact modulus, times the root of the area of contact [mm]."""
        assert isinstance(self._load, RollingPatch)
        moduli = [
            each.youngs_modulus / (1 - each.poisson_ratio**2)
            for each in (self._law.elasticity, self._load.wheel.elasticity)
        ]
        area = float((self._area * self._closed).sum())
        return float(self._pressure.max()) * sum(1 / each for each in moduli) * np.sqrt(area)

    @cached_property
    def _effects(self) -> Array:
        """Slip and gap (n, m, 3) between surface and wheel, in local axes [mm]."""
        load, contact = self._load, self._contact
        assert isinstance(load, RollingPatch)
        grid = contact.grid
        n, m = self._pressure.shape
        lengths = np.hypot(np.diff(grid.z), np.diff(grid.y))
        kernel = half_space(
            np.append(0.0, np.cumsum(lengths)), grid.spacing, n, load.wheel.elasticity
        )
        acts = (self._local * [-1.0, 1.0, -1.0]).reshape(n, -1)  # its normal is the opposite one
        by_station = kernel.reshape(2 * n, 3 * m, 3 * m)
        wheel = np.stack([
            sum(by_station[at - by] @ acts[by] for by in range(n) if acts[by].any())
            for at in range(n)
        ]).reshape(n, m, 3)  # fmt: skip
        moved = self._surface - wheel * [1.0, -1.0, 1.0]
        rest, motions = load.wheel.rolling(grid)
        rigid = contact.height, contact.creepage, contact.lateral_creepage, contact.spin
        effects = rest + np.tensordot(rigid, motions, 1)
        effects[..., NORMAL] -= moved[..., NORMAL]
        u = moved[..., TANGENTS]
        effects[2:, :, TANGENTS] += 1.5 * u[2:] - 2.0 * u[1:-1] + 0.5 * u[:-2]
        return np.asarray(effects)

    def _wrong_slip(self, bound: Array) -> float:
        """Return the friction work that is missing because of wrong slip, over the friction work.

        Slip is wrong if the shear is below its bound, or does not oppose it.
        """
        slip, judged = self._effects[..., TANGENTS], self._closed.copy()
        judged[:2] = False  # their slip depends on displacements upstream of the grid
        size, weight = np.linalg.norm(slip, axis=-1), (bound * self._area)[judged]
        should = float(weight @ np.maximum(size[judged], STILL * self.approach))
        if should == 0.0:
            return 0.0
        work = -(self._local[..., TANGENTS] * slip).sum(axis=-1) * self._area
        return (float(weight @ size[judged]) - float(work[judged].sum())) / should

    def _coarseness(self) -> float:
        """Return the distance of points over the width of the contact, along or across."""
        closed, grid = self._closed, self._contact.grid
        along = 1 / max(int(closed.sum(axis=0).max()), 1)
        most = closed[int(closed.sum(axis=1).argmax())]
        width = self._area / grid.spacing
        return max(along, float(width[most].max() / width[most].sum()))


_LENGTH = 0.01
"""Limit of the stress of the last level of the far field, over the yield stress."""
_ROWS = 16
"""Number of rows of points along which the law is evaluated again: the rows that yield most, and
others."""
_LIMITS = {"audit_inflow": INFLOW, "audit_steadiness": STEADINESS, "audit_length": _LENGTH}


def audit_prism(
    track: PrismTrack,
    law: Law,
    found: Pass[PrismState],
    left: PrismState | None,
    plain: PlainPrism | None = None,
) -> Audit:
    """Check a steady pass over a prism: the state under load, that behind it, and the flow.

    Parameters
    ----------
    law : the declared law of the prism
    left : state that the pass before it left, in the coordinates of the prism; None for the first
    plain : second evaluation of the track, which passes over it share

    Returns
    -------
    The figures, those of the contact only for a wheel.
    """
    loading = found.loading
    assert isinstance(loading, AppliedPatch)
    plain = plain or PlainPrism(track)
    traction = loading.contact.traction
    before, after = found.before, found.after
    stiff = 2 * law.elasticity.shear_modulus
    waves = plain.waves(stiff * (found.plastic_strain - before.plastic_strain[:, None]), traction)
    surface = plain.surface(waves, traction) + before.displacement
    patch = AuditedPatch(
        law, loading.load, loading.contact, plain.width, surface,
        strength=float(law.surface.shear(law.strength(after.state)).max()),
    )  # fmt: skip
    # behind of all passes, not of this one: what each leaves over must not add up
    left_strain, left_surface = plain.constant(stiff * after.plastic_strain)
    left_strain += track.initial_strain
    under_load = np.delete(_left_before(track, plain, before), track.modes.points, axis=0)
    under_load += plain.beside(waves)
    left_outside = np.delete(left_strain, track.modes.points, axis=0)
    unsteady = deviation(plain.strain(waves) - found.strain)
    unsteady_behind = deviation(left_strain[track.modes.points] - after.strain)
    residual = law.stiffness(6) @ (after.strain - after.plastic_strain).T
    flow = AuditedFlow(law, found, before.strain)
    rim = (found.accumulated - before.accumulated[:, None])[track.rim]
    strain = largest_strain([("section", track.points, flow.strained())])
    neglected = strain.neglected, flow.large_strain("section", track.weights)
    figures = {
        "audit_residual": plain.unbalanced(waves) / patch.force,
        "audit_reactions": max(
            patch.missing(), largest(np.abs(plain.reactions(waves))[:3]) / patch.force
        ),
        "audit_law": max(flow.misfit(), flow.retraced(_rows(found)), _released(law, found))
        / law.yield_stress,
        "audit_yield": max(
            flow.beyond(),
            largest(law.yield_value(residual, after.state)),
            *(_beyond_outside(law, each) for each in (left_outside, under_load)),
        )
        / law.yield_stress,
        "audit_dissipation": flow.dissipation(),
        "audit_history": max(
            _lost(track, law, found, left),
            _unsettled(track, plain) / law.yield_stress,
            _apart(after.displacement, left_surface),
        ),
        "audit_inflow": max(flow.inflow(), flow.over_most(rim) if rim.size else 0.0),
        "audit_outflow": flow.outflow(),
        "audit_steadiness": stiff * max(unsteady, unsteady_behind) / law.yield_stress,
        "audit_length": _far(track, law, plain.resultants(waves.pulled)) / law.yield_stress,
        "audit_initial_stress": track.initial.change / law.yield_stress if track.initial else 0.0,
        "audit_plastic_strain": largest(after.accumulated),
        **patch.figures,
    }  # fmt: skip
    limits = limits_at(patch.force) | _LIMITS
    if patch.figures:
        limits |= patch.limits
    return judged(law, figures, limits, neglected)


def _rows(found: Pass[PrismState]) -> Ints:
    """Return the rows to evaluate again: half of them yield most, half lie anywhere."""
    added = (found.accumulated - found.before.accumulated[:, None]).max(axis=1)
    count = min(_ROWS, len(added)) // 2
    anywhere = np.linspace(0, len(added) - 1, count).astype(np.int64)
    return np.unique(np.append(np.argsort(-added)[:count], anywhere))


def _left_before(track: PrismTrack, plain: PlainPrism, before: PrismState) -> Array:
    """Return the strain (n, 6) before the pass at all points of the section."""
    if not before.plastic_strain.any():
        return track.initial_strain
    stress = 2 * track.elasticity.shear_modulus * before.plastic_strain
    return plain.constant(stress)[0] + track.initial_strain


def _beyond_outside(law: Law, elastic: Array) -> float:
    """Return the stress beyond yield outside the zone, where no point may flow [MPa].

    Parameters
    ----------
    elastic : (n, 6) strain at points there
    """
    virgin = law.initial(len(elastic), 6)
    return largest(law.yield_value(law.stiffness(6) @ elastic.T, virgin))


def _released(law: Law, found: Pass[PrismState]) -> float:
    """Return the difference of the state behind from that of the law [MPa].

    The law is evaluated from the last station, on the way to the strain without load.
    """
    before, after, parts = found.before, found.after, found.parts
    start = (before.strain + found.strain[:, -1]).T
    state = after.state.unpacked(found.states.packed[..., -1])
    for part in range(1, parts + 1):
        state = law.respond(start + part / parts * (after.strain.T - start), state).state
    return difference(law, after.state, state)


def _unsettled(track: PrismTrack, plain: PlainPrism) -> float:
    """Return the difference of the initial stress from that of the second evaluation [MPa]."""
    if track.initial is None:
        return 0.0
    stress = plain.initial_stress(track.initial.given, track.initial.held)
    own = track.initial_strain @ track.elasticity.stiffness(6)
    return float(np.abs(own - stress).max())


def _lost(track: PrismTrack, law: Law, found: Pass[PrismState], left: PrismState | None) -> float:
    """Return the difference between the state before the pass and that behind the last one.

    It is the largest difference of internal variables and strain, as stress over the yield stress,
    or of displacement, over the largest. The first pass begins with the initial stress.
    """
    before, displacement = found.before, np.zeros_like(found.before.displacement)
    if left is None:
        state = law.initial(len(before.strain), 6)
        strain = track.initial_strain[track.modes.points]
    else:
        state, strain, displacement = left.state, left.strain, left.displacement
    off = 2 * law.elasticity.shear_modulus * float(np.abs(before.strain - strain).max())
    off = max(difference(law, before.state, state), off) / law.yield_stress
    return max(off, _apart(before.displacement, displacement))


def _apart(one: Array, other: Array) -> float:
    """Return the largest difference of displacements, over the largest of them."""
    off = float(np.abs(one - other).max())
    return off / max(float(np.abs(each).max()) for each in (one, other)) if off else 0.0


def _far(track: PrismTrack, law: Law, resultants: Array) -> float:
    """Return the stress that the last level of the far field adds where the load is [MPa]."""
    if track.far is None:
        return 0.0
    return float(np.abs((track.far.last @ resultants) @ law.stiffness(6)).max())
