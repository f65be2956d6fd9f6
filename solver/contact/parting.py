"""Removal of overlap before loading, by rigid motions of bodies that no support holds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy
from scipy.linalg import null_space

from solver.contact.state import State
from solver.contact.system import System
from solver.typing import Array

_ROUNDS = 5
"""Most computations of the motion: curved surfaces need corrections."""
_FARTHEST = 5.0
"""Largest motion over the overlap; with a larger one, as of a wedge, bodies are not moved."""
_HELD = 1e-9
"""Residual of the dual problem: with a smaller one no rigid motion removes the overlap. Also the
least singular value, over the largest one, of a rigid motion that links prevent."""


def parted(system: System, state: State) -> State:
    """Return the state with floating bodies moved until nothing overlaps.

    The state is unchanged if no rigid motion removes the overlap, or only one much larger than it;
    the bodies then deform. Rigid motions that links prevent are left out.

    The smallest rigid motion q with ``gap + A q >= 0`` is a problem of least distance (Lawson and
    Hanson 1974, chapter 23): ``q = -r / r_last`` with the residual r of ``min |E y - f|, y >= 0``,
    the rows of ``E' = [A, -gap]`` and f the last unit vector. If r is zero, there is no such q.
    """
    ends = np.cumsum([part.rigid.shape[1] for part in system.parts])
    linked = system.linked_motions(state.u)
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
        if not (gap < -system.gap_tolerance).any():
            return system.at_rest(moved)
        overlap = max(overlap, -float(gap.min()))
        scale = float(np.abs(gap).max())
        E = np.vstack([A.T, -gap / scale])
        f = np.append(np.zeros(free.shape[1]), 1.0)
        y: Array = scipy.optimize.nnls(E, f)[0]
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
