"""What a load on an endless prism makes beyond the same load repeated every length L.

The field of a load is an integral over wavenumbers k, that of the repeated load a trapezoidal sum
with step 2 pi / L. They differ by loads at the distances +-L, +-2 L, ...; from there only the
resultants count, and only small k, since these fields are smooth. So the resultants, spread along
x over a width of L / 8, are solved on the length 8 L by a few waves, and the solution on L, every
eighth of these waves, is subtracted. Then 64 L less 8 L with the width L, and so on.

The spread has the transform ``exp(-t) (1 + t + t^2 / 2)``, t = (k width)^2 / 2: what is missing is
of the sixth order in k.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.errors import ModelError
from solver.linear import solvers as linear
from solver.prism.modes import superposed
from solver.prism.section import I_AXIS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.prism.modes import Modes

    Array = NDArray[np.float64]

_RATIO = 8
"""Ratio of the lengths of two levels, and of a length to the width of the spread load on it."""
_CUT = 6.0
"""Product of k and width beyond which waves are left out: the transform is below 3e-6 there."""
_LOOSE = 1e-9
"""Singular value of the motions of the surface rows, of 1 at the farthest node; below it the rows
do not carry a resultant."""


class FarField:
    """The difference of an endless prism to one loaded every L, for loads near one station.

    Resultants (4,) are the forces along x, y and z [N] and the moment about x, at the middle of the
    nodes of the section [N mm].

    Parameters
    ----------
    modes : the prism of length L, with surface rows
    x : position at which the resultants act [mm]
    levels : number of lengths 8 L, 64 L, ...; the last one stands for endless. It must be long
        against the reach of a load: a rail on soft springs rolls, and moves along x, over 10 m

    Attributes
    ----------
    displacement : (n_rows, window, 4) of the surface rows for unit resultants [mm/N, 1/N]
    strain : (n_points, window, 6, 4) Mandel strain at the points of the zone [1/N, 1/(N mm)]
    beneath : (m, 4) displacement of the zone's unknowns at the resultants [mm/N, 1/N]
    last : (n_points, 1, 6, 4) strain of the last level alone, where the resultants act

    Raises
    ------
    ModelError
        if the surface rows cannot carry all four resultants
    """

    def __init__(self, modes: Modes, x: float, levels: int = 4) -> None:
        self._spacing = modes.length / modes.stations
        self._motions = modes.rows @ modes.section.rigid[modes.unknowns]
        size = np.abs(modes.section.rigid).max(axis=0)
        if np.linalg.matrix_rank(self._motions / size, tol=_LOOSE) < len(size):
            allowed = "must carry forces along x, y and z and a moment about x"
            raise ModelError("surface", f"{len(self._motions)} rows", allowed)
        k, share = _waves(modes.length, levels)
        u = _responses(modes, self._motions, k)
        flat = u.reshape(len(u), -1)
        strain = modes.B0 @ flat + modes.B1 @ (flat * np.repeat(k, u.shape[2]))
        phase = np.outer(k, modes.x - x)
        along = np.any(self._motions[modes.along] != 0, axis=0)

        def summed(
            amplitudes: Array,
            carrying: NDArray[np.bool_],
            phase: Array = phase,
            share: Array = share,
        ) -> Array:
            each = amplitudes.reshape(len(carrying), *u.shape[1:])
            return superposed(each, phase, share, carrying, along).swapaxes(1, 2)

        self.displacement = summed(modes.rows @ flat, modes.along)
        self.strain = modes.by_point(summed(strain, modes.carrying))
        axis = modes.unknowns % 3 == I_AXIS
        at_load = superposed(u, np.zeros((len(k), 1)), share, axis, along)
        self.beneath = at_load[..., 0]
        only = _waves(modes.length * _RATIO ** (levels - 1), 1)
        last = np.zeros_like(share)
        last[np.abs(only[0][:, None] - k).argmin(axis=1)] = only[1]
        here = np.zeros((len(k), 1))
        self.last = modes.by_point(summed(strain, modes.carrying, here, last))

    def resultants(self, forces: Array) -> Array:
        """Return the resultants (4,) of forces (n_rows, window) on the surface rows [N/mm]."""
        return self._spacing * (self._motions.T @ forces.sum(axis=1))


def _waves(length: float, levels: int) -> tuple[Array, Array]:
    """Return the wavenumbers (n,) of all levels, and the shares (n,) of their amplitudes."""
    shares: dict[int, float] = {}
    longest = length * _RATIO**levels
    for level in range(1, levels + 1):
        period = length * _RATIO**level
        width = period / _RATIO**2
        for j in range(int(_CUT * period / (2 * np.pi * width)) + 1):
            t = (2 * np.pi * j / period * width) ** 2 / 2
            spread = np.exp(-t) * (1 + t + t**2 / 2)
            both_signs = 2.0 if j else 1.0
            less = 1.0 if j % _RATIO else 1.0 - _RATIO
            at = j * _RATIO ** (levels - level)
            shares[at] = shares.get(at, 0.0) + spread * both_signs * less / period
    waves = np.array(sorted(shares))
    return 2 * np.pi / longest * waves, np.array([shares[j] for j in waves.tolist()])


def _responses(modes: Modes, motions: Array, wavenumbers: Array) -> Array:
    """Return amplitudes (m, waves, 4) in the zone for unit resultants on the surface rows.

    Forces on the rows are the least ones with these resultants.
    """
    section = modes.section
    forces = np.zeros((section.n, motions.shape[1]))
    forces[modes.unknowns] = modes.rows.T @ np.linalg.pinv(motions).T
    whole = section.stiffness(section.free)
    solver = linear.analyse(whole.pattern)
    at = np.searchsorted(section.free, modes.unknowns)
    u = np.empty((len(at), len(wavenumbers), motions.shape[1]))
    for wave, k in enumerate(wavenumbers):
        solver.factorise(whole.at(k))
        u[:, wave] = solver.solve(forces[section.free])[at]
    return u
