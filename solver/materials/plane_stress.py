"""Plane stress for any law: the projected return, or the thickness strain solved at each point."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver.materials.law import Law
from solver.materials.projected_return import plane_stiffness, projected_return
from solver.materials.state import PlasticState, Response
from solver.materials.wrapped import Wrapped
from solver.typing import Array, Bools, Ints

_ZZ = 2
_ROUNDING = float(np.finfo(float).eps)
"""Ratio of stress zz to the magnitude of its terms; up to it stress zz is rounding."""
_SMALL = 1e-9
"""The same for laws that iterate and are less exact; used when further steps do not improve."""
_MAX_ITERATIONS = 100


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
        for _ in range(_MAX_ITERATIONS):
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
