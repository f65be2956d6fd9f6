"""Autofrettage with reversed yield: a tube in plane strain by finite elements along its radius.

Von Mises, linear hardening, kinematic (Prager) and isotropic in given shares; small strain. The
unknown is the radial displacement, quadratic on each element; two Gauss points each, which spare
it from locking. Stresses and strains have three components: radial, hoop, axial.

References
----------
J.C. Simo, T.J.R. Hughes, Computational Inelasticity (1998), box 3.1 (radial return) and 3.2 (its
tangent).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from math import sqrt
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

Array = NDArray[np.float64]

DEVIATOR = np.eye(3) - 1 / 3
ROUNDS = 40  # of Newton's method; it is quadratic, so more means that the wall has no strength left


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """What the Gauss points keep: plastic strain and back stress (3, n), equivalent strain (n,)."""

    plastic_strain: Array
    back_stress: Array
    equivalent: Array

    @classmethod
    def virgin(cls, n: int) -> Self:
        """Return the state of a material that never yielded."""
        return cls(
            plastic_strain=np.zeros((3, n)), back_stress=np.zeros((3, n)), equivalent=np.zeros(n)
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Steel:
    """A bilinear material; ``tangent_modulus`` is the slope of its curve of tension beyond yield.

    ``kinematic_share`` of the hardening moves the yield surface, the rest widens it. Moduli and
    stresses in MPa, ``expansion`` in 1/K.
    """

    youngs_modulus: float
    poisson_ratio: float
    yield_stress: float
    tangent_modulus: float = 0.0
    kinematic_share: float = 1.0
    expansion: float = 0.0

    @property
    def plastic_modulus(self) -> float:
        """Slope of stress over plastic strain H = E Et / (E - Et)."""
        E, Et = self.youngs_modulus, self.tangent_modulus
        return E * Et / (E - Et)

    def respond(self, strain: Array, state: State) -> tuple[Array, Array, State]:
        """Return stress (3, n), its tangent (3, 3, n) and the new state, by radial return.

        ``strain`` is elastic and plastic strain (3, n); the equations are implicit in time.
        """
        E, nu, H = self.youngs_modulus, self.poisson_ratio, self.plastic_modulus
        G, K = E / (2 * (1 + nu)), E / (3 * (1 - 2 * nu))
        share = self.kinematic_share
        volume = strain.sum(axis=0)
        trial = 2 * G * (DEVIATOR @ (strain - state.plastic_strain))
        shifted = trial - state.back_stress
        length = np.sqrt((shifted**2).sum(axis=0))
        normal = shifted / np.where(length > 0, length, 1.0)
        radius = self.yield_stress + (1 - share) * H * state.equivalent
        excess = sqrt(3 / 2) * length - radius
        step = np.where(excess > 0, excess, 0.0) / (3 * G + H)
        flow = sqrt(3 / 2) * step * normal
        stress = trial - 2 * G * flow + K * volume
        turn = np.where(step > 0, 3 * G * step / (sqrt(3 / 2) * np.maximum(length, 1e-300)), 0.0)
        along = np.where(step > 0, 3 * G / (3 * G + H), 0.0) - turn
        tangent = (
            K * np.ones((3, 3, 1))
            + 2 * G * (1 - turn) * DEVIATOR[:, :, None]
            - 2 * G * along * normal[:, None] * normal[None]
        )
        after = State(
            plastic_strain=state.plastic_strain + flow,
            back_stress=state.back_stress + 2 / 3 * share * H * flow,
            equivalent=state.equivalent + step,
        )
        return stress, tangent, after


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile:
    """Stresses (3, n) at the Gauss points ``r`` (n,), the displacement of the bore, the state."""

    r: Array
    stress: Array
    bore_displacement: float
    state: State

    def at_bore(self) -> Array:
        """Return radial, hoop and axial stress at the bore, from the line through two points."""
        (r, s), inner = self.r[:2], self.stress[:, :2]
        bore = r - (s - r) * (1 - 1 / sqrt(3)) / (2 / sqrt(3))
        return inner[:, 0] + (inner[:, 1] - inner[:, 0]) * (bore - r) / (s - r)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlasticTube:
    """A thick-walled tube on ``elements`` elements, whose lengths grow with the radius."""

    inner: float
    outer: float
    steel: Steel
    elements: int = 200

    def history(
        self,
        loads: Iterable[tuple[float, float]],
        temperature: Callable[[Array], Array] = np.zeros_like,
        steps: int = 20,
    ) -> list[Profile]:
        """Return the profile at the end of each leg of a path of load, from no load.

        A load is the internal pressure [MPa] and the factor of ``temperature``, a function of the
        radius; on each leg both change in proportion, in ``steps`` steps.

        Raises
        ------
        RuntimeError
            A pressure that the wall does not bear.
        """
        mesh = _Mesh.graded(self.inner, self.outer, self.elements)
        warmth = self.steel.expansion * temperature(mesh.r)
        state, u = State.virgin(len(mesh.r)), np.zeros(mesh.n)
        before, result = np.zeros(2), []
        for load in loads:
            for share in np.arange(1, steps + 1) / steps:
                pressure, factor = before + share * (np.array(load) - before)
                u, stress, state = self._balance(mesh, u, state, pressure, factor * warmth)
            before = np.array(load)
            result.append(
                Profile(r=mesh.r, stress=stress, bore_displacement=float(u[0]), state=state)
            )
        return result

    def _balance(
        self, mesh: _Mesh, u: Array, state: State, pressure: float, warmth: Array
    ) -> tuple[Array, Array, State]:
        """Return displacement, stress and state in balance with the pressure, by Newton."""
        force = np.zeros(mesh.n)
        force[0] = pressure * self.inner
        scale = self.steel.yield_stress * self.inner
        for _ in range(ROUNDS):
            stress, tangent, after = self.steel.respond(mesh.strain(u) - warmth, state)
            residual = mesh.forces(stress) - force
            if np.abs(residual).max() < 1e-7 * scale:
                return u, stress, after
            u = u - solveh_banded(mesh.stiffness(tangent), residual, lower=True)
            if not np.abs(u).max() < self.outer:
                break
        raise RuntimeError(f"the wall does not bear a pressure of {pressure:.6g} MPa")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Mesh:
    """Quadratic elements: Gauss points r, weights r dr, and strains of the nodal displacements."""

    r: Array
    weight: Array
    rows: Array  # (elements, 2, 3 components, 3 nodes): the strains at an element's points

    @classmethod
    def graded(cls, inner: float, outer: float, elements: int) -> Self:
        edges = np.geomspace(inner, outer, elements + 1)
        t = np.array([-1, 1]) / sqrt(3)
        shape = np.stack([t * (t - 1) / 2, 1 - t**2, t * (t + 1) / 2], axis=-1)
        slope = np.stack([t - 0.5, -2 * t, t + 0.5], axis=-1)
        half = np.diff(edges)[:, None] / 2
        r = (edges[1:] + edges[:-1])[:, None] / 2 + half * t
        rows = np.zeros((elements, 2, 3, 3))
        rows[:, :, 0] = slope / half[..., None]
        rows[:, :, 1] = shape / r[..., None]
        return cls(r=r.ravel(), weight=r * half, rows=rows)

    @property
    def n(self) -> int:
        return 2 * len(self.rows) + 1

    @property
    def _nodes(self) -> NDArray[np.int64]:
        return 2 * np.arange(len(self.rows))[:, None] + np.arange(3)

    def strain(self, u: Array) -> Array:
        return np.einsum("egci,ei->ceg", self.rows, u[self._nodes]).reshape(3, -1)

    def forces(self, stress: Array) -> Array:
        local = np.einsum("egci,ceg,eg->ei", self.rows, self._by_element(stress), self.weight)
        return np.bincount(self._nodes.ravel(), local.ravel(), self.n)

    def stiffness(self, tangent: Array) -> Array:
        """Return the lower bands (3, n) of the symmetric matrix."""
        C = self._by_element(tangent)
        local = np.einsum("egci,cdeg,egdj,eg->eij", self.rows, C, self.rows, self.weight)
        bands = np.zeros((3, self.n))
        for i in range(3):
            for j in range(i + 1):
                np.add.at(bands[i - j], self._nodes[:, j], local[:, i, j])
        return bands

    def _by_element(self, values: Array) -> Array:
        return values.reshape(*values.shape[:-1], len(self.rows), 2)
