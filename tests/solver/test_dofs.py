"""The numbering of unknowns, in the plane and in space."""

from __future__ import annotations

import numpy as np
import pytest

from solver.fem.nodes import Dofs, vectors


@pytest.mark.parametrize("dim", [2, 3])
def test_unknowns_of_nodes_are_those_of_their_vectors(dim):
    field = np.arange(5.0 * dim)  # of five nodes
    nodes = np.array([[4, 0], [2, 2]])
    found = Dofs(nodes, dim)
    for axis in range(dim):
        assert (field[found.along(axis)] == vectors(field, dim)[axis, nodes]).all()
    each = field[found.every].reshape(2, 2, dim)
    assert (each == np.moveaxis(vectors(field, dim)[:, nodes], 0, -1)).all()
