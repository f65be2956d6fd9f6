"""Material of any law flowing along rows of points, all rows together from column to column.

The law is asked for every increment (`Law.respond`); nothing of it is known here but that its yield
surface is convex: rows that are inside at both ends of a straight path of strain are inside all
along it, and are not stepped.

The derivative is carried from column to column too. That of a column is taken over one increment,
by differences of the law by each of its internal variables and by strain. It leads Newton's method,
and is not exact: what flows within a column flows in several increments.
"""

from __future__ import annotations

from dataclasses import fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from solver.errors import NotConverged

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from solver.materials.law import Law
    from solver.materials.state import PlasticState

    Array = NDArray[np.float64]

_STEP = 1e-6
"""Step of the differences, over the largest value of a variable, or over the yield strain."""
_AT_REST, _ALMOST = 1e-11, 1e-8
"""Stress across planes y = const / yield stress that is nothing: as wanted, and where rounding lets
a law come no nearer."""
_CLOSING = 60
"""Most steps of Newton's method to rest."""
_FREE = np.array([1, 3])
"""Components yy and xy, whose strain follows from stress at rest."""


class _Left(NamedTuple):
    """What rows are left with: internal variables, and strain (4, n_rows)."""

    state: PlasticState
    strain: Array


class SteppedFlow:
    """Material on its way along rows; see `solver.steady.flow.Flow`."""

    def __init__(self, law: Law, strain: Array, start: PlasticState, parts: int) -> None:
        self._law, self._start = law, start
        self._strain = strain = np.ascontiguousarray(np.moveaxis(strain, 2, 0))
        n_columns = strain.shape[2] - 1
        now = start.packed
        self._packed, self._ago = np.empty((2, *now.shape, n_columns))
        self._flowing: list[NDArray[np.int64]] = []
        C = law.stiffness(4)
        for column in range(n_columns):
            first, last = strain[..., column], strain[..., column + 1]
            state = start.unpacked(now)
            stress = C @ (last - state.plastic_strain)
            at = np.flatnonzero(law.yield_value(stress, state) > 0)
            self._flowing.append(at)
            self._ago[..., column] = now
            if len(at):
                state, begin, way = state.at(at), first[:, at], last[:, at] - first[:, at]
                for part in range(1, parts + 1):
                    ago, state = state, law.respond(begin + part / parts * way, state).state
                now = now.copy()
                now[:, at] = state.packed
                self._ago[..., at, column] = ago.packed
            self._packed[..., column] = now
        if not np.isfinite(self._packed).all():
            raise NotConverged("the law has no state for the strains of a steady pass")
        self.states = start.unpacked(self._packed)
        self._left = _at_rest(law, start.unpacked(now))
        self.after = self._left.state

    @property
    def ago(self) -> PlasticState:
        """Internal variables at the beginning of the last increment before each column."""
        return self._start.unpacked(self._ago)

    def along(self, added: Array) -> tuple[Array, Array]:
        """Return the changes of plastic strain for a change of the strains."""
        plastic = np.empty(added.shape)
        now = np.zeros(self._start.packed.shape).T
        for column, (at, slopes) in enumerate(zip(self._flowing, self._columns, strict=True)):
            if len(at):
                change = np.concatenate([now[at], added[at, column]], axis=1)
                now[at] = np.matmul(slopes, change[..., None])[..., 0]
            plastic[:, column] = now[:, :4]
        return plastic, np.matmul(self._closing, now[..., None])[..., 0]

    @cached_property
    def _scale(self) -> Array:
        """Steps of differences (n + 4,): of internal variables and of strain."""
        largest = {
            f.name: np.full_like(getattr(self._start, f.name), np.abs(values).max(initial=0.0))
            for f in fields(self._start)
            for values in [getattr(self.states, f.name)]
        }
        scale = replace(self._start, **largest).packed[:, 0]
        yield_strain = self._law.yield_stress / self._law.elasticity.youngs_modulus
        return _STEP * np.append(scale, [yield_strain] * 4)

    def _slopes(self, before: Array, strain: Array) -> Array:
        """Return the derivatives (n_points, n, n + 4) of internal variables over an increment.

        Parameters
        ----------
        before : (n, n_points) internal variables at its beginning
        strain : (4, n_points) at its end
        """
        n = len(before)
        given = np.concatenate([before, strain])

        def after(given: Array) -> Array:
            return self._law.respond(given[n:], self._start.unpacked(given[:n])).state.packed

        base = after(given)
        out = np.zeros((before.shape[1], n, n + 4))
        for k, step in enumerate(self._scale):
            if step:  # what was never there does not change
                moved = given.copy()
                moved[k] += step
                out[:, :, k] = ((after(moved) - base) / step).T
        return out

    @cached_property
    def _columns(self) -> list[Array]:
        """Derivatives of the rows that flow in each column, by what they had and by its strain."""
        upstream = np.concatenate([self._start.packed[..., None], self._packed[..., :-1]], axis=2)
        before = [upstream[:, at, column] for column, at in enumerate(self._flowing)]
        strain = [self._strain[:, at, column + 1] for column, at in enumerate(self._flowing)]
        every = self._slopes(np.concatenate(before, axis=1), np.concatenate(strain, axis=1))
        return np.split(every, np.cumsum([len(at) for at in self._flowing])[:-1])

    @cached_property
    def _closing(self) -> Array:
        """Derivative (n_rows, 4, n) of the plastic strain that is left, by the last column's."""
        slopes = self._slopes(self._packed[..., -1], self._left.strain)[:, :4]
        n = slopes.shape[2] - 4
        C = self._law.stiffness(4)
        by_state, by_strain = slopes[..., :n], slopes[..., n:]
        stress = (C[_FREE] @ by_state, (C - C @ by_strain)[:, _FREE][..., _FREE])
        return by_state + by_strain[..., _FREE] @ _solved(stress[1], stress[0])


def _at_rest(law: Law, state: PlasticState) -> _Left:
    """Let rows come to rest behind the load, where no stress acts on planes y = const.

    The strains along x and z go back to zero, in one increment. A row that would be at rest outside
    the yield surface flows on its way there.

    1. strain of rest without flow
    2. Newton's method for the strains yy and xy, with the tangent of the law; a step that does not
       lessen the stress is halved

    Raises
    ------
    NotConverged
        where no such strain is found
    """
    nu = law.elasticity.poisson_ratio
    flowed = state.plastic_strain
    strain = np.zeros_like(flowed)
    strain[1] = flowed[1] + nu / (1 - nu) * (flowed[0] + flowed[2])
    strain[3] = flowed[3]
    found, step = strain, np.zeros_like(flowed)
    n = strain.shape[1]
    least, share = np.full(n, np.inf), np.ones(n)
    for _ in range(_CLOSING):
        trial = found - share * step
        response = law.respond(trial, state)
        stress = response.stress[_FREE]
        size = np.abs(stress).sum(axis=0)
        better = size < least
        found = np.where(better, trial, found)
        least = np.where(better, size, least)
        share = np.where(better, 1.0, 0.5 * share)
        if (least < _AT_REST * law.yield_stress).all():
            break
        tangent = np.moveaxis(response.tangent[np.ix_(_FREE, _FREE)], 2, 0)
        turned = _solved(tangent, stress.T[..., None])[..., 0].T
        step[_FREE] = np.where(better, turned, step[_FREE])
    if not (least < _ALMOST * law.yield_stress).all():
        raise NotConverged("what a steady pass leaves does not come to rest")
    return _Left(law.respond(found, state).state, found)


def _solved(matrices: Array, right: Array) -> Array:
    """Return the solutions (n, 2, m) of systems (n, 2, 2), or raise where one has none."""
    try:
        return np.asarray(np.linalg.solve(matrices, right))
    except np.linalg.LinAlgError:
        raise NotConverged("what a steady pass leaves has no stiffness across") from None
