"""The answer of a section to fixed forces at many wavenumbers, from its answers at a few.

With the displacements V at some wavenumbers, split into those along x and those across, the answer
at any other one is sought among their sums V y, by ``V' K_k V y = V' f``. Its error falls
exponentially with their number, since K_k is a polynomial of k. Split answers hold those at -k too.
What the equations are missed by halfway between two wavenumbers decides whether this one is added.

A.K. Noor, J.M. Peters, AIAA Journal 18 (1980) 455-462 (reduced basis technique).
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from solver.linear import solvers as linear
from solver.rolling.rail.section import I_AXIS, Carried, Section
from solver.typing import Array, Bools

_FIRST = 24
"""Number of wavenumbers with which it begins."""
_WIDE = 3.0
"""Product of wavenumber and size of the section, above which answers change with the wavenumber,
not with its logarithm."""
_MISSED = 1e-5
"""Largest residual over the largest force of a load. Strain of the far field of a rail then errs by
2e-5; with the first wavenumbers the residual is a tenth of this, and strain errs by 1e-6."""
_ROUNDED = 1e-14
"""Residual over the product of stiffness and displacement that rounding may make."""
_SAME = 1e-12
"""Singular value, of 1 for the largest, below which a direction is none of its own."""


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
    """Return the answers of a section to forces (section.n, q) at wavenumbers (waves,) [N/mm]."""
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
        tried = _halfway(sorted(answers))
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
    """Return the numbers of the wavenumbers (waves,), not negative, with which it begins."""
    bend = _WIDE / size
    at = np.sin(np.pi / 2 * np.linspace(0.0, 1.0, _FIRST)) ** 2  # closer at the ends
    wanted = bend * np.expm1(np.log1p(k.max() / bend) * at)
    return np.unique(np.abs(k - wanted[:, None]).argmin(axis=1)).tolist()


def _halfway(waves: list[int]) -> list[int]:
    """Return the numbers halfway between increasing ones, where there are any between."""
    return [(one + other) // 2 for one, other in pairwise(waves) if other - one > 1]


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
