"""Derivatives of gaps and slips with respect to the unknowns of a part."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.typing import Array, Ints


@dataclass(frozen=True, slots=True)
class ContactRows:
    """Derivatives of all gaps (and slips) with respect to the unknowns ``dofs`` of one part."""

    dofs: Ints
    block: Array


class OnParts:
    """Base of conditions between parts; ``rows`` are their derivatives on each part, or None."""

    __slots__ = ()
    rows: tuple[ContactRows | None, ...]

    def on_part(self, part: int, forces: Array, size: int) -> Array:
        """Return the nodal forces (size,) on a part, given the forces of the conditions [N]."""
        rows, nodal = self.rows[part], np.zeros(size)
        if rows is not None:
            nodal[rows.dofs] = forces @ rows.block
        return nodal


def joined(pieces: list[ContactRows]) -> ContactRows | None:
    """Return the sum of the rows of all surfaces of a part, on the unknowns that change them."""
    if not pieces:
        return None
    every, block = np.concatenate([p.dofs for p in pieces]), np.hstack([p.block for p in pieces])
    acts = block.any(axis=0)
    every, block = every[acts], block[:, acts]
    order = np.argsort(every, kind="stable")
    dofs, first = np.unique(every[order], return_index=True)
    return ContactRows(dofs, np.add.reduceat(block[:, order], first, axis=1))
