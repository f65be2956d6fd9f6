"""Loops compiled by numba: flow of a material along rows, and sums over the stations of a track.

The types of all arguments are fixed, so that importing this module compiles all that is ever used,
or reads what an earlier import compiled; `make setup` does this. Their users import it at the first
call: numba and the compiled code take 110 MB, which a process that does not roll does not need.

Rows of points: every row starts with the state before the pass and takes the strains of its points
one after the other. The derivative is propagated in the same way. The law is that of
`radial_return`, von Mises with linear isotropic and kinematic hardening, written in deviators.

Strains have n = 4 components in two dimensions and 6 in three. The loops take n from the length
of a tuple, not from the shape of an array: a tuple's length is part of its type, so that loops over
components are compiled for each n, and unrolled. The return is inlined, which halves the time.
"""

from __future__ import annotations

import math

import numpy as np
from numba import float32, float64, int64, njit, types

from solver.materials.radial_return import SQRT23
from solver.typing import Array, Ints

_Each = tuple[int, ...]
_LINE, _TABLE = float64[::1], float64[:, ::1]
_ROWS, _STEPS = float64[:, :, ::1], float64[:, :, :, ::1]
_EACH = tuple(types.UniTuple(int64, n) for n in (4, 6))


@njit(cache=True, inline="always")
def _trial(
    strain: Array, plastic: Array, accumulated: float, law: Array, step: Array, each: _Each
) -> tuple[float, float]:
    """Return the norm of the trial stress, and by how much it is beyond the yield surface.

    `step` receives the trial stress.
    """
    n = len(each)
    double_shear, kappa, Hi, _, Re = law
    mean = (strain[0] + strain[1] + strain[2]) / 3.0
    size = 0.0
    for k in range(n):
        trial = double_shear * (strain[k] - (mean if k < 3 else 0.0)) - kappa * plastic[k]
        step[k] = trial
        size += trial * trial
    size = math.sqrt(size)
    return size, size - SQRT23 * (Re + Hi * accumulated)


@njit(cache=True, inline="always")
def _return(
    strain: Array, plastic: Array, accumulated: float, law: Array, step: Array, each: _Each
) -> float:
    """Update `plastic` (n,) by an increment to `strain`; return the accumulated strain.

    `step` (n + 2,) receives the flow direction, the multiplier and the norm of the trial stress.
    """
    n = len(each)
    size, beyond = _trial(strain, plastic, accumulated, law, step, each)
    step[n + 1] = size
    if beyond <= 0.0:
        step[n] = 0.0
        return accumulated
    gamma = beyond / law[3]
    step[n] = gamma
    for k in range(n):
        step[k] /= size
        plastic[k] += gamma * step[k]
    return accumulated + SQRT23 * gamma


@njit(cache=True, inline="always")
def _return_along(
    strain: Array, plastic: Array, accumulated: float, law: Array, step: Array, each: _Each
) -> float:
    """Update the derivatives `plastic` (n,) and `accumulated` by the same increment."""
    n = len(each)
    gamma = step[n]
    if gamma == 0.0:
        return accumulated
    double_shear, kappa, Hi, modulus, _ = law
    mean = (strain[0] + strain[1] + strain[2]) / 3.0
    along = 0.0
    for k in range(n):
        trial = double_shear * (strain[k] - (mean if k < 3 else 0.0)) - kappa * plastic[k]
        along += step[k] * trial
    grows = (along - SQRT23 * Hi * accumulated) / modulus
    turn = gamma / step[n + 1]
    for k in range(n):  # the trial stress again: an array would be allocated in every call
        trial = double_shear * (strain[k] - (mean if k < 3 else 0.0)) - kappa * plastic[k]
        plastic[k] += grows * step[k] + turn * (trial - along * step[k])
    return accumulated + SQRT23 * grows


@njit([(_ROWS, _TABLE, _LINE, _LINE, _STEPS, each) for each in _EACH], cache=True)
def flow(
    strain: Array, plastic: Array, accumulated: Array, law: Array, steps: Array, each: _Each
) -> tuple[Array, Array]:
    """Let material flow along rows.

    From one column to the next strain grows in equal increments. If the state at both ends is
    within the yield surface, which is convex, all increments are elastic.

    Parameters
    ----------
    strain : (n_rows, n_columns + 1, n) Mandel, downstream; the first column is before the pass
    plastic, accumulated : (n_rows, n) and (n_rows,), before the pass
    law : 2 G, 2 G + 2/3 Hk, Hi, 2 G + 2/3 H, Re [MPa]
    steps : (n_rows, n_columns, parts, n + 2) zeros, for the increments from one column to the next;
        receives what `flow_along` needs
    each : a tuple with n entries, see above

    Returns
    -------
    plastic strain (n_rows, n_columns, n) and accumulated strain (n_rows, n_columns) at the columns
    """
    n = len(each)
    n_rows, n_columns, parts = steps.shape[:3]
    flowed = np.empty((n_rows, n_columns, n))
    total = np.empty((n_rows, n_columns))
    now, e, trial = np.empty(n), np.empty(n), np.empty(n)
    for row in range(n_rows):
        now[:] = plastic[row]
        a = accumulated[row]
        inside = _trial(strain[row, 0], now, a, law, trial, each)[1] <= 0.0
        for column in range(n_columns):
            elastic = _trial(strain[row, column + 1], now, a, law, trial, each)[1] <= 0.0
            if not (inside and elastic):
                for part in range(parts):
                    share = (part + 1.0) / parts
                    for k in range(n):
                        before = strain[row, column, k]
                        e[k] = before + share * (strain[row, column + 1, k] - before)
                    a = _return(e, now, a, law, steps[row, column, part], each)
            inside = True
            flowed[row, column] = now
            total[row, column] = a
    return flowed, total


@njit([(_ROWS, _LINE, _STEPS, each) for each in _EACH], cache=True)
def flow_along(strain: Array, law: Array, steps: Array, each: _Each) -> tuple[Array, Array]:
    """Return the changes of the results of `flow` for a change of strain.

    Parameters
    ----------
    strain : (n_rows, n_columns, n) change of strain at the columns; upstream it is zero
    steps : from `flow`
    each : a tuple with n entries, see above

    Returns
    -------
    changes of plastic strain (n_rows, n_columns, n) and accumulated strain (n_rows, n_columns)
    """
    n = len(each)
    n_rows, n_columns, parts = steps.shape[:3]
    flowed = np.empty((n_rows, n_columns, n))
    total = np.empty((n_rows, n_columns))
    now, e = np.empty(n), np.empty(n)
    for row in range(n_rows):
        now[:] = 0.0
        a = 0.0
        for column in range(n_columns):
            yields = steps[row, column, 0, n + 1] != 0.0  # else `flow` has left all of them zero
            for part in range(parts if yields else 0):
                if steps[row, column, part, n] == 0.0:
                    continue
                share = (part + 1.0) / parts
                for k in range(n):
                    before = strain[row, column - 1, k] if column else 0.0
                    e[k] = before + share * (strain[row, column, k] - before)
                a = _return_along(e, now, a, law, steps[row, column, part], each)
            flowed[row, column] = now
            total[row, column] = a
    return flowed, total


@njit(
    (float64[:, :, :, :, ::1], int64[::1], float64[:, ::1], int64[::1], float64[:, ::1]), cache=True
)
def between(blocks: Array, at: Ints, rows: Array, by: Ints, columns: Array) -> Array:
    """Return the effects of combinations of values on others; see `Influence.between`."""
    length, m = blocks.shape[:2]
    out = np.empty((len(at), len(by)))
    for i in range(len(at)):
        station, vertex = divmod(at[i], m)
        for j in range(len(by)):
            other, source = divmod(by[j], m)
            block = blocks[(station - other) % length, vertex, source]
            value = 0.0
            for a in range(3):
                if rows[i, a] != 0.0:
                    for b in range(3):
                        value += rows[i, a] * block[a, b] * columns[j, b]
            out[i, j] = value
    return out


@njit(
    [float64[:, :, ::1](kind[:, :, ::1], float64[:, :, ::1]) for kind in (float32, float64)],
    cache=True,
)
def weighted(forces: Array, columns: Array) -> Array:
    """Return sums (waves, k, n) of columns (waves, m, n), times forces (waves, k, m).

    Columns of nodes without force, most of them, are not read.
    """
    waves, count, size = forces.shape
    out = np.zeros((waves, count, columns.shape[2]))
    for wave in range(waves):
        for node in range(size):
            for k in range(count):
                force = forces[wave, k, node]
                if force != 0.0:
                    for row in range(columns.shape[2]):
                        out[wave, k, row] += force * columns[wave, node, row]
    return out
