"""Numbering of unknowns: node by node, one per axis."""

from __future__ import annotations

from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from solver.typing import Ints

Kind = TypeVar("Kind", bound=np.generic)


class Dofs(NamedTuple):
    """The unknowns of nodes (..., n) in a space of ``dim`` axes."""

    nodes: Ints
    dim: int

    def along(self, axis: int) -> Ints:
        """Return the unknown (..., n) of each node along an axis."""
        return self.dim * self.nodes + axis

    @property
    def every(self) -> Ints:
        """All unknowns (..., dim n), node by node."""
        each = np.stack([self.along(axis) for axis in range(self.dim)], axis=-1)
        return each.reshape(*self.nodes.shape[:-1], -1)


def vectors(values: NDArray[Kind], dim: int) -> NDArray[Kind]:
    """Return the vectors (dim, n) at nodes whose unknowns have values (dim n,)."""
    return values.reshape(-1, dim).T
