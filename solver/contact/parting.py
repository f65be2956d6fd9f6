"""Remove overlap before loading by rigid motions of bodies that no support holds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy
from scipy.linalg import null_space

from solver.contact.state import State
from solver.contact.system import System
from solver.typing import Array

_ROUNDS = 5
"""Number of times the motion is computed: surfaces that are curved need corrections."""
_FARTHEST = 5.0
"""Ratio of the motion to the overlap; above it bodies are not moved: a wedge or a taper would
lose its fit."""
_HELD = 1e-9
"""Residual of the dual problem; below it no rigid motion removes the overlap. Also the ratio of a
rigid motion by which links count as met to what they prevent."""


def parted(system: System, state: State) -> State:
    """Return the state with floating bodies moved until nothing overlaps.

    The state is returned unchanged if no motion removes the overlap, or only a much larger one.

    The smallest rigid motion q for which ``gap + A q >= 0`` is that of least distance (Lawson and
    Hanson 1974, chapter 23): of r, the residual of ``min |E y - f|, y >= 0`` with the rows of
    ``E' = [A, -gap]`` and f the last unit vector, ``q = -r / r_last``. If r is zero, no such motion
    exists: the overlap of bodies that are supported is removed by their deformation. Of rigid
    motions only those are made that links leave free.
    """
    ends = np.cumsum([part.rigid.shape[1] for part in system.parts])
    linked = system.linked_motions()
    free = null_space(linked, rcond=_HELD) if len(linked) else np.eye(ends[-1])
    moved, overlap = state, 0.0
    for _ in range(_ROUNDS + 1):
        rows, gaps = [], []
        for interface in system.interfaces:
            pairing = interface.pairing(moved.u, moved.time)
            at = np.isfinite(pairing.gap)
            A = system.rigid_rows(interface, pairing.normal, moved.u, len(at))
            rows.append(A[at])
            gaps.append(pairing.gap[at])
        A, gap = np.vstack(rows) @ free, np.concatenate(gaps)
        if not (gap < -system.touching).any():
            return system.at_rest(moved)
        overlap = max(overlap, -float(gap.min()))
        scale = float(np.abs(gap).max())
        E = np.vstack([A.T, -gap / scale])
        f = np.append(np.zeros(free.shape[1]), 1.0)
        y = _least_squares(E, f)
        r = E @ y - f
        if np.linalg.norm(r) < _HELD:
            return state
        q = -scale * free @ r[:-1] / r[-1]
        each = zip(system.parts, moved.u, np.split(q, ends[:-1]), strict=True)
        moved = replace(moved, u=tuple(u + part.rigid @ own for part, u, own in each))
        ways = (np.abs(u - u0).max() for u, u0 in zip(moved.u, state.u, strict=True))
        if max(ways) > _FARTHEST * overlap:
            return state
    return state


def _least_squares(E: Array, f: Array) -> Array:
    """Return the vector y without negative numbers for which |E y - f| is smallest."""
    found: Array = scipy.optimize.nnls(E, f)[0]
    return found
