"""The audit of a load in a patch of contact on a prism: resultants, gap, friction, slip."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from solver.audit.pairs import COARSE, GAP, OVERLAP, PRESSED, STILL
from solver.materials.law import Law
from solver.model.friction import pressure_lines
from solver.rolling.audit.flow import largest
from solver.rolling.rail.friction_cone import NORMAL, TANGENTS
from solver.rolling.rail.half_space import half_space
from solver.rolling.rail.patch import RollingPatch
from solver.rolling.rail.patch_contact import EllipticPatch, PatchContact, PatchLoad
from solver.typing import Array

_FORCE = 1e-6
"""Largest tension and friction excess, over the force."""


class AuditedPatch:
    """Tractions on the surface of a prism, and the load that they come from.

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
        """Return the largest difference of a resultant from what is prescribed, over the force."""
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
        """Limits of those figures that depend on the contact."""
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
        """Return the friction work missing because of wrong slip, over the friction work.

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
