"""Sweeps of a material along rows of points: by compiled loops where the law allows it.

The loops (`solver.rolling.kernels`) are the radial return of linear hardening from point to point.

Layers of perfectly plastic materials share one strain: each flows along the rows by these loops.

With any other law all rows flow together, column by column. Every increment calls `Law.respond`.
The only assumption on the law is a convex yield surface: a row that is inside at both ends of a
straight strain path is inside all along it, and needs no increments.

The derivative is propagated from column to column too. Within a column it is that of one increment,
by differences with respect to each internal variable and to strain. It is not exact, since a column
has several increments, but is good enough for Newton's method.
"""

from __future__ import annotations

from dataclasses import fields, replace
from functools import cached_property

import numpy as np

from solver.errors import NotConverged
from solver.late import late
from solver.materials.law import Law
from solver.materials.layered import Layered
from solver.materials.radial_return import SQRT23
from solver.materials.state import PlasticState
from solver.typing import Array, Ints

INFLOW = 0.1
"""Largest plastic strain added in the first column of the window, over that of the pass. Points
that an earlier pass left at yield flow as soon as the load approaches, however large the window is;
a ratio of 5 % changes stress by 1 % of the yield stress."""
LEAST = 0.05
"""Least plastic strain of a pass, over the yield strain, to which `INFLOW` refers. The deepest row
may add `INFLOW` times this level."""
PARTS = 16
"""Number of increments between two points of a row, for every law: the error is of first order in
their length. Under a braked wheel at draft accuracy the error of residual stress is 2 MPa in 500;
with four increments it is 8 to 9 MPa."""

flow, flow_along = late("rolling.kernels", "flow", "flow_along")


class CompiledSweep:
    """The internal variables of a material with linear hardening that flows along rows.

    Strains have n components, 4 or 6.

    Attributes
    ----------
    states : internal variables (..., n_rows, n_columns) at the columns
    ago : internal variables at the beginning of the last increment before each column
    """

    def __init__(self, law: Law, strain: Array, start: PlasticState, parts: int) -> None:
        rule, double_shear = law.linear_hardening, 2 * law.elasticity.shear_modulus
        assert rule is not None
        self._law = np.array(
            [
                double_shear,
                double_shear + rule.prager_modulus,
                rule.isotropic_modulus,
                double_shear + 2 / 3 * rule.modulus,
                rule.yield_stress,
            ]
        )
        self._each = (0,) * strain.shape[2]
        plastic = np.ascontiguousarray(start.plastic_strain.T)
        before = plastic, np.ascontiguousarray(start.accumulated)
        # numpy asks for zeros, and gets memory that costs nothing where nothing is written
        self._path = np.zeros((strain.shape[0], strain.shape[1] - 1, parts, strain.shape[2] + 2))
        plastic, total = flow(strain, *before, self._law, self._path, self._each)
        self.states = PlasticState(np.moveaxis(plastic, 2, 0), total)

    @property
    def ago(self) -> PlasticState:
        """Internal variables at the beginning of the last increment before each column."""
        last, n = self._path[:, :, -1], len(self._each)
        flowed = np.moveaxis(last[..., n, None] * last[..., :n], 2, 0)
        return PlasticState(
            self.states.plastic_strain - flowed, self.states.accumulated - SQRT23 * last[..., n]
        )

    def along(self, added: Array) -> tuple[Array, Array]:
        """Return the changes of plastic strain (n_rows, n_columns, n), and of the last column.

        The latter (n_rows, n_internal) are those of all internal variables, packed.

        Parameters
        ----------
        added : (n_rows, n_columns, n) change of strain at the columns
        """
        plastic, total = flow_along(added, self._law, self._path, self._each)
        return plastic, np.append(plastic[:, -1], total[:, -1:], axis=1)


_STEP = 1e-6
"""Step of differences over the largest value of a variable, or over the yield strain."""
_AT_REST, _ALMOST = 1e-11, 1e-8
"""Stress on planes y = const, over the yield stress, that counts as zero: the target, and the value
accepted if rounding in a law prevents more."""
_CLOSING = 60
"""Largest number of steps of Newton's method for the state behind the load."""
_FREE = np.array([1, 3])
"""Components yy and xy, whose strains follow from the condition that their stresses vanish."""


class SteppedSweep:
    """Sweep of a material with any law along rows; see `CompiledSweep`."""

    def __init__(self, law: Law, strain: Array, start: PlasticState, parts: int) -> None:
        self._law, self._start = law, start
        self._strain = strain = np.ascontiguousarray(np.moveaxis(strain, 2, 0))
        n_columns = strain.shape[2] - 1
        now = start.packed
        self._packed, self._ago = np.empty((2, *now.shape, n_columns))
        self._flowing: list[Ints] = []
        C = law.stiffness(len(strain))
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
        self.states = start.unpacked(self._packed)

    @property
    def ago(self) -> PlasticState:
        """See `CompiledSweep`."""
        return self._start.unpacked(self._ago)

    def along(self, added: Array) -> tuple[Array, Array]:
        """See `CompiledSweep`."""
        plastic = np.empty(added.shape)
        now = np.zeros(self._start.packed.shape).T
        for column, (at, slopes) in enumerate(zip(self._flowing, self._columns, strict=True)):
            if len(at):
                change = np.concatenate([now[at], added[at, column]], axis=1)
                now[at] = np.matmul(slopes, change[..., None])[..., 0]
            plastic[:, column] = now[:, : added.shape[2]]
        return plastic, now

    @cached_property
    def _columns(self) -> list[Array]:
        """Derivatives of the flowing rows in each column by previous variables and by strain."""
        upstream = np.concatenate([self._start.packed[..., None], self._packed[..., :-1]], axis=2)
        before = [upstream[:, at, column] for column, at in enumerate(self._flowing)]
        strain = [self._strain[:, at, column + 1] for column, at in enumerate(self._flowing)]
        own = np.concatenate(before, axis=1), np.concatenate(strain, axis=1)
        every = _slopes(self._law, self.states, *own)
        return np.split(every, np.cumsum([len(at) for at in self._flowing])[:-1])


class LayeredSweep:
    """Sweep of a layered material along rows, layer by layer; see `CompiledSweep`."""

    def __init__(self, law: Layered, strain: Array, start: PlasticState, parts: int) -> None:
        self._law = law
        each = zip(law.layers, law.states(start), strict=True)
        self._layers = [CompiledSweep(own, strain, state, parts) for (_, own), state in each]
        self.states = law.together([layer.states for layer in self._layers])

    @property
    def ago(self) -> PlasticState:
        """See `CompiledSweep`."""
        return self._law.together([layer.ago for layer in self._layers])

    def along(self, added: Array) -> tuple[Array, Array]:
        """See `CompiledSweep`."""
        plastic, ends = np.zeros(added.shape), []
        for (weight, _), layer in zip(self._law.layers, self._layers, strict=True):
            own, end = layer.along(added)
            plastic += weight * own
            ends.append(PlasticState(end[:, :-1].T, end[:, -1]))
        return plastic, self._law.together(ends).packed.T


def _slopes(law: Law, states: PlasticState, before: Array, strain: Array) -> Array:
    """Return the derivatives of internal variables (n_points, n, n + n_components), by differences.

    They are those over an increment, by its beginning and by its strain.

    Parameters
    ----------
    states : internal variables (..., n_rows, n_columns) of a sweep, for the steps of differences
    before : (n, n_points) internal variables at its beginning
    strain : (n_components, n_points) at its end
    """
    n, like = len(before), states.unpacked(states.packed[..., -1])
    given = np.concatenate([before, strain])

    def after(given: Array) -> Array:
        return law.respond(given[n:], like.unpacked(given[:n])).state.packed

    largest = {
        f.name: np.full_like(getattr(like, f.name), np.abs(getattr(states, f.name)).max(initial=0))
        for f in fields(like)
    }
    yield_strain = law.yield_stress / law.elasticity.youngs_modulus
    scale = np.append(replace(like, **largest).packed[:, 0], [yield_strain] * len(strain))
    base = after(given)
    out = np.zeros((before.shape[1], n, len(given)))
    for k, step in enumerate(_STEP * scale):
        if step:  # a variable that is zero everywhere does not change
            moved = given.copy()
            moved[k] += step
            out[:, :, k] = ((after(moved) - base) / step).T
    return out


def _linear_slopes(law: Law, after: PlasticState, before: Array, strain: Array) -> Array:
    """Return the derivatives of plastic strain (n_points, 4, 9) of a law with linear hardening.

    They are those of `_slopes`, without differences; ``after`` is the state at the end.
    """
    rule, double_shear = law.linear_hardening, 2 * law.elasticity.shear_modulus
    assert rule is not None
    tangent = law.respond(strain, after.unpacked(before)).tangent
    by_strain = np.moveaxis(law.stiffness(4)[..., None] - tangent, 2, 0) / double_shear
    flowed = after.plastic_strain - before[:4]
    size = np.linalg.norm(flowed, axis=0)
    way = np.divide(flowed, size, out=np.zeros_like(flowed), where=size > 0)
    threshold = SQRT23 * rule.isotropic_modulus / (double_shear + 2 / 3 * rule.modulus)
    by_flow = np.eye(4) - (1 + rule.prager_modulus / double_shear) * by_strain
    return np.concatenate([by_flow, -threshold * way.T[..., None], by_strain], axis=2)


class Flow:
    """A sweep in two dimensions, and the residual state of the half-plane behind it.

    Arguments are those of `sweep_of`.

    Attributes
    ----------
    sweep : the sweep
    after : internal variables (..., n_rows) behind the load
    """

    def __init__(self, law: Law, strain: Array, start: PlasticState, parts: int) -> None:
        self._law, self.sweep = law, sweep_of(law, strain, start, parts)
        states = self.sweep.states
        self._last = states.packed[..., -1]
        self.after, self._strain = _at_rest(law, states.unpacked(self._last))

    def along(self, added: Array) -> tuple[Array, Array]:
        """Return the changes of plastic strain (n_rows, n_columns, 4), and behind (n_rows, 4)."""
        plastic, end = self.sweep.along(added)
        return plastic, np.matmul(self._closing, end[..., None])[..., 0]

    @cached_property
    def _closing(self) -> Array:
        """Derivative (n_rows, 4, n) of the plastic strain behind by the last column's variables."""
        if self._law.linear_hardening:
            slopes = _linear_slopes(self._law, self.after, self._last, self._strain)
        else:
            slopes = _slopes(self._law, self.sweep.states, self._last, self._strain)[:, :4]
        n = slopes.shape[2] - 4
        C = self._law.stiffness(4)
        by_state, by_strain = slopes[..., :n], slopes[..., n:]
        stress = (C[_FREE] @ by_state, (C - C @ by_strain)[:, _FREE][..., _FREE])
        return by_state + by_strain[..., _FREE] @ _solved(stress[1], stress[0])


def _at_rest(law: Law, state: PlasticState) -> tuple[PlasticState, Array]:
    """Return internal variables and strain (4, n_rows) of rows behind the load, at rest.

    No stress acts on planes y = const.

    The strains along x and z return to zero in one increment. If the unloaded stress of a row is
    outside the yield surface, the row flows. This is the residual state of a half-plane, with 4
    components: of the strains only yy and xy follow from stress.

    1. strain at rest, if nothing flows
    2. Newton's method for the strains yy and xy, with the tangent of the law; a step that does not
       reduce the stress is halved

    Raises
    ------
    NotConverged
        if no such strain is found
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
        raise NotConverged("no residual state was found behind a steady pass")
    return law.respond(found, state).state, found


def _solved(matrices: Array, right: Array) -> Array:
    """Return the solutions (n, 2, m) of systems (n, 2, 2), or raise `NotConverged`."""
    try:
        return np.asarray(np.linalg.solve(matrices, right))
    except np.linalg.LinAlgError:
        raise NotConverged("the residual state behind a steady pass has no stiffness") from None


Sweep = CompiledSweep | SteppedSweep | LayeredSweep


def allowed_inflow(law: Law, most_added: float) -> float:
    """Return the largest plastic strain added at the edge of a window; see `INFLOW`."""
    return INFLOW * max(LEAST * law.yield_stress / law.elasticity.youngs_modulus, most_added)


def sweep_of(law: Law, strain: Array, start: PlasticState, parts: int) -> Sweep:
    """Return the sweep of material along rows; linear hardening and layers use compiled code.

    Parameters
    ----------
    strain : (n_rows, n_columns + 1, n) Mandel, downstream, n is 4 or 6; the first column is before
        the pass
    start : internal variables (..., n_rows) before the pass
    parts : number of equal increments of strain from one column to the next

    Raises
    ------
    NotConverged
        if the law has no state for these strains
    """
    if law.linear_hardening:
        return CompiledSweep(law, strain, start, parts)
    found: LayeredSweep | SteppedSweep
    if type(law) is Layered:
        found = LayeredSweep(law, strain, start, parts)
    else:
        found = SteppedSweep(law, strain, start, parts)
    if not np.isfinite(found.states.packed).all():
        raise NotConverged("the law has no state for the strains of a steady pass")
    return found
