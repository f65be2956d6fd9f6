"""Plane stress for any law: the projected return, or the thickness strain solved at each point."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver.materials.elasticity import Elasticity
from solver.materials.law import Law, Wrapped
from solver.materials.radial_return import SQRT23, LinearHardening
from solver.materials.state import PlasticState, Response
from solver.typing import Array, Bools, Ints

_ZZ = 2
_ROUNDING = float(np.finfo(float).eps)
"""Ratio of stress zz to the magnitude of its terms; up to it stress zz is rounding."""
_SMALL = 1e-9
"""The same ratio for laws that iterate and are less exact: it counts if further steps do not reduce
stress zz."""
_MOST_OF_STRAIN = 100
"""Largest number of iterations for the strain across the plane."""


def condensed(stiffness: Array) -> Array:
    """Return stiffnesses (n, n, ...) on Mandel strain [MPa] with stress zz kept at zero.

    The result is ``D - d d' / D_zz`` with d the column zz of D; its row and column zz are zero.
    """
    D = stiffness
    out = np.asarray(D - D[:, _ZZ, None] * D[None, _ZZ] / D[_ZZ, _ZZ])
    out[_ZZ] = 0.0
    out[:, _ZZ] = 0.0
    return out


def _without_zz(strain: Array, state: PlasticState, C: Array) -> Array:
    """Return strains whose zz row makes stress zz zero at the plastic strain of the state."""
    elastic = strain - state.plastic_strain
    elastic[_ZZ] = 0.0
    whole = strain.copy()
    whole[_ZZ] = state.plastic_strain[_ZZ] - C[_ZZ] @ elastic / C[_ZZ, _ZZ]
    return whole


@dataclass(frozen=True, slots=True)
class PlaneStress(Wrapped):
    """Any law in plane stress, with four components; the zz row of strain is not read.

    Von Mises with linear hardening has `projected_return`; for any other law:

    1. strain zz from the elastic stiffness, plastic strain frozen
    2. Newton's method for stress zz = 0; stress zz grows with strain zz. If a step leaves the
       bracket of strains known to be too small and too large, the bracket is halved instead
    3. tangent condensed, stress zz set to zero

    Attributes
    ----------
    law : the wrapped law, which needs all strain components

    References
    ----------
    E.A. de Souza Neto, D. Peric, D.R.J. Owen, Computational Methods for Plasticity (2008),
    section 9.2.2: the constraint solved at the point, and its consistent tangent.
    """

    law: Law

    def at(self, points: Ints) -> PlaneStress:
        """Return the law of some points."""
        return replace(self, law=self.law.at(points))

    def misfit(
        self, strain: Array, stress: Array, before: PlasticState, after: PlasticState
    ) -> Array:
        """Return the misfit of the wrapped law at the strain zz that makes stress zz zero [MPa]."""
        C = self.law.stiffness(len(strain))
        return self.law.misfit(_without_zz(strain, after, C), stress, before, after)

    def stiffness(self, n_components: int) -> Array:
        """Return the elastic stiffness, row and column zz zero [MPa]."""
        if self.law.linear_hardening:
            return plane_stiffness(self.elasticity)
        return condensed(self.law.stiffness(n_components))

    def respond(self, strain: Array, state: PlasticState) -> Response:
        """Return stress with zz = 0, consistent tangent and new state.

        If no such strain is found, stress is NaN and the increment does not converge.
        """
        linear = self.law.linear_hardening
        if linear:
            return projected_return(strain, state, self.elasticity, linear)
        C = self.law.stiffness(len(strain))
        whole = _without_zz(strain, state, C)
        scale = C[_ZZ, _ZZ] * (np.abs(whole) + np.abs(state.plastic_strain)).sum(axis=0)
        response = self.law.respond(whole, state)
        open_ = np.flatnonzero(~(np.abs(response.stress[_ZZ]) <= _ROUNDING * scale))
        failed = open_
        if len(open_):
            some = whole[:, open_], state.at(open_), scale[open_]
            whole[_ZZ, open_], solved = self._thickness_strain(*some, C[_ZZ, _ZZ])
            failed = open_[~solved]
            response = self.law.respond(whole, state)
        stress, tangent = response.stress.copy(), response.tangent.copy()
        stress[_ZZ] = 0.0
        stress[:, failed] = np.nan
        tangent[:, :, failed] = C[:, :, None]
        return Response(stress, condensed(tangent), response.state, response.yielding)

    def _thickness_strain(
        self, strain: Array, state: PlasticState, scale: Array, stiff: float
    ) -> tuple[Array, Bools]:
        """Return the strain zz (n,) of points, and whether it makes stress zz zero there (n,)."""
        zz = strain[_ZZ].copy()
        n = len(zz)
        low, high = np.full(n, -np.inf), np.full(n, np.inf)
        best, least = zz.copy(), np.full(n, np.inf)
        going = np.arange(n)
        for _ in range(_MOST_OF_STRAIN):
            trial = strain[:, going]
            trial[_ZZ] = zz[going]
            found = self.law.respond(trial, state.at(going))
            off, slope = found.stress[_ZZ], found.tangent[_ZZ, _ZZ]
            better = np.abs(off) < least[going]
            best[going] = np.where(better, zz[going], best[going])
            low[going] = np.where(off < 0, zz[going], low[going])
            high[going] = np.where(off > 0, zz[going], high[going])
            small = np.minimum(np.abs(off), least[going]) <= _SMALL * scale[going]
            done = (np.abs(off) <= _ROUNDING * scale[going]) | (small & ~better)
            least[going] = np.where(better, np.abs(off), least[going])
            # stress zz grows with strain zz: a tangent that is not positive cannot be used
            step = zz[going] - off / np.where(slope > 0, slope, stiff)
            inside = (step > low[going]) & (step < high[going])
            middle = 0.5 * (low[going] + high[going])
            zz[going] = np.where(inside | ~np.isfinite(middle), step, middle)
            going = going[~done]
            if not len(going):
                break
        return best, least <= _SMALL * scale


# -- von Mises with linear hardening -------------------------------------------------------------

_IN_PLANE = np.array([0, 1, 3])
_MODES = np.array([[1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 0.0, np.sqrt(2.0)]]) / np.sqrt(2.0)
_FROM_ALL = np.zeros((3, 4))
_FROM_ALL[:, _IN_PLANE] = _MODES
_P = np.array([1 / 3, 1.0, 1.0])[:, None]
_MOST_OF_FLOW = 50
"""Largest number of iterations for the plastic multiplier."""


def plane_stiffness(elasticity: Elasticity) -> Array:
    """Return the elastic stiffness (4, 4) on Mandel strain, row and column zz zero [MPa]."""
    return np.asarray((_FROM_ALL.T * _modal_stiffness(elasticity)) @ _FROM_ALL)


def _modal_stiffness(elasticity: Elasticity) -> Array:
    G = elasticity.shear_modulus
    return np.array([elasticity.youngs_modulus / (1 - elasticity.poisson_ratio), 2 * G, 2 * G])


def projected_return(
    strain: Array, state: PlasticState, elasticity: Elasticity, hardening: LinearHardening
) -> Response:
    """Return stress with zz = 0, consistent tangent and new state: Simo and Taylor's return.

    In the modes ``(xx + yy, xx - yy) / sqrt(2)`` and ``sqrt(2) xy`` both the elastic stiffness and
    the deviatoric projection P are diagonal, so that the return is one scalar equation per point.
    With eta = stress - back stress in the modes, c the modal stiffness and g the multiplier:

    1. eta(g) = eta_trial / (1 + g (c P + 2/3 Hk)), phi(g) = sqrt(eta P eta)
    2. solve sqrt(2/3) R(p) = phi(g), p = p_n + sqrt(2/3) g phi; written as
       F(g) = sqrt(2/3) R_n / phi(g) + 2/3 Hi g - 1 = 0, which is increasing and concave, so
       Newton's iteration from g = 0 approaches the root from the left without a safeguard
    3. plastic strain += g P eta, its zz part is minus the sum of xx and yy
    4. tangent = Xi - (Xi P eta)(Xi P eta)' / (eta P Xi P eta (1 + beta))

    Parameters
    ----------
    strain : (4, n_points) total Mandel strain; its zz row is not read
    state : internal variables of the last converged state, left unchanged

    References
    ----------
    J.C. Simo, R.L. Taylor, Int. J. Numer. Meth. Engng 22 (1986) 649-670;
    Simo & Hughes (1998), box 3.3, p. 130-131.
    """
    n_points = strain.shape[1]
    C = plane_stiffness(elasticity)
    stress = C @ (strain - state.plastic_strain)
    tangent = np.repeat(C[:, :, None], n_points, axis=2)
    if np.isinf(hardening.yield_stress):
        return Response(stress, tangent, state, np.zeros(n_points, dtype=bool))

    Hi, Hk = hardening.isotropic_modulus, hardening.kinematic_modulus
    prager = hardening.prager_modulus
    radius = SQRT23 * hardening.flow_stress(state.accumulated)
    # P back = prager * plastic strain, P diagonal in the modes
    modal_back = hardening.back_stress(_MODES @ state.plastic_strain[_IN_PLANE]) / _P
    trial = _MODES @ stress[_IN_PLANE] - modal_back
    yielding = np.sqrt((_P * trial**2).sum(axis=0)) > radius
    if not yielding.any():
        return Response(stress, tangent, state, yielding)

    at = np.flatnonzero(yielding)
    c = _modal_stiffness(elasticity)[:, None]
    g, eta, phi = _multiplier(trial[:, at], radius[at], c * _P + prager, Hi)

    flow = _P * eta
    increment = _MODES.T @ (g * flow)
    plastic_strain = state.plastic_strain.copy()
    accumulated = state.accumulated.copy()
    plastic_strain[np.ix_(_IN_PLANE, at)] += increment
    plastic_strain[2, at] -= increment[0] + increment[1]
    accumulated[at] += SQRT23 * g * phi
    stress[np.ix_(_IN_PLANE, at)] -= _MODES.T @ (c * g * flow)

    theta1 = 1 + prager * g
    theta2 = 1 - 2 / 3 * Hi * g
    Xi = 1 / (1 / c + g / theta1 * _P)
    Xi_flow = Xi * flow
    along = (flow * Xi_flow).sum(axis=0)
    beta = 2 / 3 * theta1 / theta2 * (Hi * theta1 + Hk * theta2) * phi**2 / along
    modal = -Xi_flow[:, None] * Xi_flow[None] / (along * (1 + beta))
    modal[np.arange(3), np.arange(3)] += Xi
    rows, columns = np.ix_(_IN_PLANE, _IN_PLANE)
    tangent[rows[..., None], columns[..., None], at] = np.einsum(
        "ma,mnp,nb->abp", _MODES, modal, _MODES
    )
    return Response(stress, tangent, PlasticState(plastic_strain, accumulated), yielding)


def _multiplier(trial: Array, radius: Array, rate: Array, Hi: float) -> tuple[Array, Array, Array]:
    """Solve step 2 for each point; return the multiplier, eta and phi."""
    g = np.zeros(trial.shape[1])
    for _ in range(_MOST_OF_FLOW):
        eta = trial / (1 + g * rate)
        phi = np.sqrt((_P * eta**2).sum(axis=0))
        F = radius / phi + 2 / 3 * Hi * g - 1
        if np.abs(F).max() < 1e-13:
            break
        slope = radius / phi**3 * (_P * eta**2 * rate / (1 + g * rate)).sum(axis=0) + 2 / 3 * Hi
        g = g - F / slope
    return g, eta, phi
