"""Fields of all bodies at the nodes of their meshes, for drawing and for other programs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from solver.results.body_fields import BODY_FIELDS
from solver.typing import Array, Ints

NO_NODE = -1
"""Node number that fills the rows of faces and cells with fewer nodes."""

_QUAD8 = (0, 4, 7), (1, 5, 4), (2, 6, 5), (3, 7, 6), (4, 5, 6, 7)
_ENDS = (0, 1, 2, 3, 8, 9, 10, 11), (4, 5, 6, 7, 12, 13, 14, 15)
"""Nodes of two opposite faces of a hexahedron, in the order of a quadrilateral."""
_FACES: Mapping[int, tuple[tuple[int, ...], ...]] = {
    3: ((0, 1, 2),),
    4: ((0, 1, 2, 3),),
    6: ((0, 3, 5), (1, 4, 3), (2, 5, 4), (3, 4, 5)),
    8: _QUAD8,
    9: ((0, 4, 8, 7), (4, 1, 5, 8), (8, 5, 2, 6), (7, 8, 6, 3)),
    20: (*(tuple(end[k] for k in face) for end in _ENDS for face in _QUAD8), (16, 17, 18, 19)),
}
"""Triangles and quadrilaterals that together use all nodes, by number of nodes of an element."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeshFields:
    """Fields at the nodes of all bodies, body after body, in N, mm, MPa.

    Attributes
    ----------
    X : (n_axes, n_nodes) positions of the nodes before loading
    bodies : for each body its element and the nodes (n_cells, k) of its cells: corners, mid-sides,
        middle; in two dimensions counterclockwise, for hexahedra in the order of VTK
    stages : for each stage the fields of `BodyValues` by name
    """

    X: Array
    bodies: Mapping[str, tuple[str, Ints]]
    stages: Mapping[str, Mapping[str, Array]]

    @property
    def faces(self) -> tuple[Ints, Ints]:
        """Triangles and quadrilaterals through all nodes, and the number of their body.

        Elements with mid-side nodes are divided. The last node of a triangle is `NO_NODE`.

        Returns
        -------
        (n_faces, 4) nodes and (n_faces,) numbers
        """
        faces, numbers = [], []
        for number, (_, cells) in enumerate(self.bodies.values()):
            for corners in _FACES[cells.shape[1]]:
                nodes = cells[:, corners]
                lacking = ((0, 0), (0, 4 - len(corners)))
                faces.append(np.pad(nodes, lacking, constant_values=NO_NODE))
                numbers.append(np.full(len(nodes), number))
        return np.vstack(faces), np.concatenate(numbers)

    def parts(self, stage: str) -> Iterator[tuple[str, Array]]:
        """Yield the fields of a stage as numbers (n_nodes,) with names such as ``stress_xx``."""
        for name, field in BODY_FIELDS.items():
            values = np.atleast_2d(self.stages[stage][name])
            yield from zip(field.numbers(len(self.X)), values, strict=True)

    def joined(self, other: MeshFields) -> MeshFields:
        """Return the bodies of both; axes and stages must be the same."""
        first = self.X.shape[1]
        moved = {name: (element, first + cells) for name, (element, cells) in other.bodies.items()}
        stages = {
            stage: {
                name: np.concatenate([values, other.stages[stage][name]], axis=-1)
                for name, values in own.items()
            }
            for stage, own in self.stages.items()
        }
        return MeshFields(
            X=np.hstack([self.X, other.X]), bodies={**self.bodies, **moved}, stages=stages
        )


def counterclockwise(cells: Ints, X: Array) -> Ints:
    """Return the nodes of cells (n, k) in counterclockwise order, as other programs expect."""
    corners = 4 if cells.shape[1] in (4, 8, 9) else 3
    (x, y), ahead = X[:, cells[:, :corners]], np.roll(X[:, cells[:, :corners]], -1, axis=2)
    right = (x * ahead[1] - y * ahead[0]).sum(axis=1) < 0
    order = np.arange(cells.shape[1])
    order[1:corners] = order[1:corners][::-1]
    order[corners : 2 * corners] = order[corners : 2 * corners][::-1]
    return np.where(right[:, None], cells[:, order], cells)
