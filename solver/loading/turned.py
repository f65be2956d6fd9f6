"""The contact problem of a Newton step in which contact forces turn with the surfaces.

With the stiffness K of the parts, their rigid motions R, and the unknowns of contact c, a step has

    u = K^-1 (r + H' F - T u_c) + (R - Z) q,   Z = K^-1 (K R),   u_c = M (a + C H' F + (R - Z) q)

where T is the stiffness of the turning forces (`solver.contact.turning`), C the compliance of the
unknowns c, ``M = (1 + C T)^-1``, and a the displacements by r alone. K R is not zero under load:
the forces within a body turn with it. The resultants of all forces on the rigid motions must
vanish.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.linalg import block_diag

from solver.contact.candidates import Candidates
from solver.contact.problem import ContactProblem
from solver.contact.turning import Turning
from solver.fem.operators import Operator
from solver.linear.solvers import Begun, Singular
from solver.typing import Array

Vectors = tuple[Array, ...]


def turned_problem(
    candidates: Candidates,
    turning: Turning,
    operators: Sequence[Operator],
    begun: Sequence[Begun],
    rigid: Sequence[tuple[Array, Array | None]],
    residuals: Sequence[Array],
) -> tuple[ContactProblem, Callable[[Array, Array], Vectors]]:
    """Return the problem, and a function of its forces and rigid motions to displacements.

    Parameters
    ----------
    begun : displacements of each part by its out-of-balance forces
    rigid : for each part, R and K R, None where that is zero
    residuals : external minus internal forces of each part, without contact forces [N]
    """
    H, T, forces = turning.rows, turning.stiffness, candidates.forces
    free, own, resultants = [], [], []
    for (R, KR), operator, r in zip(rigid, operators, residuals, strict=True):
        motion, D = R, np.zeros((R.shape[1],) * 2)
        if KR is not None:
            still = np.zeros(len(R))
            Z = np.stack([operator.begin(each).finish(still) for each in KR.T], axis=1)
            motion, D = R - Z, KR.T @ Z - R.T @ KR
        free.append(motion)
        own.append(D)
        resultants.append(motion.T @ r)
    each = zip(operators, turning.dofs, strict=True)
    C = block_diag(*(operator.compliance(at, np.eye(len(at))) for operator, at in each))
    a = np.concatenate([part.kept[at] for part, at in zip(begun, turning.dofs, strict=True)])
    R = block_diag(*(of[at] for of, at in zip(free, turning.dofs, strict=True)))
    try:
        M = np.linalg.inv(np.eye(len(T)) + C @ T)
    except np.linalg.LinAlgError as error:
        raise Singular("contact forces turn surfaces that do not resist") from error
    by_motion, TM = turning.motions @ M, T @ M
    W = by_motion @ C @ H.T
    kept = H - H @ (TM @ C).T
    problem = ContactProblem(
        W=W,
        offset=candidates.motion + by_motion @ a - W @ forces,
        lines=candidates.lines,
        A=kept @ R,
        G=by_motion @ R,
        balance=np.concatenate(resultants) - R.T @ (TM @ (a - C @ (H.T @ forces))),
        D=block_diag(*own) - R.T @ TM @ R,
    )

    def moved(forces: Array, q: Array) -> Vectors:
        more = H.T @ (forces - candidates.forces)
        change = turning.split(more - TM @ (a + C @ more + R @ q))
        motions = np.split(q, np.cumsum([of.shape[1] for of in free])[:-1])
        out = []
        for part, of, at, pushed, motion in zip(
            begun, free, turning.dofs, change, motions, strict=True
        ):
            nodal = np.zeros(len(of))
            nodal[at] = pushed
            out.append(part.finish(nodal) + of @ motion)
        return tuple(out)

    return problem, moved
