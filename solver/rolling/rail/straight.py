"""A prism whose stress does not change along x: its section alone, k = 0, and its initial stress.

With u = (u_x, u_y, u_z)(y, z) the section deforms, and the prism keeps its length and stays
straight. A prism that nothing holds along x also becomes longer, bends and turns, with the strains

    xx: a + b y + c z,    xy: -t z / 2,    zx: t y / 2

S.P. Timoshenko, J.N. Goodier, Theory of Elasticity (3rd edition, 1970), chapters 9 and 10.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.errors import ModelError
from solver.linear.solvers import analyse
from solver.materials.law import Law
from solver.rolling.rail.section import Section
from solver.tensors import SQRT2, to_tensor
from solver.typing import Array


@dataclass(frozen=True, slots=True, eq=False)
class SettledStress:
    """Stress at all n points of a section before any load, in equilibrium.

    Attributes
    ----------
    given, held : (n, 6) arguments of `StraightPrism.settled` that led to it, Mandel [MPa]
    stress : (n, 6) stress, Mandel [MPa]
    strain : (n, 6) elastic strain of it, Mandel
    change : largest component of the change of the given stress by equilibrium [MPa]
    """

    given: Array
    held: Array
    stress: Array
    strain: Array
    change: float


class StraightPrism:
    """The section's own problem, factorised on its free unknowns."""

    def __init__(self, section: Section) -> None:
        self._section = section
        stiffness = section.stiffness(section.free)
        self._solver = analyse(stiffness.pattern)
        self._solver.factorise(stiffness.at(0.0))

    def displacement(self, eigenstress: Array) -> Array:
        """Return the displacement (section.n,) by an eigenstress (n, 6) at all points [mm]."""
        section = self._section
        at = section.weights[..., None] * eigenstress.reshape(*section.weights.shape, 6)
        each = np.einsum("eqab,eqa->eb", section.B0, at)
        force = np.asarray(np.bincount(section.dofs.ravel(), each.ravel(), section.n), dtype=float)
        u = np.zeros(section.n)
        u[section.free] = self._solver.solve(force[section.free])
        return u

    def strain(self, u: Array) -> Array:
        """Return the strain (n, 6) of displacements (section.n,), Mandel."""
        section = self._section
        return np.einsum("eqab,eb->eqa", section.B0, u[section.dofs]).reshape(-1, 6)

    def settled(self, given: Array, held: Array) -> SettledStress:
        """Return the initial stress after given stresses have come to equilibrium.

        Parameters
        ----------
        given : (n, 6) stress, Mandel [MPa]; along x the prism is free: there is no force, nor
            moments
        held : (n, 6) stress, Mandel [MPa], with the length and the direction of the prism held
        """
        C = self._section.elasticity.stiffness(6)
        motions = straight_motions(self._section.points.reshape(2, -1))
        weighted = motions * self._section.weights.reshape(-1, 1, 1)
        each = [self._relaxed(motions[..., k] @ C) for k in range(motions.shape[2])]
        resultants = np.stack([np.tensordot(s, weighted, 2) for s in each], axis=-1)
        free = self._relaxed(given)
        shares = np.linalg.solve(resultants, -np.tensordot(free, weighted, 2))
        free = free + np.tensordot(np.stack(each, axis=-1), shares, 1)
        stress = free + self._relaxed(held)
        return SettledStress(
            given=given,
            held=held,
            stress=stress,
            strain=self._section.elasticity.strain(stress.T).T,
            change=float(np.abs(to_tensor((free - given).T)).max()),
        )

    def _relaxed(self, stress: Array) -> Array:
        """Return a stress (n, 6) brought to equilibrium in a prism that stays straight [MPa]."""
        made = self.strain(self.displacement(-stress))
        return stress + made @ self._section.elasticity.stiffness(6)


def check_elastic(law: Law, strain: Array, points: Array) -> None:
    """Raise `ModelError` for an initial stress at which a material yields.

    Parameters
    ----------
    strain : (n, 6) elastic strain, Mandel
    points : (2, n) positions z, y [mm]
    """
    virgin = law.initial(len(strain), 6)
    beyond = law.yield_value(law.stiffness(6) @ strain.T, virgin)
    most = int(beyond.argmax())
    if beyond[most] > 0:
        strength = float(law.flow_stress(virgin)[most])
        z, y = points[:, most]
        raise ModelError(
            "initial_stress", f"{strength + beyond[most]:.4g} MPa at z = {z:.3g}, y = {y:.3g} mm",
            f"must be below the yield stress of {strength:.4g} MPa before the first pass",
        )  # fmt: skip


def straight_motions(points: Array) -> Array:
    """Return the strains (n, 6, 4) of a longer, bent, bent and turned prism at points (z, y)."""
    z, y = points - points.mean(axis=1, keepdims=True)
    strain = np.zeros((len(z), 6, 4))
    strain[:, 0, :3] = np.stack([np.ones_like(z), y, z], axis=-1)
    strain[:, 3, 3], strain[:, 5, 3] = -z / SQRT2, y / SQRT2
    return strain
