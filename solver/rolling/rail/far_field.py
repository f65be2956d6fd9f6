"""The far field: what an endless prism under a load adds to one that is loaded every length L.

The field of a load is an integral over wavenumbers k, that of the repeated load a trapezoidal sum
with step 2 pi / L. They differ by loads at the distances +-L, +-2 L, ...; from there only the
resultants count, and only small k, since these fields are smooth. So the resultants, spread along
x over a width of L / 8, are solved on the length 8 L by a few waves, and the solution on L, every
eighth of these waves, is subtracted. Then 64 L less 8 L with the width L, and so on.

The spread has the transform ``exp(-t) (1 + t + t^2 / 2)``, t = (k width)^2 / 2: its error is of the
sixth order in k.

In a prism *clamped* at both ends of a span, forces and moments act on the section beyond the ends,
so that in the mean the section does not move at the ends. Within the span the field of an end is
that of loads beyond it: both are made of the waves that fade away from the end. Bending in both
planes, torsion, shear and foundation are those of the section, not of a theory of beams.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from solver.errors import ModelError
from solver.linear import solvers as linear
from solver.rolling.rail.modes import Modes, superposed
from solver.rolling.rail.section import I_AXIS, I_COMPONENTS, Carried, Section
from solver.typing import Array, Bools

_FIRST = 24
"""Number of wavenumbers at which the section is solved first."""
_WIDE = 3.0
"""Product of wavenumber and size of the section above which answers vary with the wavenumber, below
with its logarithm."""
_MISSED = 1e-5
"""Tolerance: largest residual over the largest force of a load. The strain of the far field of a
rail then has an error of 2e-5. With the first wavenumbers the residual is a tenth of this, and the
error is 1e-6."""
_ROUNDED = 1e-14
"""Residual by rounding, over the product of stiffness and displacement."""
_SAME = 1e-12
"""Singular value, over the largest, below which a direction depends on the others."""


class SampledAnswers(NamedTuple):
    """Displacements ``basis @ shares[:, wave, load]`` of a section.

    Attributes
    ----------
    basis : (n, r) displacements of all unknowns [mm]
    shares : (r, waves, q) of them in the answer to each load
    """

    basis: Array
    shares: Array


def sampled_answers(section: Section, forces: Array, wavenumbers: Array) -> SampledAnswers:
    """Return the answers of a section to forces (section.n, q) at wavenumbers (waves,) [N/mm].

    Let V be the displacements at a few wavenumbers, split into those along x and those across. The
    answer at any other wavenumber is approximated by V y, with ``V' K_k V y = V' f``. The error
    falls exponentially with their number, since K_k is a polynomial of k. Split answers include
    those at -k. A wavenumber halfway between two others is added if the residual there is too
    large.

    A.K. Noor, J.M. Peters, AIAA Journal 18 (1980) 455-462 (reduced basis technique).
    """
    free, f = section.free, forces[section.free]
    stiffness = section.stiffness(free)
    solver = linear.analyse(stiffness.pattern)
    carried = Carried(section.loose[free], section.sprung[free])
    terms = stiffness.terms
    stiffest = np.abs(terms[0].data).max()
    answers: dict[int, Array] = {}
    more = _spread(np.abs(wavenumbers), np.ptp(section.plane.X, axis=1).max())
    while more:
        for wave in more:
            k = wavenumbers[wave]
            solver.factorise(stiffness.at(k))
            answers[wave] = solver.solve(f) if k else carried.solved(solver.solve, f)
        basis = _split(np.hstack(list(answers.values())), free % 3 == I_AXIS)
        on_basis = [term @ basis for term in terms]
        K0, K1, K2 = (basis.T @ each for each in on_basis)
        right = basis.T @ f
        shares = np.stack(
            [np.linalg.solve(K0 + k * (K1 + k * K2), right) for k in wavenumbers], axis=1
        )
        for wave, answer in answers.items():  # also where rounding of the stiffness would count
            shares[:, wave] = basis.T @ answer
        tried = [(one + other) // 2 for one, other in pairwise(sorted(answers)) if other > one + 1]
        made, k = shares[:, tried], wavenumbers[tried, None]
        sides = [np.tensordot(on_basis[power], made * k**power, 1) for power in range(len(terms))]
        missed = np.abs(f[:, None] - sum(sides)).max(axis=0)
        rounded = _ROUNDED * stiffest * np.abs(made).max(axis=0)
        bad = (missed > np.maximum(_MISSED * np.abs(f).max(axis=0), rounded)).any(axis=1)
        more = [wave for wave, is_bad in zip(tried, bad, strict=True) if is_bad]
    whole = np.zeros((section.n, basis.shape[1]))
    whole[free] = basis
    return SampledAnswers(whole, shares)


def _spread(k: Array, size: float) -> list[int]:
    """Return the numbers of the first wavenumbers, of all (waves,), which are not negative."""
    bend = _WIDE / size
    at = np.sin(np.pi / 2 * np.linspace(0.0, 1.0, _FIRST)) ** 2  # closer at the ends
    wanted = bend * np.expm1(np.log1p(k.max() / bend) * at)
    return np.unique(np.abs(k - wanted[:, None]).argmin(axis=1)).tolist()


def _split(answers: Array, along: Bools) -> Array:
    """Return orthonormal directions (n, r) of answers (n, q), apart along x and across."""
    parts = []
    for some in (along, ~along):
        size = np.linalg.norm(answers[some], axis=0)
        each = answers[some][:, size > 0] / size[size > 0]
        directions, singular, _ = np.linalg.svd(each, full_matrices=False)
        own = directions[:, singular > _SAME * singular.max(initial=0.0)]
        whole = np.zeros((len(answers), own.shape[1]))
        whole[some] = own
        parts.append(whole)
    return np.hstack(parts)


_RATIO = 8
"""Ratio of the lengths of two levels, and of a length to the width of the spread load on it."""
_CUT = 6.0
"""Product of k and width above which waves are neglected: the transform is below 3e-6 there."""
_LOOSE = 1e-9
"""The surface rows cannot carry a resultant if the smallest singular value of their motions, of 1
at the farthest node, is below this."""
_ALONG = np.array([True, False, False, False, True, True])
"""Whether motions of a section, as `Section.mean_motions`, are along x; resultants are the first
four of them."""
_ROOM = 1.5
"""Least length of the first level with loads beyond the ends, over the span."""
_BEYOND = 4.0
"""Distance of these loads from the ends, over the width of their spread."""


class FarField:
    """The far field of an endless or clamped prism, for loads near one station.

    Resultants (4,) are the forces along x, y and z [N] and the moment about x, at the middle of the
    nodes of the section [N mm].

    Parameters
    ----------
    modes : the prism of length L, with surface rows
    x : position at which the resultants act [mm]
    levels : number of lengths 8 L, 64 L, ...; the last one stands for endless. It must be long
        against the reach of a load: a rail on soft springs rolls, and moves along x, over 10 m
    span : length of a prism clamped at both ends, the resultants in the middle [mm]; None if it
        is endless

    Attributes
    ----------
    displacement : (n_rows, window, 4) of the surface rows for unit resultants [mm/N, 1/N]
    strain : (n_points, window, 6, 4) Mandel strain at the points of the zone [1/N, 1/(N mm)]
    beneath : (m, 4) displacement of the zone's unknowns at the resultants [mm/N, 1/N]
    last : (n_points, 1, 6, 4) strain of the last level alone, where the resultants act

    Raises
    ------
    ModelError
        if the surface rows cannot carry all four resultants, or the levels are shorter than a span
    """

    def __init__(self, modes: Modes, x: float, levels: int = 4, span: float | None = None) -> None:
        self._modes, self._spacing = modes, modes.length / modes.stations
        self._motions = modes.rows @ modes.section.rigid[modes.unknowns]
        size = np.abs(modes.section.rigid).max(axis=0)
        if np.linalg.matrix_rank(self._motions / size, tol=_LOOSE) < len(size):
            allowed = "must carry forces along x, y and z and a moment about x"
            raise ModelError("surface", f"{len(self._motions)} rows", allowed)
        section = modes.section
        forces = np.zeros((section.n, len(size)))
        # the least forces on the rows with these resultants
        forces[modes.unknowns] = modes.rows.T @ np.linalg.pinv(self._motions).T
        shares = _shares(modes.length, levels)
        waves = sorted(shares)
        self._k = 2 * np.pi / (modes.length * _RATIO**levels) * np.array(waves)
        every = forces if span is None else np.hstack([forces, section.mean_motions.T])
        basis, found = sampled_answers(section, every, self._k)
        self._basis = basis
        n = len(size)

        def own(shares: dict[int, float]) -> _SectionLoad:
            return _SectionLoad(found[..., :n], self._k, _listed(shares, waves), _ALONG[:n])

        self._sources = [_FarLoad(own(shares), 0.0, np.eye(n))]
        if span is not None:
            first, beyond = _level_of(modes.length, levels, span)
            shares = _shares(modes.length, levels, first)
            ends = _SectionLoad(found[..., n:], self._k, _listed(shares, waves), _ALONG)
            moved = section.mean_motions @ basis
            self._sources += _clamped(own(shares), ends, moved, span / 2, beyond)
        apart = np.asarray(modes.x - x, dtype=float)
        self.displacement = self._summed(modes.rows @ self._own, modes.along, apart)
        self.strain = self.strain_at(apart)
        axis = modes.unknowns % 3 == I_AXIS
        self.beneath = self._summed(self._own, axis, np.zeros(1))[:, 0]
        only = _shares(modes.length * _RATIO ** (levels - 1), 1)
        self.last = self.strain_at(np.zeros(1), [_FarLoad(own(only), 0.0, np.eye(n))])

    def resultants(self, forces: Array) -> Array:
        """Return the resultants (4,) of forces (n_rows, window) on the surface rows [N/mm]."""
        return self._spacing * (self._motions.T @ forces.sum(axis=1))

    def strain_at(self, apart: Array, sources: list[_FarLoad] | None = None) -> Array:
        """Return ``strain`` (n_points, n, 6, 4) at distances (n,) from the resultants along x."""
        modes = self._modes
        still = self._summed(modes.B0 @ self._own, modes.carrying, apart, sources)
        waving = self._summed(modes.B1 @ self._own, modes.carrying, apart, sources, power=1)
        return modes.by_point(still + waving)

    @cached_property
    def around(self) -> Array:
        """Strain (n, 6, 4) at all points of the section where the resultants act, Mandel."""
        section = self._modes.section
        B0, B1 = section.strain_matrices(np.arange(len(section.dofs)), np.arange(section.n))
        carrying = np.isin(np.arange(6), I_COMPONENTS).repeat(section.weights.size)
        here = np.zeros(1)
        still = self._summed(B0 @ self._basis, carrying, here)
        waving = self._summed(B1 @ self._basis, carrying, here, power=1)
        return np.asarray((still + waving)[:, 0].reshape(6, -1, 4).swapaxes(0, 1))

    @property
    def _own(self) -> Array:
        """The directions (m, r) of the zone's unknowns."""
        return self._basis[self._modes.unknowns]

    def _summed(
        self, directions: Array, carrying: Bools, apart: Array,
        sources: list[_FarLoad] | None = None, power: int = 0,
    ) -> Array:  # fmt: skip
        """Return results (n_results, n, 4) at distances (n,), times k^power.

        ``directions`` (n_results, r) are those of the section's directions, ``carrying``
        (n_results,) is whether a result carries i.
        """
        each = [
            source.load.summed(apart - source.x, power) @ source.factors
            for source in (self._sources if sources is None else sources)
        ]
        return _combined(directions, np.sum(each, axis=0), carrying)


def _combined(directions: Array, sums: Array, carrying: Bools) -> Array:
    """Return results (n_results, n, q) from directions (n_results, r) and `_SectionLoad.summed`."""
    out = np.empty((len(carrying), *sums.shape[2:]))
    for flag in (False, True):
        some = carrying == flag
        out[some] = np.tensordot(directions[some], sums[int(flag)], 1)
    return out


@dataclass(frozen=True, slots=True, eq=False)
class _SectionLoad:
    """Unit loads (q,) at one place, and their fields.

    ``made`` (r, waves, q) shares of directions of the section in the answers, ``k`` (waves,) and
    ``share`` (waves,) of the waves, ``along`` (q,) whether a load carries i.
    """

    made: Array
    k: Array
    share: Array
    along: Bools

    def summed(self, apart: Array, power: int = 0) -> Array:
        """Return the directions' shares (2, r, n, q) at distances (n,), times k^power.

        They are those for results that do not carry i, and for results that do.
        """
        made, phase = self.made * self.k[:, None] ** power, np.outer(self.k, apart)
        sums = [
            superposed(made, phase, self.share, np.full(len(made), carrying), self.along)
            for carrying in (False, True)
        ]
        return np.stack(sums).swapaxes(2, 3)


@dataclass(frozen=True, slots=True, eq=False)
class _FarLoad:
    """Loads at a distance ``x`` from the resultants, and their ``factors`` (q, 4) by these."""

    load: _SectionLoad
    x: float
    factors: Array


def _clamped(
    own: _SectionLoad, ends: _SectionLoad, mean: Array, half: float, beyond: float
) -> list[_FarLoad]:
    """Return the loads beyond both ends +-half with which the section does not move there.

    ``mean`` (6, r) are the mean motions of the section by its directions.
    """
    places, at = half * np.array([-1.0, 1.0]), (half + beyond) * np.array([-1.0, 1.0])

    def moved(load: _SectionLoad, apart: Array) -> Array:
        """Return mean motions (n, 6, q) at distances (n,) from the load."""
        return _combined(mean, load.summed(apart), ends.along).swapaxes(0, 1)

    by_load = moved(own, places).reshape(-1, len(own.along))
    apart = (places[:, None] - at).ravel()
    n = len(ends.along)
    by_ends = moved(ends, apart).reshape(2, 2, n, n).swapaxes(1, 2).reshape(2 * n, -1)
    factors = np.asarray(np.linalg.solve(by_ends, -by_load), dtype=float).reshape(2, n, -1)
    return [_FarLoad(ends, x, each) for x, each in zip(at, factors, strict=True)]


def _level_of(length: float, levels: int, span: float) -> tuple[int, float]:
    """Return the first level longer than a span, and the distance of loads beyond its ends."""
    if not span > 0:
        raise ModelError("span", span, "must be positive [mm]")
    for level in range(1, levels + 1):
        period = length * _RATIO**level
        if period >= _ROOM * span:
            return level, _BEYOND * period / _RATIO**2
    most = length * _RATIO**levels / _ROOM
    raise ModelError("span", span, f"must be at most {most:g} mm with {levels} levels of far field")


def _shares(length: float, levels: int, first: int | None = None) -> dict[int, float]:
    """Return the shares of waves in the sum of all levels, by their numbers on the longest length.

    They are what the levels add to the load repeated every ``length``. With ``first`` they are all
    that a single load makes far from it, by the levels from that one on.
    """
    shares: dict[int, float] = {}
    for level in range(first or 1, levels + 1):
        period = length * _RATIO**level
        width = period / _RATIO**2
        for j in range(int(_CUT * period / (2 * np.pi * width)) + 1):
            t = (2 * np.pi * j / period * width) ** 2 / 2
            spread = np.exp(-t) * (1 + t + t**2 / 2)
            both_signs = 2.0 if j else 1.0
            less = 1.0 if j % _RATIO or level == first else 1.0 - _RATIO
            at = j * _RATIO ** (levels - level)
            shares[at] = shares.get(at, 0.0) + spread * both_signs * less / period
    return shares


def _listed(shares: dict[int, float], waves: list[int]) -> Array:
    """Return the shares (n,) of waves by number, 0 where there is none."""
    return np.array([shares.get(j, 0.0) for j in waves])
